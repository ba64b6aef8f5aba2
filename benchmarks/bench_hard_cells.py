"""Cells where planning decides: verdicts, their cost, and how good the paths are.

``python benchmarks/bench_hard_cells.py [FOLDER or CELL ...]`` prints, for each cell (by
default those of benchmarks/hard_cells):

- frames with a goal that the roadmap connects, with the exact count of state checks,
  for three seeds; the share that the lazy roadmap of samples finds by itself, which is
  what its agreement on an unreached component is worth;
- the CPU time of a frame beside planning to each frame with the cell's planner, and
  beside plain OMPL (see bench_bin_scan.py), on the same random frames;
- the mean path over the best that is known, and the share of the variance of length
  and execution time that is the grasp and not luck, for attempts over the roadmap and
  by the planner; the best known is the shortest of all attempts and of those over a
  network three times as large, shortened further, with another seed;
- how well a map of the cell, whose cup is round, predicts random grasps of another
  seed, planned to over roadmaps of their own: precision and recall of *reachable*, rank
  correlation of predicted and measured J, by the nearest test grasp and the median
  over eight test points, and of two halves of the measurement, and the share of the
  variance of an attempt that is the grasp and not luck.

``--verdicts`` leaves out all but the first, ``--predictions`` all but the last.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from bench_bin_scan import PlainPlanner

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.loading import read_cell
from reachmap.cell.model.planner import RoadmapSpec
from reachmap.core.planning.connection import Connection, connect
from reachmap.core.planning.timing import execution_time_s, path_length_rad
from reachmap.core.scene import Scene
from reachmap.maps import read_bin_map
from reachmap.ranking import Ranker, RankSettings, rank_list
from reachmap.runtime.options import RunOptions
from reachmap.sampling.frames import bin_test_frames
from reachmap.scans.ik_survey import Survey, survey_frames
from reachmap.scans.routes import RouteAttempts, Routes, plan_from_scratch
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.validate import PickOptions, validate
from reachmap.validation.judgement import JudgedList
from reachmap.validation.random_grasps import random_grasps
from reachmap.validation.statistics import rank_correlation

HERE = Path(__file__).parent / "hard_cells"
SEEDS = (1, 2, 3)
SAMPLE = 24
REPEATS = 5
# Maps of predictions, and the random grasps that they are judged by.
MAPPED = ("tool.roll=free", "bin_scan.repeats=2")
RANDOM, RANDOM_SEED, RANDOM_REPEATS = 200, 77, 4
NEIGHBOURS = 8


def survey_of(scene: Scene) -> Survey:
    """Goals of all test grasps of a cell."""
    cell = scene.loaded.cell
    grid = bin_test_frames(cell, scene.T_base_bin).frames
    return survey_frames(
        scene,
        grid.transforms_at(np.arange(grid.size)),
        cell.bin_scan.approach_distance_m,
    )


def connected(
    scene: Scene, survey: Survey, spec: RoadmapSpec, seed: int
) -> tuple[Connection, int, float]:
    """Connect a survey; the state checks and CPU seconds that took."""
    checks, begin = scene.checker.checks, time.process_time()
    connection = connect(
        scene.scan_configuration, survey.roadmap_goals, scene.motions, spec, seed=seed
    )
    cpu_s = time.process_time() - begin
    return connection, scene.checker.checks - checks, cpu_s


def verdicts(scene: Scene, survey: Survey) -> Connection:
    """Print what the roadmap connects, and what samples find without the planners."""
    spec = scene.loaded.cell.roadmap
    frames = len(np.unique(survey.frame))
    for seed in SEEDS:
        connection, checks, cpu_s = connected(scene, survey, spec, seed)
        found = len(connection.roadmap.frames_reached())
        part = connection.checks.sum(axis=0)
        by = ", ".join(
            f"{n} {c:,}" for n, c in zip(connection.methods, part, strict=True)
        )
        print(
            f"  seed {seed}: {found} of {frames} connected, {checks:,} checks ({by}), "
            f"{1e3 * cpu_s / frames:.2f} ms of CPU a frame"
        )
        if seed == SEEDS[0]:
            first = connection
    alone = spec.model_copy(update={"max_checks": 1})
    connection, checks, _ = connected(scene, survey, alone, SEEDS[0])
    found = np.isin(first.roadmap.frames_reached(), connection.roadmap.frames_reached())
    print(
        f"  samples without the planners: {found.sum()} of {len(found)} connected, "
        f"{checks:,} checks"
    )
    return first


def per_frame(scene: Scene, survey: Survey, frames: IntArray) -> None:
    """Print what planning from scratch finds, by the cell's planner and plain OMPL."""
    plain = PlainPlanner(scene)
    found, seconds = (
        {"planner": 0, "plain OMPL": 0},
        dict.fromkeys(("planner", "plain OMPL"), 0.0),
    )
    for frame in frames.tolist():
        goals = survey.goals[survey.goals_of(frame)]
        begin = time.process_time()
        plan = scene.planner.plan(scene.scan_configuration, goals, frame + 1)
        middle = time.process_time()
        path = plain.plan(goals, frame + 1)
        end = time.process_time()
        found["planner"] += plan.path is not None
        found["plain OMPL"] += path is not None
        seconds["planner"] += middle - begin
        seconds["plain OMPL"] += end - middle
    for name, count in found.items():
        print(
            f"  {name} to each frame: {count} of {len(frames)} found, "
            f"{1e3 * seconds[name] / len(frames):.0f} ms of CPU a frame"
        )


