"""Following a straight approach on one branch of the inverse kinematics."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap._typing import FloatArray
from reachmap.core.kinematics.kinematics import Kinematics
from tests.support.kinematics_arms import misses, ur5

START = np.array([0.3, -1.2, 1.1, -1.4, -1.5, 0.2])


@pytest.fixture(scope="module", name="kinematics")
def _kinematics() -> Kinematics:
    """UR5 with joints of ±π."""
    return Kinematics(ur5(half_turn=True))


def straight(T: FloatArray, direction: FloatArray, length_m: float) -> FloatArray:
    """Poses every 2 mm along a direction of the TCP."""
    steps = np.linspace(0.0, length_m, int(length_m / 0.002) + 1)
    poses = np.repeat(T[None], len(steps), axis=0)
    poses[:, :3, 3] += steps[:, None] * (T[:3, :3] @ direction)
    return poses


def test_a_straight_approach_is_followed(kinematics: Kinematics) -> None:
    """Each pose is met to 1e-6, and joints move by little from pose to pose."""
    poses = straight(kinematics.forward(START), np.array([0, 0, 1.0]), 0.1)
    path = kinematics.follow(START, poses)
    assert path is not None
    assert path.shape == (51, 6)
    assert misses(kinematics.robot, path, poses).max() < 2e-6
    assert np.abs(np.diff(path, axis=0)).max() < 0.05
    np.testing.assert_allclose(path[0], START, atol=1e-6)


def test_the_end_is_a_branch_of_its_pose(kinematics: Kinematics) -> None:
    """Following ends on one of the solutions of the last pose."""
    poses = straight(kinematics.forward(START), np.array([0, 0.6, 0.8]), 0.08)
    path = kinematics.follow(START, poses, tolerance=1e-9)
    assert path is not None
    apart = np.abs(kinematics.solve(poses[-1]) - path[-1]).max(axis=1)
    assert apart.min() < 1e-6


def test_there_and_back_is_where_it_began(kinematics: Kinematics) -> None:
    """The branch is kept: the way back ends at the start."""
    poses = straight(kinematics.forward(START), np.array([1.0, 0, 0]), 0.1)
    out_and_back = np.concatenate([poses, poses[::-1]])
    path = kinematics.follow(START, out_and_back, tolerance=1e-10)
    assert path is not None
    np.testing.assert_allclose(path[-1], START, atol=1e-8)


def test_a_path_beyond_reach_ends(kinematics: Kinematics) -> None:
    """The branch ends where the arm is stretched."""
    poses = straight(kinematics.forward(START), np.array([0, 0, 1.0]), 1.5)
    assert kinematics.follow(START, poses) is None


def test_a_path_through_a_joint_limit_ends() -> None:
    """Joint 1 would have to pass its limit."""
    limits = {
        "acceleration_rad_s2": 5.0,
        "position_deg": {"shoulder_pan_joint": [0, 20]},
    }
    tight = Kinematics(ur5(limits=limits))
    turning = [tight.forward(START + a * np.eye(6)[0]) for a in np.linspace(0, 0.2, 40)]
    assert tight.follow(START, np.array(turning)) is None
    assert tight.follow(START, np.array(turning[:5])) is not None


def test_poses_far_apart_are_refused(kinematics: Kinematics) -> None:
    """A jump of a joint between poses could be a change of branch."""
    ends = np.array([kinematics.forward(START), kinematics.forward(START + 0.3)])
    assert kinematics.follow(START, ends) is None
    assert kinematics.follow(START, ends, largest_step_rad=0.5) is not None


def test_an_empty_path_is_followed_at_once(kinematics: Kinematics) -> None:
    """No poses, no configurations."""
    path = kinematics.follow(START, np.zeros((0, 4, 4)))
    assert path is not None
    assert path.shape == (0, 6)


def test_many_are_followed_as_one_is(kinematics: Kinematics) -> None:
    """Rows of random starts, met and not met, against one row at a time."""
    rng = np.random.default_rng(8)
    robot = kinematics.robot
    Q = rng.uniform(robot.lower_rad, robot.upper_rad, (200, 6))
    poses = np.stack(
        [straight(kinematics.forward(q), np.array([0, 0, -1.0]), 0.05)[5::5] for q in Q]
    )
    found, is_met = kinematics.follow_many(Q, poses)
    alone = [kinematics.follow(q, T) for q, T in zip(Q, poses, strict=True)]
    assert is_met.tolist() == [path is not None for path in alone]
    assert 20 < is_met.sum() < 200
    paths = np.array([path for path in alone if path is not None])
    np.testing.assert_allclose(found[is_met], paths, atol=2e-4)
    met = np.flatnonzero(is_met)
    worst = max(misses(robot, found[k], poses[k]).max() for k in met)
    assert worst < 2e-6
