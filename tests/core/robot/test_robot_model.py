"""The arm assembled from a description: joints, limits, frames, refusals."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from reachmap.errors import CellError, SceneError
from tests.support.kinematics_arms import (
    KINOVA,
    PANDA,
    UR5_JOINTS,
    Link,
    robot,
    serial_urdf,
    ur5,
    urdf_text,
)
from tests.support.small_cells import LIMIT, joint, link, load
from tests.support.small_cells import robot as small_robot

TWO = [Link(axis=(0, 0, 1)), Link(xyz=(0.3, 0, 0), axis=(0, 1, 0))]


@pytest.mark.parametrize(
    ("name", "dof"),
    [("ur5-eye-in-hand", 6), ("panda-eye-in-hand", 7), ("planar-toy", 3)],
)
def test_shipped_cells_give_arms(name: str, dof: int) -> None:
    """Each shipped cell's chain from base to TCP is what moves."""
    arm = RobotModel.from_cell(read_cell(name))
    assert arm.dof == dof == arm.model.nq == arm.model.nv
    assert tuple(arm.model.names)[1:] == arm.joint_names


def test_joints_are_in_chain_order_and_limits_are_the_tightest() -> None:
    """The cell's limits tighten the URDF's, and the scaling slows motions."""
    arm = ur5(
        limits={
            "velocity_rad_s": {"elbow_joint": 1.0},
            "acceleration_rad_s2": 4.0,
            "position_deg": {"shoulder_pan_joint": [-90, 720]},
            "scaling": 0.5,
        }
    )
    assert arm.joint_names == UR5_JOINTS
    np.testing.assert_allclose(arm.lower_rad[:3], [-np.pi / 2, -2 * np.pi, -np.pi])
    np.testing.assert_allclose(arm.upper_rad[:3], [2 * np.pi, 2 * np.pi, np.pi])
    np.testing.assert_allclose(
        arm.velocity_rad_s, 0.5 * np.array([3.15, 3.15, 1.0, 3.2, 3.2, 3.2])
    )
    np.testing.assert_allclose(arm.acceleration_rad_s2, 1.0)
    np.testing.assert_array_equal(arm.model.lowerPositionLimit, arm.lower_rad)


def test_missing_accelerations_are_listed() -> None:
    """URDFs have no accelerations; joints without one are named."""
    with pytest.raises(SceneError, match=r"no acceleration limit for .*wrist_3_joint"):
        ur5(limits={"acceleration_rad_s2": {"elbow_joint": 1.0}})


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"position_deg": {"joint_9": [0, 1]}}, "'joint_9' is not a joint that moves"),
        ({"position_deg": {"joint_1": [200, 300]}}, "'joint_1' has no range left"),
        ({"velocity_rad_s": {"x": 1.0}}, "velocity_rad_s: 'x' is not a joint"),
    ],
)
def test_wrong_limits_are_refused(limits: dict[str, object], message: str) -> None:
    """A limit of an unknown joint, or one that leaves no range, is a mistake."""
    with pytest.raises(SceneError, match=message):
        robot(serial_urdf(TWO), "link_2", limits={"acceleration_rad_s2": 1.0, **limits})


def test_several_mistakes_are_reported_at_once() -> None:
    """Unknown joints, joints both locked and moving: one line each."""
    with pytest.raises(SceneError) as caught:
        ur5(
            joints=["elbow_joint", "nothing"],
            locked_joints_deg={"elbow_joint": 3, "nowhere": 1},
        )
    assert len(caught.value.lines) == 4


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"tcp": "hand"}, r"robot.tcp.parent: the URDF has no frame 'hand' .*tool0"),
        ({"base_frame": "hand"}, r"robot.base_frame: the URDF has no frame 'hand'"),
        ({"tcp": "base"}, "no joint moves 'base'"),
        ({"base_frame": "ee_link", "tcp": "forearm_link"}, "not on the way"),
    ],
)
def test_wrong_frames_are_refused(spec: dict[str, object], message: str) -> None:
    """Frames that do not exist or make no chain are named, with the choice."""
    with pytest.raises(SceneError, match=message):
        ur5(**spec)  # type: ignore[arg-type]


