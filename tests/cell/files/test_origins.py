"""Orientations in a URDF: quaternions as SciPy reads them, and degrees are noticed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reachmap.cell.files.urdf import parse_urdf
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from reachmap.errors import CellError
from tests.support.small_cells import joint, link, load, robot

BOX = '<box size="0.1 0.2 0.3"/>'
QUATERNIONS = [
    *np.random.default_rng(0).normal(size=(6, 4)).tolist(),
    [0.0, 0.5**0.5, 0.0, 0.5**0.5],  # pitch at a right angle
    [0.5, -0.5, 0.5, 0.5],
    [0.0, 0.0, 3.0, 0.0],
]


def arm(orientation: str, version: str = "1.1") -> str:
    """One joint and one collision element with this orientation."""
    origin = f'xyz="0.1 0.2 0.3" {orientation}'
    turned = joint("j1", "base", "l1", more=f"<origin {origin}/>")
    text = robot(link("base"), link("l1", f"{origin}|{BOX}"), turned)
    return text.replace("<robot ", f'<robot version="{version}" ')


@pytest.mark.parametrize("q", QUATERNIONS)
@pytest.mark.parametrize("version", ["1.1", "1.2"])
def test_quaternions_turn_joints_and_collision_shapes(
    tmp_path: Path, q: list[float], version: str
) -> None:
    """From version 1.1 on, in the order x, y, z, w and of any length."""
    urdf = arm(f'quat_xyzw="{" ".join(map(repr, q))}"', version)
    wanted = Rotation.from_quat(q).as_matrix()
    (shape,) = parse_urdf(urdf, "a.urdf").collisions
    np.testing.assert_allclose(shape.origin.matrix()[:3, :3], wanted, atol=1e-14)
    loaded = load(tmp_path, urdf, "l1", ["j1"])
    assert not loaded.warnings
    T = Kinematics(RobotModel.from_cell(loaded)).forward(np.zeros(1))
    np.testing.assert_allclose(T[:3, :3], wanted, atol=1e-14)
    np.testing.assert_allclose(T[:3, 3], [0.1, 0.2, 0.3], atol=1e-15)


def test_a_quaternion_of_the_first_version_is_not_read_and_named(
    tmp_path: Path,
) -> None:
    """Nothing is turned, as in ROS; that is said once."""
    urdf = arm('quat_xyzw="0 0 1 1"', "1.0")
    loaded = load(tmp_path, urdf, "l1", ["j1"])
    (warning,) = loaded.warnings
    assert "<origin quat_xyzw> is not read before version 1.1" in warning
    T = Kinematics(RobotModel.from_cell(loaded)).forward(np.zeros(1))
    np.testing.assert_array_equal(T[:3, :3], np.eye(3))


@pytest.mark.parametrize(
    ("orientation", "said"),
    [
        ('rpy="0 0 1" quat_xyzw="0 0 0 1"', "has both rpy and quat_xyzw"),
        ('quat_xyzw="0 0 0 0"', "expected 4 finite numbers, not all of them 0"),
        ('quat_xyzw="0 0 1"', "expected 4 finite numbers"),
        ('quat_xyzw="0 0 nan 1"', "expected 4 finite numbers"),
    ],
)
def test_quaternions_that_are_none_are_refused(orientation: str, said: str) -> None:
    """A quaternion is four numbers, and the only orientation of its origin."""
    with pytest.raises(CellError, match=said):
        parse_urdf(arm(orientation), "a.urdf")


def test_angles_that_can_hardly_be_radians_are_named() -> None:
    """Degrees turn a body to where nobody expects it; a whole turn is no mistake."""
    joint_note, link_note = parse_urdf(arm('rpy="0 90 0"'), "a.urdf").notes
    assert "joint 'j1': <origin rpy> is in radians (got 0 90 0)" in joint_note
    assert "collision of link 'l1': <origin rpy> is in radians" in link_note
    assert not parse_urdf(arm('rpy="0 6.2832 -3.1416"'), "a.urdf").notes
