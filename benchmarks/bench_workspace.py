"""Workspace scan by roadmap: time, memory, growth, and ratio to planning per frame.

Run it on an idle machine: ``make bench`` or ``python benchmarks/bench_workspace.py``,
with sizes (1x 4x 16x) to leave others out: all of them take a quarter of an hour.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Sequence

import numpy as np

from reachmap.cell.loading import read_cell
from reachmap.core.scene import Scene
from reachmap.runtime.job import Job
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress
from reachmap.runtime.run import run
from reachmap.sampling.frames import workspace_frames
from reachmap.scans.ik_survey import (
    Survey,
    SurveyContext,
    join_surveys,
    prepare_survey,
    survey_unit,
)
from reachmap.scans.workspace_per_frame import plan_frames
from reachmap.scans.workspace_roadmap import connect_survey, results_of_connection

CELL = "ur5-eye-in-hand"
SAMPLE = 100
# Points along x and y of each cube, and the distance of levels [m]: about 1, 4, 16
# times as many frames over the same space.
SIZES = {"1x": ((11, 6), 0.1), "4x": ((21, 12), 0.1), "16x": ((42, 24), 0.1)}


def scan(overrides: Sequence[str], workers: int) -> tuple[int, int, dict[str, float]]:
    """Frames, reachable frames, and seconds per phase of one scan."""
    loaded = read_cell(CELL, overrides)
    scene = Scene.build(loaded, with_bin=False)
    cubes = workspace_frames(loaded.cell)
    context = SurveyContext(
        loaded=loaded,
        with_bin=False,
        grids=tuple(cube.frames for cube in cubes),
        approach_m=0.0,
    )
    begin = time.perf_counter()
    job = Job(function=survey_unit, prepare=prepare_survey, context=context)
    payloads = run(
        job,
        context.blocks(),
        RunOptions(workers=workers),
        Progress("", quiet=True),
    )
    survey = join_surveys([Survey(**payload) for payload in payloads])
    middle = time.perf_counter()
    connection = connect_survey(scene, survey, seed=loaded.cell.seed)
    results = results_of_connection(survey, connection)
    end = time.perf_counter()
    seconds = {"survey": middle - begin, "connect": end - middle}
    return len(results.status), int((results.status == 1).sum()), seconds


def per_frame_cpu_s(sample: int) -> float:
    """CPU seconds per frame of planning from scratch to a random sample.

    As the paper did: the planner searches for every frame.
    """
    loaded = read_cell(CELL, ("planner.straight_first=false",))
    scene = Scene.build(loaded, with_bin=False)
    cell = scene.loaded.cell
    cubes = workspace_frames(cell)
    poses = np.concatenate([c.frames.transforms().reshape(-1, 4, 4) for c in cubes])
    rows = np.random.default_rng(0).permutation(len(poses))[:sample]
    begin = time.process_time()
    plan_frames(scene, poses[rows], rows.tolist())
    return (time.process_time() - begin) / sample


def main(sizes: Sequence[str]) -> None:
    """Print a line per size, then the ratio."""
    for name in sizes or SIZES:
        grid, z_step = SIZES[name]
        overrides = [f"workspace_scan.z_step={z_step}"]
        overrides += [f"workspace_scan.cubes.{k}.grid={list(grid)}" for k in (0, 1)]
        frames, reached, seconds = scan(overrides, workers=2)
        total = sum(seconds.values())
        phases = ", ".join(f"{k} {v:.1f} s" for k, v in seconds.items())
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{name:>4} {frames:7d} frames, {reached} reachable: {total:.1f} s wall "
            f"({phases}), {1e6 * total / frames:.0f} us a frame, peak {peak:.0f} MB"
        )
    begin = time.process_time()
    frames, _, _ = scan([], workers=1)
    ours = (time.process_time() - begin) / frames
    theirs = per_frame_cpu_s(SAMPLE)
    print(
        f"per frame, CPU: roadmap {1e3 * ours:.3f} ms, planned from scratch "
        f"{1e3 * theirs:.1f} ms ({SAMPLE} frames): ratio {theirs / ours:.0f}"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
