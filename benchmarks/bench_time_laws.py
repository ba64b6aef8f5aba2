"""What stored motions take under each time law, against toppra's optimum.

Every piece of the stored paths of a bin map, planned or straight, is timed four ways.
The optimum of a piece is toppra's along the same curve: the polyline with its stops
for the trapezoid, the blended path for blends. Where a map has whole cycles, their
stages are pieces like the others, blended with the part where it is held, and cycle
times are compared as well.

    python benchmarks/bench_time_laws.py [bin.h5 [motions]]

Without a map, a coarse one of the shipped cell with a conveyor is made first.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.loading import cell_from_json
from reachmap.core.planning import timing
from reachmap.core.planning.time_laws import double_s
from reachmap.core.planning.time_laws.corners import (
    BlendedPath,
    blended,
    blended_time_s,
)
from reachmap.core.planning.time_laws.optimal import optimal_time_s, optimal_way_time_s
from reachmap.core.scene import Scene
from reachmap.maps import BinMap, read_bin_map
from reachmap.motions.motion import way_points
from reachmap.runtime.options import RunOptions
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.tools.bin_scan import bin_scan
from reachmap.view.playback import stage_rows

JERK_RAD_S3 = 50.0


def chosen_rows(record: BinMap, count: int) -> list[list[int]]:
    """Rows of evenly chosen motions: of whole cycles where there are any."""
    if record.cycle is None or record.best is None:
        rows = np.linspace(0, len(record.paths.row_size) - 1, count).astype(int)
        return [[int(row)] for row in np.unique(rows)]
    whole = record.best.row[np.isfinite(record.cycle.cycle_time)]
    chosen = whole[np.unique(np.linspace(0, len(whole) - 1, count).astype(int))]
    return [[row, *stage_rows(record, row)] for row in chosen.tolist()]


def coarse_map() -> BinMap:
    """A map of the shipped cell with a conveyor, at a dozen points."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bin.h5"
        bin_scan(
            None,
            path,
            cell="ur5-conveyor",
            overrides=("bin_scan.grid=[4,3]", "bin_scan.repeats=1"),
            run=RunOptions(workers=1, quiet=True),
        )
        return read_bin_map(path)


def scenes_of(record: BinMap) -> list[Scene]:
    """Scene of each stage: the way in, lift, transfer, place, retreat, return."""
    kept = record.provenance
    loaded = cell_from_json(kept.cell_resolved_json, urdf=kept.urdf, srdf=kept.srdf)
    scenes = CycleScenes.of(loaded)
    if scenes is None:
        return [Scene.build(loaded)]
    empty, lifted, carried = scenes.empty, scenes.lifted, scenes.carried
    return [empty, lifted, carried, carried, empty, empty]


def times_of(scene: Scene, planned: FloatArray, way: FloatArray) -> dict[str, float]:
    """Seconds of one path under each law, its straight way included."""
    v, a = scene.robot.velocity_rad_s, scene.robot.acceleration_rad_s2
    j = np.full(scene.robot.dof, JERK_RAD_S3)
    corners = timing.merge_straight(planned) if len(planned) > 1 else planned
    stops = BlendedPath(corners=corners, blend=np.zeros(len(corners)))
    blends = blended(planned, scene.motions, v, a)
    straight, optimum = timing.smooth_way_time_s(way, v, a), 0.0
    if len(way) > 1:
        optimum = optimal_way_time_s(way, v, a)
    return {
        "trapezoid": timing.execution_time_s(planned, v, a) + straight,
        "its optimum": optimal_time_s(stops, v, a) + optimum,
        "jerk": double_s.polyline_time_s(planned, v, a, j)
        + double_s.smooth_way_time_s(way, v, a, j),
        "blend": blended_time_s(blends, v, a) + straight,
        "toppra": optimal_time_s(blends, v, a) + optimum,
        "corners": max(len(corners) - 2, 0),
        "blended": int((blends.blend > 0).sum()),
    }


def main() -> None:
    """Print means over the paths, and the worst ratio to the optimum."""
    record = read_bin_map(Path(sys.argv[1])) if len(sys.argv) > 1 else coarse_map()
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 400
    scenes, motions = scenes_of(record), chosen_rows(record, count)
    begin = time.process_time()
    made: list[list[dict[str, Any]]] = [
        [
            times_of(scene, *way_points(record, row))
            for scene, row in zip(scenes, rows, strict=False)
        ]
        for rows in motions
    ]
    rows = [times for one in made for times in one]
    table = {name: np.array([row[name] for row in rows], float) for name in rows[0]}
    print(f"{scenes[0].loaded.cell.name}: {len(rows)} paths of {len(made)} motions")
    print(
        f"{table['corners'].sum():.0f} corners, {table['blended'].sum():.0f} blended; "
        f"{time.process_time() - begin:.1f} s of CPU time"
    )
    for law in ("trapezoid", "jerk", "blend", "toppra"):
        print(f"  {law:<10} {table[law].mean():.3f} s on average")
    for law, optimum in (("trapezoid", "its optimum"), ("blend", "toppra")):
        ratio = table[law] / table[optimum]
        print(
            f"  {law} / optimum of the same curve: mean {ratio.mean():.4f}, "
            f"95 % {np.quantile(ratio, 0.95):.4f}, worst {ratio.max():.4f}"
        )
    for law, optimum in (("trapezoid", "its optimum"), ("blend", "toppra")):
        whole = np.array(
            [[sum(t[name] for t in one) for name in (law, optimum)] for one in made]
        )
        ratio = whole[:, 0] / whole[:, 1]
        print(
            f"  whole motions, {law} / optimum: mean {ratio.mean():.4f}, "
            f"worst {ratio.max():.4f}"
        )
    bent = table["corners"] > 0
    if bent.any():
        saved = 1 - table["blend"][bent].mean() / table["trapezoid"][bent].mean()
        print(
            f"  blends save {100 * saved:.1f} % on the {bent.sum()} paths with corners"
        )


if __name__ == "__main__":
    main()
