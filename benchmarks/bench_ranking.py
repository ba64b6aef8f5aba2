"""How long ranking takes: the look-up, the loops of Algorithm 1, the whole command.

Run with ``python benchmarks/bench_ranking.py [bin.h5]``. Without a map, one of the
paper's size (14 × 20 points, 27 orientations, 5 repeats) with invented measurements is
used: the time of a look-up does not depend on what is looked up.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from reachmap.maps import read_bin_map, write_bin_map  # noqa: E402
from reachmap.ranking import Ranker  # noqa: E402
from tests.support.ranking_maps import make_bin_map  # noqa: E402
from tests.support.ranking_oracle import Oracle  # noqa: E402

SIZES = (1, 50, 200, 1000, 10_000)
LIMITS_MS = {50: 1.0, 10_000: 100.0}


def quickest_ms(call: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Least and median time of a call [ms]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - start))
    return min(times), statistics.median(times)


def random_grasps(bin_map, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Grasps anywhere in the bin's pick volume, tilted up to about 30°."""
    rng = np.random.default_rng(0)
    half = np.array([*bin_map.bin_inner[:2] / 2, 0.018])
    middle = np.array([0.0, 0.0, 0.047])
    points = middle + rng.uniform(-1.0, 1.0, (n, 3)) * half
    v = rng.normal(scale=0.25, size=(n, 3)) - [0.0, 0.0, 1.0]
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    side = np.cross(v, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    R = np.stack([side, np.cross(v, side), v], axis=2)
    T = bin_map.bin_pose
    return points @ T[:3, :3].T + T[:3, 3], v @ T[:3, :3].T, T[:3, :3] @ R


def look_up(ranker: Ranker, bin_map) -> bool:
    """Time the library for lists of several sizes; whether the limits hold."""
    held = True
    print(f"{'grasps':>8}  {'roll free':>18}  {'roll fixed':>18}  {'4 neighbours':>18}")
    print(f"{'':>8}" + f"  {'min / median [ms]':>18}" * 3)
    for n in SIZES:
        p, v, R = random_grasps(bin_map, n)
        calls = (
            lambda p=p, v=v: ranker.rank(p, v),
            lambda p=p, R=R: ranker.rank(p, rotations=R),
            lambda p=p, v=v: ranker.rank(p, v, neighbours=4),
        )
        repeats = 200 if n <= 1000 else 15
        results = [quickest_ms(call, repeats) for call in calls]
        held &= all(least < LIMITS_MS.get(n, np.inf) for least, _ in results[:2])
        cells = (f"{f'{least:.3f} / {median:.3f}':>18}" for least, median in results)
        print(f"{n:>8}  " + "  ".join(cells))
    return held


def loops(bin_map) -> None:
    """Time the loop form of Algorithm 1 on 50 grasps, for comparison."""
    start = time.perf_counter()
    oracle = Oracle(bin_map)
    prepared = time.perf_counter() - start
    p, v, R = random_grasps(bin_map, 50)
    for name, rotations in (("free", None), ("fixed", R)):
        least, _ = quickest_ms(lambda r=rotations: oracle.rank(p, v, r), 1)
        print(f"loops, 50 grasps, roll {name}: {least:.0f} ms")
    print(f"loops, preparing the table: {prepared:.2f} s")


def command(map_path: Path) -> None:
    """Time ``reachmap rank`` on four quadrants of 50, with start-up."""
    bin_map = read_bin_map(map_path)
    p, v, _ = random_grasps(bin_map, 200)
    grasps = [
        f'{{"position": {a.tolist()}, "direction": {b.tolist()}, "quadrant": "{q}"}}'
        for a, b, q in zip(p, v, ("NE", "NW", "SE", "SW") * 50, strict=True)
    ]
    head = '{"format": "reachmap.grasps", "format_version": "1.0", '
    text = head + f'"frame": "robot_base", "grasps": [{", ".join(grasps)}]}}'
    call = [sys.executable, "-m", "reachmap", "rank", "-", "--map", str(map_path)]
    cpu = []

    def run() -> None:
        before = os.times()
        subprocess.run(call, input=text.encode(), stdout=subprocess.DEVNULL, check=True)
        after = os.times()
        cpu.append(sum(after[2:4]) - sum(before[2:4]))

    least, median = quickest_ms(run, 7)
    print(
        f"reachmap rank, 4 × 50 grasps, with start-up: min {least:.0f} ms, "
        f"median {median:.0f} ms, CPU {1e3 * min(cpu):.0f} ms"
    )


def main() -> None:
    """Print all timings; exit with 1 when a stated limit does not hold."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bin.h5"
        if len(sys.argv) > 1:
            path = Path(sys.argv[1])
        else:
            write_bin_map(path, make_bin_map(shape=(1, 14, 20), reachable=0.957))
        start = time.perf_counter()
        ranker = Ranker.from_map(path)
        loaded = time.perf_counter() - start
        bin_map = read_bin_map(path)
        print(f"{ranker.table.reachable.size} test grasps, loaded in {loaded:.2f} s")
        held = look_up(ranker, bin_map)
        loops(bin_map)
        command(path)
    limits = ", ".join(f"{n} grasps < {ms:g} ms" for n, ms in LIMITS_MS.items())
    print(f"limits ({limits}): {'held' if held else 'NOT held'}")
    sys.exit(0 if held else 1)


if __name__ == "__main__":
    main()
