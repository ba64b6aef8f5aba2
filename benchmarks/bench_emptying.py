"""What real planning picks out of heaps against what the emptying curve says.

A heap is a bin of parts at random places and heights, each with the direction of its
top face; what is below a part is in the way. Every part is planned to from the scan
configuration with the cell's own planner, at whichever of its rolls has a goal, and
the share of parts picked is compared with the map's curve of directions at the same
heights.

    python benchmarks/bench_emptying.py bin.h5 [heaps]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.loading import LoadedCell, cell_from_json
from reachmap.core.scene import Scene
from reachmap.maps import BinMap, read_bin_map
from reachmap.maps.summary.directions import reachability_of_directions
from reachmap.maps.summary.emptying import emptying_of
from reachmap.sampling.frames import bin_test_frames
from reachmap.scans.ik_survey import survey_frames

HEIGHTS, PARTS = 6, 30


def at_height(record: BinMap, height: float) -> LoadedCell:
    """The map's cell with its bin filled up to a height, and a single test point."""
    kept = record.provenance
    loaded = cell_from_json(
        kept.cell_resolved_json,
        urdf=kept.urdf,
        srdf=kept.srdf,
        changes=[
            "bin_scan.fill=null",
            f"bin_scan.fill_heights_m=[{height:.6f}]",
            "bin_scan.grid=[1,1]",
        ],
    )
    return loaded.filled_to(0)


def parts_in(
    record: BinMap, scene: Scene, rng: np.random.Generator
) -> list[FloatArray]:
    """T_base_tcp of parts, all rolls of one direction each, (k, 4, 4)."""
    half = np.array([np.abs(record.x).max(), np.abs(record.y).max()])
    cell, spec = scene.loaded.cell, scene.loaded.cell.bin_scan
    parts = []
    for _ in range(PARTS):
        azimuth = {"azimuth_offset_deg": float(rng.uniform(0, 360))}
        family = spec.orientations.model_copy(update=azimuth)
        turned = spec.model_copy(update={"orientations": family})
        T = bin_test_frames(
            cell.model_copy(update={"bin_scan": turned}), scene.T_base_bin
        ).T_base_tcp.reshape(-1, 4, 4)
        rolls = [ring.rolls for ring in family.rings() for _ in range(ring.azimuths)]
        direction = int(rng.integers(len(rolls)))
        first = sum(rolls[:direction])
        T = T[first : first + rolls[direction]].copy()
        place = np.append(rng.uniform(-half, half), 0.0)
        T[:, :3, 3] += scene.T_base_bin[:3, :3] @ place
        parts.append(T)
    return parts


def picked(scene: Scene, parts: list[FloatArray], seed: int) -> int:
    """Parts that the planner reaches at one of their rolls."""
    survey = survey_frames(
        scene, np.vstack(parts), scene.loaded.cell.bin_scan.approach_distance_m
    )
    ends = np.cumsum([len(rolls) for rolls in parts])
    count = 0
    for k, end in enumerate(ends.tolist()):
        rows = [survey.goals_of(frame) for frame in range(end - len(parts[k]), end)]
        goals = survey.goals[np.concatenate(rows)]
        if len(goals):
            plan = scene.planner.plan(scene.scan_configuration, goals, seed + k)
            count += plan.path is not None
    return count


def main() -> None:
    """Print one line a heap: parts, picked, what the curve says."""
    record = read_bin_map(Path(sys.argv[1]))
    heaps = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    found = emptying_of(record)
    assert found is not None
    heights = [level.height_m for level in found.levels]
    # Parts lie anywhere between the outermost points, which stand for half as much.
    directions = reachability_of_directions(record)[0]
    wide = np.trapezoid(directions, record.x) / np.ptp(record.x)
    curve = np.trapezoid(wide, record.y) / np.ptp(record.y)
    gaps = []
    for heap in range(heaps):
        rng = np.random.default_rng(100 + heap)
        got, told = 0, []
        for height in np.sort(rng.uniform(heights[0], heights[-1], HEIGHTS))[::-1]:
            scene = Scene.build(at_height(record, float(height)))
            parts = parts_in(record, scene, rng)
            got += picked(scene, parts, seed=1000 * heap)
            told.append(float(np.interp(height, heights, curve)))
        share, expected = 100.0 * got / (HEIGHTS * PARTS), float(np.mean(told))
        gaps.append(share - expected)
        error = 100.0 * np.sqrt(share * (100 - share)) / 100 / np.sqrt(HEIGHTS * PARTS)
        print(
            f"heap {heap + 1}: {HEIGHTS * PARTS} parts, picked {share:.1f} % "
            f"(± {error:.1f}), the curve says {expected:.1f} %",
            flush=True,
        )
    print(f"mean difference {np.mean(gaps):+.1f} points")


if __name__ == "__main__":
    main()