def paths_of(
    scene: Scene, survey: Survey, connection: Connection, frames: IntArray
) -> list[list[FloatArray]]:
    """Paths of all attempts over the network."""
    routes = Routes.of(scene, survey, connection, with_network=True)
    attempts = RouteAttempts(scene, survey, routes)
    return [
        [plan.path for plan, _ in attempts.at(frame, REPEATS) if plan.path is not None]
        for frame in frames.tolist()
    ]


def with_spec(scene: Scene, seed: int, **changes: object) -> Scene:
    """The scene of a cell with other settings of its roadmap and another seed."""
    changed = [f"roadmap.{name}={value}" for name, value in changes.items()]
    source = str(scene.loaded.source)
    return Scene.build(read_cell(source, [*changed, f"seed={seed}"]))


def quality(
    scene: Scene, survey: Survey, connection: Connection, frames: IntArray
) -> None:
    """Print lengths over the best known, and reliabilities."""
    begin = time.process_time()
    ours = paths_of(scene, survey, connection, frames)
    cpu_s = (time.process_time() - begin) / len(frames) / REPEATS
    spec = scene.loaded.cell.bin_scan
    plans = plan_from_scratch(scene, survey, frames.tolist())
    theirs = [[p.path for p, _ in made if p.path is not None] for made in plans]
    large = with_spec(
        scene, 101, route_goals=60, route_plans=120, ways=5, way_tries=200,
        least_gain=0.003,
    )  # fmt: skip
    again = connected(large, survey, large.loaded.cell.roadmap, 101)[0]
    long_searched = paths_of(large, survey, again, frames)
    best = np.array(
        [
            min(path_length_rad(path) for path in (*a, *b, *c))
            for a, b, c in zip(ours, theirs, long_searched, strict=True)
        ]
    )
    print(
        f"  best known {best.mean():.3f} rad; network and attempts "
        f"{1e3 * cpu_s:.0f} ms of CPU an attempt"
    )
    limits = (scene.robot.velocity_rad_s, scene.robot.acceleration_rad_s2)
    for name, made in (("roadmap", ours), ("planner", theirs)):
        whole = [paths for paths in made if len(paths) == len(made[0])]
        length = np.array([[path_length_rad(p) for p in paths] for paths in whole])
        seconds = np.array(
            [[execution_time_s(p, *limits) for p in paths] for paths in whole]
        )
        over = np.mean([np.mean([*map(path_length_rad, p)]) for p in made if p])
        print(
            f"  {name}, {spec.repeats} attempts: mean path over best known "
            f"{over / best.mean():.3f}, reliability of length "
            f"{reliability(length):.3f}, of execution time {reliability(seconds):.3f}"
        )


def predictions(cell: Path) -> None:
    """Print how well a map predicts random grasps."""
    quiet = RunOptions(workers=1, quiet=True)
    with tempfile.TemporaryDirectory() as folder:
        path, begin = Path(folder) / "bin.h5", time.process_time()
        bin_scan(None, path, cell=str(cell), overrides=MAPPED, run=quiet)
        scan_s = time.process_time() - begin
        pick = PickOptions(repeats=RANDOM_REPEATS, seed=RANDOM_SEED)
        found = validate(path, random=RANDOM, pick=pick, run=quiet).validation
        median = median_correlation(path, found.lists[0])
    one, shares = found.overall, found.reliability
    verdict = one.confusion
    print(
        f"  predicted (scan {scan_s:.0f} s of CPU), {one.grasps} random grasps: "
        f"precision {100 * verdict.precision.share:.1f} % of {verdict.precision.total},"
        f" recall {100 * verdict.recall.share:.1f} % of {verdict.recall.total}; "
        f"Spearman of J {one.correlation.spearman:.2f}, median over {NEIGHBOURS} "
        f"points {median:.2f}, of the measurement with itself "
        f"{one.repeatability.spearman:.2f}; reliability of an attempt's length "
        f"{shares['path_length'].share:.2f}, execution time "
        f"{shares['execution_time'].share:.2f}",
        flush=True,
    )


def median_correlation(path: Path, judged: JudgedList) -> float:
    """Spearman's ρ of measured J and median J over the nearest test points."""
    bin_map = read_bin_map(path)
    ranker = Ranker(bin_map)
    ranked = rank_list(random_grasps(bin_map, RANDOM, RANDOM_SEED), ranker)
    settings = RankSettings(neighbours=NEIGHBOURS)
    cost = ranker.rank_queries(ranked.queries, settings).cost
    return rank_correlation(cost, judged.cost).spearman


def reliability(values: FloatArray) -> float:
    """Share of the variance of means over attempts that lies between grasps."""
    luck = values.var(axis=1, ddof=1).mean() / values.shape[1]
    return float(1.0 - luck / values.mean(axis=1).var(ddof=1))


def main(names: Sequence[str]) -> None:
    """Print a paragraph per cell."""
    only_verdicts, only_predictions = (
        name in names for name in ("--verdicts", "--predictions")
    )
    paths = [Path(name) for name in names if not name.startswith("--")] or [HERE]
    cells = [
        cell
        for path in paths
        for cell in (sorted(path.glob("*.yaml")) if path.is_dir() else [path])
    ]
    for cell in cells:
        print(cell.stem, flush=True)
        if only_predictions:
            predictions(cell)
            continue
        scene = Scene.build(read_cell(str(cell)))
        survey = survey_of(scene)
        connection = verdicts(scene, survey)
        if only_verdicts:
            continue
        reached = connection.roadmap.frames_reached()
        frames = np.random.default_rng(0).permutation(reached)[:SAMPLE]
        per_frame(scene, survey, frames)
        quality(scene, survey, connection, frames)
        predictions(cell)


if __name__ == "__main__":
    main(sys.argv[1:])
