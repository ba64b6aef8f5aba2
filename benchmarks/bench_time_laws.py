"""What stored motions take under each time law, against toppra's optimum.

Every piece of the stored paths of a bin map, planned or straight, is timed four ways.
The optimum of a piece is toppra's along the same curve: the polyline with its stops
for the trapezoid, the blended path for blends. Where a map has a cycle, its stages are
pieces like the others.

    python benchmarks/bench_time_laws.py bin.h5 [paths]
"""

from __future__ import annotations

import sys
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

JERK_RAD_S3 = 50.0


def pieces_of(record: BinMap, count: int) -> list[tuple[FloatArray, FloatArray]]:
    """Planned part and straight way of evenly chosen paths."""
    paths = record.paths
    starts = np.concatenate([[0], np.cumsum(paths.row_size)])
    rows = np.unique(np.linspace(0, len(paths.row_size) - 1, count).astype(int))
    pieces = []
    for row in rows.tolist():
        path = paths.configuration[starts[row] : starts[row + 1]]
        planned = int(paths.planned_size[row])
        pieces.append((path[:planned], path[planned - 1 :]))
    return pieces


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
    record = read_bin_map(Path(sys.argv[1]))
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 400
    kept = record.provenance
    scene = Scene.build(
        cell_from_json(kept.cell_resolved_json, urdf=kept.urdf, srdf=kept.srdf)
    )
    begin = time.process_time()
    rows: list[dict[str, Any]] = [
        times_of(scene, planned, way) for planned, way in pieces_of(record, count)
    ]
    table = {name: np.array([row[name] for row in rows], float) for name in rows[0]}
    print(f"{scene.loaded.cell.name}: {len(rows)} paths")
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
    bent = table["corners"] > 0
    if bent.any():
        saved = 1 - table["blend"][bent].mean() / table["trapezoid"][bent].mean()
        print(
            f"  blends save {100 * saved:.1f} % on the {bent.sum()} paths with corners"
        )


if __name__ == "__main__":
    main()
