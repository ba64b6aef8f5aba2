"""What leaves a map as motions, held against checks that share nothing with it.

    python benchmarks/bench_motions.py bin.h5 [every] [grasps.json ...]

*Export*: every stored best path (or every n-th) is written in all formats, read back
from the text alone, and replayed on the cell's meshes by Pinocchio in steps of a third
of the verification distance. *Library*: each grasp of the lists (default: 200 random
ones) is served; what is served is replayed in the same way, timed, and compared with
fresh plans to the same grasps.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from reachmap import MotionLibrary, Ranker  # noqa: E402
from reachmap._typing import FloatArray  # noqa: E402
from reachmap.core.kinematics.windings import Windings  # noqa: E402
from reachmap.core.scene import Scene  # noqa: E402
from reachmap.maps import read_bin_map  # noqa: E402
from reachmap.motions.library import ServedMotion  # noqa: E402
from reachmap.motions.motion import timed  # noqa: E402
from reachmap.ranking import rank_list, read_grasps  # noqa: E402
from reachmap.ranking.lookup.matching import Queries  # noqa: E402
from reachmap.sampling.frames import approach_distance_m  # noqa: E402
from reachmap.scans.ik_survey import survey_frames  # noqa: E402
from reachmap.tools.export import export  # noqa: E402
from reachmap.validation.random_grasps import random_grasps  # noqa: E402
from tests.support.dense_checks import DenseCheck  # noqa: E402
from tests.support.exported_motions import READERS  # noqa: E402


def replay_exports(map_path: Path, scene: Scene, every: int) -> int:
    """Replay what each format says; the number of motions that collide or differ."""
    check = DenseCheck(scene, margin_m=0.0)
    wrong = 0
    reference: list[FloatArray] = []
    for to, read in READERS.items():
        text = export(map_path, every=True, to=to).text
        motions = read(text)
        if to == "csv":
            reference = motions
            checked = motions[::every]
            wrong += sum(not check.path_is_free(way) for way in checked)
            print(f"export: {len(checked)} of {len(motions)} replayed, {wrong} collide")
            continue
        apart = [
            not on_way(way, known)
            for way, known in zip(motions, reference, strict=True)
        ]
        wrong += sum(apart)
        print(f"export: {to}: {len(motions)} read back, {sum(apart)} leave the way")
    return wrong


def on_way(points: FloatArray, way: FloatArray) -> bool:
    """Whether points lie on a polyline, ends included, within a microradian."""
    change = np.diff(way, axis=0)
    square = np.maximum((change**2).sum(axis=1), 1e-18)
    share = np.einsum("pkd,kd->pk", points[:, None] - way[None, :-1], change) / square
    nearest = way[:-1] + np.clip(share, 0.0, 1.0)[..., None] * change
    aside = np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)
    ends = np.abs(points[[0, -1]] - way[[0, -1]]).max()
    return bool(max(aside.max(), ends) < 1e-6)


def serve_all(library: MotionLibrary, queries: Queries) -> list[ServedMotion | None]:
    """Serve each grasp with and without a check; CPU times are printed."""
    found: list[ServedMotion | None] = []
    times = np.empty((len(queries), 2))
    for k in range(len(queries)):
        roll = queries.quaternions[k]
        how = {"direction": queries.axes[k]} if queries.free[k] else {
            "quaternion_wxyz": roll
        }  # fmt: skip
        for column, checked in enumerate((False, True)):
            begin = time.process_time()
            served = library.serve(queries.points[k], **how, check=checked)
            times[k, column] = time.process_time() - begin
        found.append(served)
    for name, row in zip(("without", "with"), 1e3 * times.T, strict=True):
        print(
            f"library: {name} check: median {np.median(row):.2f} ms, "
            f"99 % {np.percentile(row, 99):.1f} ms of CPU time"
        )
    return found


def fresh_time_s(scene: Scene, served: ServedMotion, seed: int) -> float:
    """Time of a fresh plan to the pose that was served; NaN where none is found."""
    survey = survey_frames(
        scene, served.T_base_tcp[None], approach_distance_m(scene.loaded.cell)
    )
    if not len(survey.frame):
        return float("nan")
    goals, row = survey.goals_near(
        np.arange(len(survey.frame)), scene.scan_configuration, Windings(scene.robot)
    )
    plan = scene.planner.plan(scene.scan_configuration, goals, seed)
    if plan.path is None:
        return float("nan")
    way = survey.way_from(int(row[plan.goal]), plan.path[-1])
    limits = scene.robot.velocity_rad_s, scene.robot.acceleration_rad_s2
    return float(timed(plan.path, way, served.test_grasp, *limits).time_s[-1])


def main() -> None:
    """Print all figures; exit with 1 where a motion collides or leaves its way."""
    map_path = Path(sys.argv[1])
    numbers = [int(value) for value in sys.argv[2:] if value.isdigit()]
    lists = [value for value in sys.argv[2:] if not value.isdigit()]
    library, ranker = MotionLibrary.from_map(map_path), Ranker.from_map(map_path)
    scene = library.scenes[0]
    wrong = replay_exports(map_path, scene, numbers[0] if numbers else 1)
    check = DenseCheck(scene, margin_m=0.0)
    known = [read_grasps(name) for name in lists] or [
        random_grasps(read_bin_map(map_path), 200, seed=3)
    ]
    for grasps in known:
        found = serve_all(library, rank_list(grasps, ranker).queries)
        served = [one for one in found if one is not None]
        ways = [np.vstack([one.planned, one.approach[1:]]) for one in served]
        collide = sum(not check.path_is_free(way) for way in ways)
        fresh = np.array([fresh_time_s(scene, one, k) for k, one in enumerate(served)])
        own = np.array([one.motion.time_s[-1] for one in served])
        both = np.isfinite(fresh)
        print(
            f"library: {grasps.source}: {len(served)} of {len(found)} served "
            f"({100 * len(served) / len(found):.1f} %), {collide} collide, motions "
            f"take {own[both].sum() / fresh[both].sum():.4f} of fresh plans to the "
            f"same {both.sum()} poses"
        )
        wrong += collide
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
