"""Scores on workers: what is memoized, and the same by hand."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from reachmap.geometry import yaw_transform
from reachmap.placement.mapped.evaluator import open_evaluator
from reachmap.placement.mapped.imaging import UNSEEN
from reachmap.placement.mapped.sample import frames_in_bin, open_frames
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress

# Six points, all around; nothing of the approach but the branches of the kinematics.
SMALL = (
    "bin_scan.grid=[3,2]",
    "bin_scan.approach_distance_m=0.02",
    "tool.roll=listed",
)
EVERY = (3, 2, 1)
POSE = (0.45, 0.05, 0.0, 1.3)


def evaluator_of(loaded, workers=1):
    """An evaluator in this process, or with workers."""
    return open_evaluator(
        loaded,
        open_frames(RobotModel.from_cell(loaded), loaded),
        RunOptions(workers=workers),
        progress=Progress("", quiet=True),
    )


def test_a_score_against_frames_tried_one_by_one():
    """Of each frame with a free straight approach, the planner finds what is scored."""
    loaded = read_cell("ur5-eye-in-hand", SMALL)
    q = Scene.build(loaded, with_bin=False).scan_configuration
    with evaluator_of(loaded) as evaluator:
        found = evaluator.evaluate([POSE], q, grid=EVERY)[0]
    changed = loaded.with_changes(bin_pose=yaw_transform(*POSE))
    scene = Scene.build(changed, with_bin=True)
    cell = changed.cell
    T = scene.T_base_bin @ frames_in_bin(cell).transforms().reshape(-1, 4, 4)
    reached = np.zeros(len(T), bool)
    has_ik = np.zeros(len(T), bool)
    back = np.eye(4)
    back[2, 3] = -0.01
    for k, pose in enumerate(T):
        for grasp in scene.kinematics.solve(pose):
            has_ik[k] = True
            way = [grasp]
            for steps in (1, 2):
                options = scene.kinematics.solve(
                    pose @ np.linalg.matrix_power(back, steps)
                )
                if not len(options):
                    break
                away = np.abs(options - way[-1]).max(axis=1)
                if away.min() > 0.2:
                    break
                way.append(options[away.argmin()])
            if len(way) == 3 and scene.motions.path_is_verified(np.array(way)):
                reached[k] = True
                break
    assert found.score.reachable_share == pytest.approx(100 * has_ik.mean())
    assert found.score.score == pytest.approx(100 * reached.mean(), abs=0.7)
    assert found.score.worst_point == pytest.approx(
        100 * reached.reshape(6, 27).mean(axis=1).min(), abs=4.0
    )


def test_bounds_save_work_and_are_looked_at_again():
    """A pose not above a score has a bound; asked for more, it is mapped."""
    loaded = read_cell("ur5-eye-in-hand", SMALL)
    q = Scene.build(loaded, with_bin=False).scan_configuration
    with evaluator_of(loaded) as evaluator:
        first = evaluator.evaluate([POSE], q, above=99.99, grid=EVERY)[0]
        assert first.score is None
        assert first.reason == ""
        again = evaluator.evaluate([POSE], q, above=99.99, grid=EVERY)[0]
        assert evaluator.mapped == 1
        assert again is first
        whole = evaluator.evaluate([POSE], q, grid=EVERY)[0]
        assert evaluator.mapped == 2
        assert whole.score.score <= first.bound + 1e-9
        evaluator.evaluate([POSE, POSE], q, above=50.0, grid=EVERY)
        assert evaluator.mapped == 2


def cell_that_rests_in_the_wall(*overrides):
    """The UR5 cell with its tool, at its own scan configuration, in a wall at POSE."""
    loaded = read_cell("ur5-eye-in-hand", [*SMALL, *overrides])
    scene = Scene.build(loaded, with_bin=False)
    T = yaw_transform(*POSE)
    T[:3, 3] += 0.183 * T[:3, 0] + [0.0, 0.0, 0.03]
    T[:3, :3] = T[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    free = [q for q in scene.kinematics.solve(T) if scene.checker.is_free(q)]
    names = scene.robot.joint_names
    q = free[0]
    changed = loaded.with_changes(
        scan_configuration_rad=dict(zip(names, q.tolist(), strict=True))
    )
    return changed, q


def test_a_blocked_start_has_its_pair_or_another_configuration():
    """With the bin in the arm's way a given start is a reason, a free one is found."""
    loaded, q = cell_that_rests_in_the_wall()
    with evaluator_of(loaded) as evaluator:
        kept = evaluator.evaluate([POSE], q, grid=EVERY)[0]
        chosen = evaluator.evaluate([POSE], None, grid=EVERY)[0]
    assert kept.score is None
    assert kept.reason == "suction tube | bin wall +x at the scan configuration"
    assert chosen.score.score > 80.0


def test_without_any_view_there_is_a_reason():
    """Where the start is blocked and nothing images the bin, the reason says so."""
    loaded, _ = cell_that_rests_in_the_wall("camera.range_m=[0.5,0.501]")
    with evaluator_of(loaded) as evaluator:
        assert evaluator.evaluate([POSE], None, grid=EVERY)[0].reason == UNSEEN
