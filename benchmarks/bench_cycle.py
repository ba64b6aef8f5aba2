"""The pick cycle: what it refutes, what it costs, whether it is right, how quick it is.

``python benchmarks/bench_cycle.py [CELL or MAP ...]`` prints for each (by default the
two shipped cells with a conveyor and three of benchmarks/hard_cells, with parts of
their own):

- how many reachable test grasps lift, transfer and return refute, and why; those at
  which the part would start inside the bin are no grasps of that part, and counted
  apart;
- CPU time of the scan with and without the part, in one run (cells only);
- stored cycles replayed by code that shares nothing with the planner;
- precision and recall of ``rank --cost cycle`` against planning without a map
  (:mod:`reachmap.scans.cycle.from_scratch`), on random grasps anywhere in the bin, and
  how the first ten of lists do in supplied order, by J and by seconds;
- the time of planned segments over the least that is known between the same ends: of
  six plans, each shortened three times as long as the scan does.

``--grid X,Y`` scans a coarser grid; ``--random N``, ``--sample N`` and ``--replay N``
set the number of random grasps, of cycles that are compared and of those replayed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from reachmap._typing import FloatArray, IntArray  # noqa: E402
from reachmap.cell.loaded import LoadedCell  # noqa: E402
from reachmap.core.planning.routes import shorten_until  # noqa: E402
from reachmap.core.scene import Scene  # noqa: E402
from reachmap.maps import BinMap, Status, read_bin_map  # noqa: E402
from reachmap.maps.parts import StageStatus, concatenated  # noqa: E402
from reachmap.maps.provenance import cell_of_artefact  # noqa: E402
from reachmap.ranking import Ranker, RankSettings, rank_list  # noqa: E402
from reachmap.runtime.options import IN_PROCESS, RunOptions  # noqa: E402
from reachmap.runtime.progress import Progress  # noqa: E402
from reachmap.scans.cycle.scenes import (  # noqa: E402
    RETURN,
    STAGES,
    TRANSFER,
    CycleScenes,
)
from reachmap.tools.bin_scan import bin_scan  # noqa: E402
from reachmap.validation.cycle_planning import plan_cycles  # noqa: E402
from reachmap.validation.cycles import judge_cycles, summarise_cycles  # noqa: E402
from reachmap.validation.picks import picks_of  # noqa: E402
from reachmap.validation.planning import PickContext  # noqa: E402
from reachmap.validation.random_grasps import random_grasps  # noqa: E402
from tests.support.cycle_replay import Replay, faults_of  # noqa: E402

HARD = ROOT / "benchmarks" / "hard_cells"
PLATE = "part={shape: {box: [0.08, 0.05, 0.04]}, pose: {xyz: [0, 0, 0.02]}, yaw: free}"
BLOCK = "part={shape: {box: [0.06, 0.04, 0.04]}, pose: {xyz: [0, 0, 0.02]}, yaw: free}"
PLACE = "drop_off={{pose: {{xyz: {}, rpy_deg: [180, 0, 0]}}, free_about: z}}"
CASES: dict[str, tuple[str, ...]] = {
    "ur5-conveyor": (),
    "ur10-deep-conveyor": (),
    str(HARD / "deep-klt-ur10.yaml"): (
        PLATE, PLACE.format("[0.30, -0.75, -0.20]"), "bin_scan.layers=[0.05, 0.20]",
    ),
    str(HARD / "two-bins-ur5.yaml"): (
        PLATE, PLACE.format("[0.50, 0.20, -0.20]"), "bin_scan.layers=[0.05, 0.15]",
    ),
    str(HARD / "machine-door-ur5.yaml"): (
        BLOCK, PLACE.format("[0.05, 0.55, 0.10]"), "bin_scan.layers=[0.055, 0.10]",
    ),
}  # fmt: skip
ROLLS = 24
PLANS = 6
EACH, TOP = 30, 10


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--grid")
    parser.add_argument("--random", type=int, default=200)
    parser.add_argument("--sample", type=int, default=20)
    parser.add_argument("--replay", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    grid = (f"bin_scan.grid=[{asked.grid}]",) if asked.grid else ()
    for case in asked.cases or CASES:
        name = next((key for key in CASES if Path(key).stem == Path(case).stem), case)
        print(f"\n{Path(case).stem}", flush=True)
        if Path(case).suffix == ".h5":
            record = read_bin_map(Path(case))
        else:
            record = scanned(name, (*CASES.get(name, ()), *grid))
        refuted(record)
        replayed(record, asked.replay)
        against_fresh_plans(record, asked.random, asked.seed)
        over_the_best_known(record, asked.sample)


def scanned(cell: str, overrides: tuple[str, ...]) -> BinMap:
    """Scan with the part and without, and print the CPU time of both."""
    with tempfile.TemporaryDirectory() as folder:
        path, spent = Path(folder) / "bin.h5", []
        for change in ((), ("part=null",)):
            begin = time.process_time()
            bin_scan(
                None,
                path,
                cell=cell,
                overrides=(*overrides, *change),
                run=RunOptions(quiet=True, overwrite=True),
            )
            spent.append(time.process_time() - begin)
            if not change:
                record = read_bin_map(path)
    whole, plain = spent
    print(
        f"  scan: {whole:.1f} CPU s with the cycle, {plain:.1f} s without, "
        f"{whole / plain:.2f} times as long"
    )
    return record


def refuted(record: BinMap) -> None:
    """Print what became of the reachable test grasps."""
    cycle = record.cycle
    assert cycle is not None
    reachable = record.status == Status.PATH_FOUND
    status = cycle.status[reachable]
    absent = status[:, 0] == StageStatus.PART_IN_COLLISION
    whole = (status == StageStatus.PATH_FOUND).all(axis=-1)
    left = len(status) - int(absent.sum())
    lost = left - int(whole.sum())
    print(
        f"  {reachable.sum()} of {reachable.size} test grasps reachable; at "
        f"{absent.sum()} the part starts inside the bin; of the other {left} the cycle "
        f"refutes {lost} ({100 * lost / max(left, 1):.1f} %)"
    )
    pulled_back(record, np.argwhere(cycle.drop_off >= 0))
    pairs = cycle.blocking_pair[reachable]
    causes = Counter(
        (STAGES[k], StageStatus(code).name.lower(),
         record.body_pairs[pair] if pair >= 0 else "")
        for k in range(status.shape[1])
        for code, pair in zip(status[:, k], pairs[:, k], strict=True)
        if code not in (StageStatus.PATH_FOUND, StageStatus.NOT_ATTEMPTED)
    )  # fmt: skip
    for (stage, code, pair), count in causes.most_common(8):
        print(f"    {count:5} {stage}: {code} {pair}")
    seconds = cycle.cycle_time[np.isfinite(cycle.cycle_time)]
    if len(seconds):
        low, middle, high = np.percentile(seconds, [5, 50, 95])
        print(f"  cycle time: median {middle:.2f} s, 5-95 % {low:.2f} to {high:.2f} s")


def pulled_back(record: BinMap, grasps: IntArray) -> None:
    """Print how many whole cycles would hit the bin on the way that they came."""
    assert record.best is not None
    levels, ends = levels_of(record), np.cumsum(record.paths.row_size)
    hit = 0
    for grasp in grasps:
        scene = Scene.shared(
            levels[int(grasp[0]) if len(levels) > 1 else 0], load="lifted"
        )
        row = int(record.best.row[tuple(grasp)])
        begin = ends[row] - record.paths.row_size[row]
        path = record.paths.configuration[begin : ends[row]]
        hit += not scene.motions.path_is_verified(path[::-1])
    print(
        f"  pulled back along its way in, the part would hit something in {hit} of "
        f"{len(grasps)} whole cycles ({100 * hit / max(len(grasps), 1):.0f} %)"
    )


def levels_of(record: BinMap) -> tuple[LoadedCell, ...]:
    """The map's cell for each level of the parts."""
    return cell_of_artefact(record.provenance, "map", ()).fillings()