def test_joints_beyond_the_chain_are_locked_where_the_cell_says() -> None:
    """Fingers do not move; their positions are the cell's, or the nearest to zero."""
    open_hand = robot(
        urdf_text(PANDA), "panda_hand", locked_joints_deg={"panda_finger_joint1": 0.04}
    )
    shut_hand = robot(urdf_text(PANDA), "panda_hand")
    _, T_open = open_hand.frame_placement("panda_leftfinger")
    _, T_shut = shut_hand.frame_placement("panda_leftfinger")
    assert open_hand.dof == 7
    assert np.linalg.norm(T_open[:3, 3] - T_shut[:3, 3]) == pytest.approx(0.04)


def test_fingers_that_mimic_follow_their_leader() -> None:
    """A mimic joint is locked at multiplier × leader + offset."""
    finger = Link(kind="prismatic", limit=(-1.0, 1.0), axis=(1, 0, 0))
    mimic = '<mimic joint="joint_2" multiplier="-2" offset="0.01"/>'
    arm = robot(
        serial_urdf([Link(), finger, dataclasses.replace(finger, extra=mimic)]),
        "link_1",
        locked_joints_deg={"joint_2": 0.1},
    )
    _, T = arm.frame_placement("link_3")
    assert T[0, 3] == pytest.approx(0.1 - 2 * 0.1 + 0.01)


def test_a_mimic_joint_in_the_arm_is_refused() -> None:
    """A joint that follows a moving joint would make the chain another one."""
    arm = [Link(), Link(extra='<mimic joint="joint_1"/>')]
    with pytest.raises(
        SceneError, match=r"'joint_2' is between base and TCP and follows 'joint_1'"
    ):
        robot(serial_urdf(arm), "link_2")


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_of_several_degrees_of_freedom_stay_out_of_the_chain(kind: str) -> None:
    """Above the base or beside the arm they are held at zero, as MoveIt holds them."""
    plain = serial_urdf([Link(kind="fixed", xyz=(0, 0, 1)), *TWO])
    free = plain.replace('type="fixed"', f'type="{kind}"')
    message = rf"'joint_1' between base and TCP has .*'{kind}'.*base_frame: link_1"
    with pytest.raises(SceneError, match=message):
        robot(free, "link_3")
    arm = robot(free, "link_3", base_frame="link_1")
    q = np.array([0.2, -0.4])
    same = robot(plain, "link_3", base_frame="link_1")
    np.testing.assert_array_equal(
        Kinematics(arm).forward(q), Kinematics(same).forward(q)
    )
    beside = plain.replace(
        "</robot>",
        f'<link name="o"/><joint name="oj" type="{kind}"><parent link="link_1"/>'
        '<child link="o"/></joint></robot>',
    )
    assert robot(beside, "link_3").joint_names == ("joint_2", "joint_3")


@pytest.mark.parametrize("text", ["<robot", "<sdf/>"])
def test_what_is_no_urdf_is_refused(text: str) -> None:
    """Broken XML and other formats are told apart from robots."""
    with pytest.raises((CellError, SceneError), match=r"robot.urdf"):
        robot(text, "link_1")


def test_continuous_joints_become_one_angle() -> None:
    """They get ±π, or the limits of the cell where it gives wider ones."""
    arm = robot(urdf_text(KINOVA), "j2s6s200_end_effector")
    assert arm.model.nq == 6
    assert (arm.lower_rad[0], arm.upper_rad[0]) == pytest.approx((-np.pi, np.pi))
    wide = robot(
        serial_urdf([Link(kind="continuous"), *TWO]),
        "link_3",
        limits={
            "acceleration_rad_s2": 1.0,
            "velocity_rad_s": 1.0,
            "position_deg": {"joint_1": [-360, 360]},
        },
    )
    assert wide.upper_rad[0] == pytest.approx(2 * np.pi)
    with pytest.raises(SceneError, match="no velocity limit for joint_1"):
        robot(serial_urdf([Link(kind="continuous"), *TWO]), "link_3")


