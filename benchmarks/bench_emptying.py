"""Heaps picked to the end with the map alone, and by real planning.

A heap is dropped into the bin of the map's cell. ``reachmap empty`` says from the map
which parts come out; here every part is planned to as well, from the scan configuration
with the cell's own planner and as many rolls as the map has, in the bin filled up to
that part. Both pick in the same way, so what stays differs by what the map is wrong in.

    python benchmarks/bench_emptying.py bin.h5 [heaps [LxWxH in mm [first seed]]]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.loading import LoadedCell
from reachmap.core.scene import Scene
from reachmap.geometry import AXES
from reachmap.maps import BinMap, read_bin_map
from reachmap.maps.provenance import cell_of_artefact
from reachmap.picking.emptying import Fate, empty_heap
from reachmap.picking.heap import Heap, drop_heap
from reachmap.ranking.lookup.queries import complete_rotation
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.sampling.frames import approach_distance_m
from reachmap.scans.ik_survey import survey_frames
from reachmap.tools.empty import FILL, part_costs

SEED = 100


def poses_of(record: BinMap, heap: Heap, part: int, rolls: int) -> FloatArray:
    """T_base_tcp of a part at every roll, (rolls, 4, 4), the first at random."""
    T_base_bin = record.bin_pose
    approach = -T_base_bin[:3, :3] @ heap.normal[part]
    R = complete_rotation(approach[None], T_base_bin[:3, :3], record.approach_axis)[0]
    axis, _ = AXES[record.approach_axis]
    phase = np.random.default_rng([SEED, part]).uniform(0.0, 2.0 * np.pi)
    angles = phase + 2.0 * np.pi * np.arange(rolls) / rolls
    T = np.tile(np.eye(4), (rolls, 1, 1))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    turn = np.tile(np.eye(3), (rolls, 1, 1))
    turn[:, u, u] = turn[:, v, v] = np.cos(angles)
    turn[:, v, u], turn[:, u, v] = np.sin(angles), -np.sin(angles)
    T[:, :3, :3] = R @ turn
    T[:, :3, 3] = T_base_bin[:3, :3] @ heap.position[part] + T_base_bin[:3, 3]
    return T


def planned_cost(
    record: BinMap, loaded: LoadedCell, heap: Heap, part: int, rolls: int
) -> float:
    """0 where the planner reaches a part at one of its rolls, else infinite."""
    scene = Scene.build(loaded.filled_up_to(float(heap.position[part, 2])))
    survey = survey_frames(
        scene,
        poses_of(record, heap, part, rolls),
        approach_distance_m(scene.loaded.cell),
    )
    if not len(survey.goals):
        return float("inf")
    plan = scene.planner.plan(scene.scan_configuration, survey.goals, SEED + part)
    return 0.0 if plan.path is not None else float("inf")


def main() -> None:
    """Print one line a heap."""
    record = read_bin_map(Path(sys.argv[1]))
    heaps = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    sides = sys.argv[3] if len(sys.argv) > 3 else "80x60x40"
    first = int(sys.argv[4]) if len(sys.argv) > 4 else SEED
    x, y, z = (float(side) / 1e3 for side in sides.split("x"))
    loaded = cell_of_artefact(record.provenance, sys.argv[1])
    cell = loaded.cell
    rings = cell.bin_scan.orientations.rings()
    rolls = max(cell.tool.count(), *(ring.rolls for ring in rings))
    ranker, gaps = Ranker(record), []
    for number in range(heaps):
        heap = drop_heap(cell.bin, (x, y, z), FILL, first + number)
        told, _ = part_costs(ranker, record, heap)
        done = np.array(
            [
                planned_cost(record, loaded, heap, part, rolls)
                for part in range(len(heap))
            ]
        )
        left = [
            100.0 * float((empty_heap(heap, cost).fate != Fate.PICKED).mean())
            for cost in (told, done)
        ]
        gaps.append(left[0] - left[1])
        alike = float((np.isfinite(told) == np.isfinite(done)).mean())
        print(
            f"heap {number + 1}: {len(heap)} parts, {left[0]:.1f} % stay by the map, "
            f"{left[1]:.1f} % by planning; reached {np.isfinite(told).sum()} and "
            f"{np.isfinite(done).sum()}, alike for {100 * alike:.1f} %",
            flush=True,
        )
    print(f"mean difference {np.mean(gaps):+.1f} points")


if __name__ == "__main__":
    main()
