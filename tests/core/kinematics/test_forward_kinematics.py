"""Forward kinematics against Pinocchio and the Denavit–Hartenberg form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reachmap._typing import FloatArray
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.chain import SerialChain, pose_error
from reachmap.core.robot.model import RobotModel
from reachmap.geometry import rotation_from_rpy_deg, transform_from_parts
from tests.support import ur_closed_form
from tests.support.kinematics_arms import (
    KINOVA,
    PANDA,
    Link,
    pinocchio_tcp,
    robot,
    serial_urdf,
    ur5,
    urdf_text,
)

SLIDING = [
    Link(kind="prismatic", axis=(1, 0, 0), limit=(-1, 1)),
    Link(xyz=(0, 0.2, 0.1), rpy=(0.3, 0.1, -0.4), axis=(0.6, 0, 0.8)),
    Link(kind="prismatic", xyz=(0.1, 0, 0), axis=(0, 0.6, 0.8), limit=(0, 0.5)),
    Link(xyz=(0, 0, 0.3), axis=(0, -1, 0)),
]

ARMS = {
    "ur5": lambda: ur5(tcp={"parent": "tool0", "xyz": [0.1, -0.05, 0.2]}),
    "ur5 from base": lambda: ur5(base_frame="base"),
    "panda": lambda: robot(urdf_text(PANDA), "panda_hand"),
    "kinova": lambda: robot(urdf_text(KINOVA), "j2s6s200_end_effector"),
    "elbow locked": lambda: ur5(locked_joints_deg={"elbow_joint": 30}),
    "sliding": lambda: robot(serial_urdf(SLIDING), "link_4"),
}


@pytest.fixture(params=ARMS, name="arm")
def _arm(request: pytest.FixtureRequest) -> RobotModel:
    """Arms of all kinds of joints."""
    return ARMS[request.param]()


def configurations(arm: RobotModel, count: int, seed: int = 0) -> FloatArray:
    """Uniform configurations within limits."""
    rng = np.random.default_rng(seed)
    return rng.uniform(arm.lower_rad, arm.upper_rad, (count, arm.dof))


def test_poses_are_those_of_pinocchio(arm: RobotModel) -> None:
    """One by one and all at once, for every kind of joint and frame."""
    kinematics = Kinematics(arm)
    Q = configurations(arm, 50)
    T = kinematics.forward_many(Q)
    for q, pose in zip(Q, T, strict=True):
        np.testing.assert_allclose(pose, pinocchio_tcp(arm, q), atol=1e-13)
        np.testing.assert_allclose(kinematics.forward(q), pose, atol=1e-13)


def test_poses_are_those_of_the_data_sheet() -> None:
    """UR5 from ``base`` to ``tool0`` is the published Denavit–Hartenberg chain."""
    arm = ur5(base_frame="base")
    for q in configurations(arm, 50):
        np.testing.assert_allclose(
            Kinematics(arm).forward(q), ur_closed_form.forward(q), atol=1e-9
        )


def test_jacobians_are_derivatives(arm: RobotModel) -> None:
    """Columns agree with central differences of the pose."""
    chain = SerialChain.from_robot(arm)
    Q, h = configurations(arm, 20), 1e-6
    T, J = chain.jacobian_many(Q)
    np.testing.assert_array_equal(T, chain.forward_many(Q))
    for k in range(arm.dof):
        step = h * np.eye(arm.dof)[k]
        ahead, behind = chain.forward_many(Q + step), chain.forward_many(Q - step)
        numeric = pose_error(ahead, behind) / (2 * h)
        np.testing.assert_allclose(J[:, :, k], numeric, atol=1e-8)


def test_a_pose_does_not_depend_on_its_neighbours() -> None:
    """Results are the same to the last bit however the work is divided."""
    chain = SerialChain.from_robot(ur5())
    Q = configurations(ur5(), 1000)
    T, (_, J) = chain.forward_many(Q), chain.jacobian_many(Q)
    for part in (slice(0, 1), slice(1, 4), slice(5, 270), slice(511, 1000)):
        np.testing.assert_array_equal(chain.forward_many(Q[part]), T[part])
        np.testing.assert_array_equal(chain.jacobian_many(Q[part])[1], J[part])


def test_no_configurations_give_no_poses() -> None:
    """Empty in, empty out."""
    assert Kinematics(ur5()).forward_many(np.zeros((0, 6))).shape == (0, 4, 4)


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3),
    st.lists(st.floats(-179.0, 179.0), min_size=3, max_size=3),
)
def test_pose_errors_lead_to_the_goal(p: list[float], rpy: list[float]) -> None:
    """Turning by the rotation vector and moving by the translation gives the goal."""
    start = transform_from_parts(
        rotation_from_rpy_deg(np.array([10, 20, 30])), np.ones(3)
    )
    goal = transform_from_parts(rotation_from_rpy_deg(np.array(rpy)), np.array(p))
    error = pose_error(goal[None], start[None])[0]
    angle = float(np.linalg.norm(error[3:]))
    if angle > 3.1415:  # a half turn has two axes
        return
    x, y, z = error[3:] / max(angle, 1e-300)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    np.testing.assert_allclose(turn @ start[:3, :3], goal[:3, :3], atol=1e-9)
    np.testing.assert_allclose(start[:3, 3] + error[:3], goal[:3, 3], atol=1e-12)


@settings(max_examples=100, deadline=None)
@given(
    axis=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(
        lambda a: np.linalg.norm(a) > 0.1
    ),
    short_of_half_turn=st.sampled_from(
        [0.0, 1e-15, 1e-9, 1e-6, 1e-3, 0.009, 0.011, 0.5]
    ),
    rpy=st.tuples(*[st.floats(-180.0, 180.0)] * 3),
)
def test_pose_errors_at_half_turns(
    axis: tuple[float, ...], short_of_half_turn: float, rpy: tuple[float, ...]
) -> None:
    """The rotation vector is as long as the turn, and turns to the goal."""
    a = np.array(axis) / np.linalg.norm(axis)
    angle = np.pi - short_of_half_turn
    K = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    turn = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    start = transform_from_parts(rotation_from_rpy_deg(np.array(rpy)), np.zeros(3))
    goal = transform_from_parts(turn @ start[:3, :3], np.zeros(3))
    error = pose_error(goal[None], start[None])[0, 3:]
    ways = [angle * a, -angle * a] if short_of_half_turn < 1e-12 else [angle * a]
    assert min(np.abs(error - way).max() for way in ways) < 1e-12


@pytest.mark.parametrize("axis", np.eye(3).tolist())
def test_an_exact_half_turn_about_an_axis_is_no_match(axis: list[float]) -> None:
    """Tool up is not tool down, though the rotation's sine is zero."""
    goal = transform_from_parts(2 * np.outer(axis, axis) - np.eye(3), np.zeros(3))
    error = pose_error(goal[None], np.eye(4)[None])[0, 3:]
    np.testing.assert_allclose(np.abs(error), np.pi * np.array(axis), atol=1e-15)