def test_names_that_the_engine_does_not_take_do_no_harm() -> None:
    """A link called universe, as the engine's own, and a robot without a name."""
    text = serial_urdf(TWO)
    odd = text.replace(' name="arm"', "").replace('"link_1"', '"universe"')
    q = np.array([0.3, -0.7])
    T_plain, T_odd = (
        Kinematics(robot(urdf, "link_2")).forward(q) for urdf in (text, odd)
    )
    np.testing.assert_array_equal(T_odd, T_plain)
    T_link = Kinematics(robot(odd, "universe")).forward(q[:1])
    np.testing.assert_allclose(T_link[:2, 0], [np.cos(0.3), np.sin(0.3)])


def test_frames_of_the_cell_come_before_links_of_the_same_name() -> None:
    """``world`` and ``robot_base`` are the cell's, whatever a URDF link is called."""
    base_pose = {"xyz": [1, 2, 3], "rpy_deg": [0, 0, 90]}
    arm = ur5(base_frame="base", base_pose=base_pose)
    joint, T_root_world = arm.frame_placement("world")
    assert joint == 0
    _, T_root_base = arm.frame_placement("robot_base")
    T_base_world = np.linalg.inv(T_root_base) @ T_root_world
    np.testing.assert_allclose(np.linalg.inv(T_base_world), arm.T_world_base)
    np.testing.assert_allclose(arm.T_world_base[:3, 3], [1, 2, 3])
    np.testing.assert_allclose(T_root_base[:3, :3], np.diag([-1, -1, 1]), atol=1e-12)
    joint, T = arm.frame_placement("tool0")
    assert joint == 6
    assert T[1, 3] == pytest.approx(0.0823)


def test_configurations_are_given_by_joint_name() -> None:
    """All moving joints, no others; the mistake names them."""
    arm = ur5()
    values = {name: 0.1 * k for k, name in enumerate(UR5_JOINTS)}
    q = arm.configuration(values, "scan_configuration")
    np.testing.assert_allclose(q, 0.1 * np.arange(6))
    assert arm.outside_limits(q) == ()
    assert arm.outside_limits(np.array([0, 0, 4.0, 0, 0, 7.0])) == (
        "elbow_joint",
        "wrist_3_joint",
    )
    del values["elbow_joint"]
    with pytest.raises(SceneError, match="no value for elbow_joint"):
        arm.configuration({**values, "gripper": 0.0}, "scan_configuration")


def test_arrays_of_an_arm_cannot_be_changed() -> None:
    """A robot is a value: its arrays are read-only."""
    with pytest.raises(ValueError, match="read-only"):
        ur5().lower_rad[0] = 0.0


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("seed=1", r"cell\.yaml:7:11: robot\.limits: joint 'j1' has no range left"),
        (
            "robot.locked_joints_deg={j2: 300}",
            r"^--set robot\.locked_joints_deg=.*: robot\.locked_joints_deg: joint 'j2'",
        ),
    ],
)
def test_what_is_wrong_with_the_arm_of_a_cell_has_its_place(
    tmp_path: Path, override: str, said: str
) -> None:
    """The key's file, line and column, or the option that gave it."""
    stuck = LIMIT if "j2" in override else '<limit velocity="1" effort="1"/>'
    joints = [joint("j1", "base", "l1", more=stuck), joint("j2", "l1", "l2")]
    urdf = small_robot(link("base"), link("l1"), link("l2"), *joints)
    moving = ["j1"] if "j2" in override else ["j1", "j2"]
    loaded = load(tmp_path, urdf, "l2", moving, [override])
    with pytest.raises(SceneError, match=said):
        RobotModel.from_cell(loaded)