def against_fresh_plans(record: BinMap, count: int, seed: int) -> None:
    """Print precision and recall on random grasps, and what comes first in lists.

    Grasps anywhere in the mapped volume, with the bin filled up to each of a cell that
    is scanned at levels, in lists as one image would give them.
    """
    ranker, asked = Ranker(record), RankSettings(cost="cycle")
    drawn = [random_grasps(record, EACH, seed * 1000 + k) for k in range(count // EACH)]
    ranked = [rank_list(one, ranker) for one in drawn]
    context = PickContext(
        loaded=cell_of_artefact(record.provenance, "map", ()),
        picks=concatenated([picks_of(one) for one in ranked]),
        rolls=ROLLS,
        repeats=1,
        seed=seed,
    )
    results = plan_cycles(context, IN_PROCESS, progress=Progress("fresh", quiet=True))
    assert results is not None
    judged = [
        judge_cycles(one, ranker, asked, results.take(slice(EACH * k, EACH * (k + 1))))
        for k, one in enumerate(ranked)
    ]
    summary = summarise_cycles([str(k) for k in range(len(judged))], judged, TOP)[-1]
    told = summary.confusion
    print(
        f"  {len(context.picks)} random grasps, seed {seed}: precision "
        f"{told.precision.share:.3f}, recall {told.recall.share:.3f}, rank correlation "
        f"of seconds {summary.correlation.spearman:.2f}"
    )
    missed = Counter(
        StageStatus(int(code)).name.lower()
        for one in judged
        for code in one.status[np.isfinite(one.predicted_s) & ~one.found]
    )
    print(f"  said and not found: {dict(missed)}")
    for name, first in summary.orders.items():
        print(
            f"  first {TOP} of each list of {EACH}, {name}: {first.whole} of "
            f"{first.considered} have a whole cycle, {first.seconds:.2f} s on average, "
            f"{first.seconds_per_part:.2f} s per part with failures"
        )


def replayed(record: BinMap, count: int) -> None:
    """Replay stored cycles by code that shares nothing with the planner."""
    levels = levels_of(record)
    replays = [Replay(level, record.joint_names) for level in levels]
    known: list[dict[bytes, list[str]]] = [{} for _ in levels]
    assert record.cycle is not None
    chosen = np.argwhere(record.cycle.drop_off >= 0)
    rows = np.random.default_rng(2).permutation(len(chosen))[:count]
    faults: list[str] = []
    for grasp in chosen[rows]:
        level = int(grasp[0]) if len(levels) > 1 else 0
        faults += faults_of(replays[level], record, grasp, 1 / 3, known[level])
    print(
        f"  replayed {len(rows)} whole cycles, {sum(map(len, known))} different paths, "
        f"at a third of the verification distance: {faults or 'nothing collides'}"
    )


def over_the_best_known(record: BinMap, count: int) -> None:
    """Print how long planned segments take over the best known of the same ends."""
    assert record.cycle is not None
    assert record.paths.stage is not None
    assert record.best is not None
    stage, levels = record.paths.stage, levels_of(record)
    chosen = np.argwhere(record.cycle.drop_off >= 0)
    rows = np.random.default_rng(1).permutation(len(chosen))[:count]
    ends = np.cumsum(record.paths.row_size)
    stored, least = 0.0, 0.0
    for grasp in chosen[rows]:
        scenes = CycleScenes.of(levels[int(grasp[0]) if len(levels) > 1 else 0])
        assert scenes is not None
        at = np.flatnonzero((record.paths.index[:, :4] == grasp).all(axis=1))
        for row in at:
            if stage[row] == 0 and row != record.best.row[tuple(grasp)]:
                continue
            if stage[row] not in (0, TRANSFER + 1, RETURN + 1):
                continue
            begin = ends[row] - record.paths.row_size[row]
            path = record.paths.configuration[begin:][: record.paths.planned_size[row]]
            held = stage[row] == TRANSFER + 1
            scene = scenes.carried if held else scenes.empty
            now = scene.time_law.path_time_s(path)
            stored, least = stored + now, least + min(now, best_known_s(scene, path))
    print(
        f"  planned segments of {len(rows)} cycles: {stored / max(least, 1e-9):.3f} "
        "times the best known between the same ends"
    )


def best_known_s(scene: Scene, path: FloatArray) -> float:
    """Least time of several plans between the ends of a path."""
    found = [path]
    for seed in range(PLANS):
        plan = scene.planner.plan(path[0], path[-1:], seed)
        found += [] if plan.path is None else [plan.path]
    times = []
    for seed, way in enumerate(found):
        rng = np.random.default_rng(seed)
        for _ in range(3):
            way = shorten_until(way, scene.motions, rng, 1e-3)
        times.append(scene.time_law.path_time_s(way))
    return min(times)


if __name__ == "__main__":
    main()
