"""Arms of few axes meet position and direction at the roll that they have there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from tests.support.kinematics_arms import (
    Link,
    nearest_branch,
    pinocchio_tcp,
    robot,
    serial_urdf,
)

Y, Z = (0, 1, 0), (0, 0, 1)
PITCH = [Link(axis=Y), Link(xyz=(0, 0, 0.3), axis=Y), Link(xyz=(0, 0, 0.3), axis=Y)]
FOUR = [Link(xyz=(0, 0, 0.1)), *PITCH]
ARMS = {
    "four axes": FOUR,
    "a slide before": [Link(kind="prismatic", axis=Y, limit=(-0.5, 0.5)), *FOUR],
    "a yaw in the wrist": [*FOUR, Link(xyz=(0, 0, 0.1), axis=(1, 0, 0))],
}


def arm_of(links: list[Link]) -> RobotModel:
    """Arm whose tool is 0.1 m long, along its last link."""
    return robot(
        serial_urdf(links), {"parent": f"link_{len(links)}", "xyz": [0.0, 0.0, 0.1]}
    )


def rolled(T: np.ndarray, axis: str) -> np.ndarray:
    """Poses turned about an axis of the TCP by any angle."""
    angles = np.random.default_rng(2).uniform(-3.0, 3.0, len(T))
    turned = T.copy()
    turned[:, :3, :3] = (
        T[:, :3, :3] @ Rotation.from_euler(axis, angles[:, None]).as_matrix()
    )
    return turned


@pytest.mark.parametrize("name", ARMS)
def test_poses_are_met_whatever_their_roll(name: str) -> None:
    """The configuration a pose was made from is found; position and axis agree."""
    arm = arm_of(ARMS[name])
    kinematics = Kinematics(arm, any_roll_about="+z")
    assert kinematics.any_roll
    Q = np.random.default_rng(1).uniform(arm.lower_rad, arm.upper_rad, (100, arm.dof))
    T = np.array([pinocchio_tcp(arm, q) for q in Q])
    found, frame = kinematics.solve_many(rolled(T, "z"))
    assert (nearest_branch(found, frame, Q) < 1e-4).sum() >= 97
    for q, k in zip(found, frame, strict=True):
        met = pinocchio_tcp(arm, q)
        np.testing.assert_allclose(met[:3, 2:], T[k][:3, 2:], atol=1e-6)


@pytest.mark.parametrize("name", ARMS)
def test_a_branch_is_followed_at_the_roll_that_it_has(name: str) -> None:
    """To a pose near by whose roll is any other; the full pose is not met."""
    arm = arm_of(ARMS[name])
    kinematics = Kinematics(arm, any_roll_about="+z")
    rng = np.random.default_rng(3)
    followed = 0
    for _ in range(50):
        q = rng.uniform(arm.lower_rad, arm.upper_rad) / 2
        near = pinocchio_tcp(arm, q + rng.uniform(-0.05, 0.05, arm.dof))
        goal = rolled(near[None], "z")
        assert kinematics.follow(q, goal) is None
        met = kinematics.follow(q, goal, own_roll=True)
        if met is not None:
            followed += 1
            T = pinocchio_tcp(arm, met[0])
            np.testing.assert_allclose(T[:3, 2:], near[:3, 2:], atol=2e-6)
    assert followed >= 40


def test_a_vertical_tool_is_met_just_within_the_ring_of_the_wrist() -> None:
    """The wrist of the arm is 0.6 m at most from its shoulder, which is at (0, 0.1)."""
    kinematics = Kinematics(arm_of(FOUR), any_roll_about="+z")
    rng = np.random.default_rng(3)
    p = rng.uniform(-0.8, 0.8, (400, 3))
    T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (400, 1, 1))
    T[:, :3, 3] = p
    _, frame = kinematics.solve_many(rolled(T, "z"))
    wrist = np.linalg.norm(p, axis=1)  # 0.1 m above the TCP
    within = wrist <= 0.6
    assert 50 < within.sum() < 350
    np.testing.assert_array_equal(np.isin(np.arange(400), frame), within)


@pytest.mark.parametrize(
    ("links", "axis"),
    [
        ([*FOUR, Link(xyz=(0, 0, 0.1))], "+z"),
        ([*FOUR, Link(), Link(kind="prismatic", limit=(0, 0.1))], "-z"),
        ([*FOUR, Link(axis=Y), Link()], "+x"),
    ],
    ids=["a flange that turns", "a quill", "six axes"],
)
def test_arms_that_can_turn_their_tool_meet_the_pose_itself(
    links: list[Link], axis: str
) -> None:
    """They have no roll of their own: it is for the family to say."""
    assert not Kinematics(arm_of(links), any_roll_about=axis).any_roll
