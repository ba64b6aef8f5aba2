"""One arm, written in several ways: signs, rounded angles, last places."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import IkSpec
from reachmap.core.kinematics.kinematics import Kinematics
from tests.support.kinematics_arms import (
    Link,
    misses,
    nearest_branch,
    robot,
    serial_urdf,
    ur5,
)

QUARTER = np.pi / 2


def shoulder_elbow_wrist(signs: tuple[int, int, int]) -> Kinematics:
    """An arm like a UR's, its parallel joints counted one way or the other."""
    a, b, c = signs
    links = [
        Link(xyz=(0, 0, 0.12)),
        Link(axis=(0, a, 0)),
        Link(xyz=(0, 0, 0.41), axis=(0, b, 0)),
        Link(xyz=(0, 0, 0.38), axis=(0, c, 0)),
        Link(xyz=(0, -0.12, 0)),
        Link(xyz=(0, 0, 0.10), axis=(0, -1, 0)),
    ]
    tcp = {"parent": "link_6", "xyz": [0.0, -0.09, 0.0]}
    return Kinematics(robot(serial_urdf(links), tcp))


@pytest.mark.parametrize("signs", [(1, 1, -1), (1, -1, 1), (-1, 1, 1), (-1, 1, -1)])
def test_counting_a_joint_the_other_way_changes_only_its_sign(
    signs: tuple[int, int, int],
) -> None:
    """Mixed signs have the closed form, and the solutions of equal signs."""
    mixed, same = shoulder_elbow_wrist(signs), shoulder_elbow_wrist((1, 1, 1))
    assert (mixed.method, mixed.complete) == ("analytic", True)
    Q = np.random.default_rng(1).uniform(-np.pi, np.pi, (50, 6))
    T = same.forward_many(Q)
    flip = np.array([1, *signs, 1, 1])
    for pose in T:
        theirs = same.solve(pose) * flip
        ours = mixed.solve(pose)
        assert len(ours) == len(theirs)
        apart = np.abs(ours[:, None] - theirs[None]).max(axis=2)
        assert apart.min(axis=1).max() < 1e-6


def five_axes(quarter: float) -> Kinematics:
    """Waist, three parallel axes and a turning flange."""
    links = [
        Link(xyz=(0, 0, 0.25)),
        Link(rpy=(-quarter, 0, 0)),
        Link(xyz=(0, -0.3, 0)),
        Link(xyz=(0.3, 0, 0)),
        Link(xyz=(0.08, 0.08, 0), rpy=(-quarter, 0, 0)),
    ]
    tcp = {"parent": "link_5", "xyz": [0.0, 0.0, 0.05]}
    return Kinematics(robot(serial_urdf(links), tcp))


def vertical_tools() -> FloatArray:
    """Poses with the tool down, all over the workspace and beyond."""
    xyz = np.array(np.meshgrid(*[np.linspace(-0.7, 0.7, 9)] * 2, [-0.2, 0.0, 0.3]))
    T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (xyz[0].size, 1, 1))
    T[:, :3, 3] = xyz.reshape(3, -1).T
    return T


@pytest.mark.parametrize("method", ["auto", "numeric"])
def test_five_axes_with_rounded_angles_reach_what_exact_ones_do(method: str) -> None:
    """1.5708 puts a vertical tool 7e-6 rad off, which five axes cannot correct."""
    exact, rounded = five_axes(QUARTER), five_axes(1.5708)
    T = vertical_tools()
    wanted = np.unique(exact.solve_many(T)[1])
    numeric = Kinematics(rounded.robot, IkSpec(method=method))
    found, frame = numeric.solve_many(T)
    np.testing.assert_array_equal(np.unique(frame), wanted)
    assert 60 < len(wanted) < len(T) - 60
    assert rounded.tolerance < 3e-5
    assert misses(rounded.robot, found, T[frame]).max() <= rounded.tolerance


def test_exact_arms_are_allowed_no_miss_for_rounding() -> None:
    """The tolerance of an arm with exact angles is that of every other arm."""
    kinematics = five_axes(QUARTER)
    assert kinematics.tolerance == 1e-7
    assert kinematics.complete
    tilted = kinematics.forward(np.array([0.3, -0.5, 0.4, -0.2, 0.1]))
    tilted[:3, :3] @= np.array([[1, 0, 0], [0, 1, -1e-5], [0, 1e-5, 1]])
    assert len(kinematics.solve(tilted)) == 0


def waist_and_parallel_axes(quarter: float, shift: float) -> Kinematics:
    """Four axes, the last three parallel."""
    links = [
        Link(xyz=(0, 0, 0.1)),
        Link(xyz=(shift, 0, 0), rpy=(quarter, 0, 0)),
        Link(xyz=(0.2, 0, 0)),
        Link(xyz=(0.2, 0, 0)),
    ]
    tcp = {"parent": "link_4", "xyz": [0.1, 0.0, 0.0]}
    return Kinematics(robot(serial_urdf(links), tcp))


@pytest.mark.parametrize("shift", [0.0, 0.02])
@pytest.mark.parametrize("quarter", [QUARTER, 1.5708, np.nextafter(QUARTER, 2)])
@pytest.mark.parametrize("noise", [0.0, 1e-16, 1e-15, 1e-12, 1e-9])
def test_poses_may_differ_in_their_last_places(
    quarter: float, shift: float, noise: float
) -> None:
    """Four axes: each of 200 configurations is found again at its perturbed pose."""
    kinematics = waist_and_parallel_axes(quarter, shift)
    rng = np.random.default_rng(2)
    Q = rng.uniform(-3, 3, (200, 4))
    T = kinematics.forward_many(Q)
    T[:, :3] += noise * rng.standard_normal((200, 3, 4))
    found, frame = kinematics.solve_many(T)
    assert nearest_branch(found, frame, Q).max() < 1e-4
    assert misses(kinematics.robot, found, T[frame]).max() < 1e-6 + kinematics.tolerance


@pytest.mark.parametrize("half", [np.pi, 3.1416, 3.14])
def test_what_eaik_cannot_take_goes_to_another_solver(half: float) -> None:
    """Axes turned over by a rounded half turn, which EAIK takes for meeting ones."""
    links = [
        Link(xyz=(0, 0, 0.1)),
        Link(xyz=(0.02, 0, 0), rpy=(1.5708, 0, 0)),
        Link(xyz=(0.2, 0, 0), rpy=(0, half, 0)),
        Link(xyz=(0.2, 0, 0), rpy=(half, 0, 0)),
    ]
    arm = robot(serial_urdf(links), "link_4")
    kinematics = Kinematics(arm)
    Q = np.random.default_rng(3).uniform(-1.5, 1.5, (200, 4))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert len(np.unique(frame)) == len(Q)
    assert misses(arm, found, T[frame]).max() < 1e-6 + kinematics.tolerance


def test_a_straight_approach_of_rounded_five_axes_is_followed() -> None:
    """What may miss a pose by rounding may do so along a path, too."""
    kinematics = five_axes(1.5708)
    assert "may be missed" in kinematics.approximation
    T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (30, 1, 1))
    T[:, :3, 3] = np.linspace([0.4, 0.1, 0.1], [0.4, 0.1, 0.0], 30)
    path = kinematics.follow(kinematics.solve(T[0], windings=False)[0], T)
    assert path is not None
    assert misses(kinematics.robot, path, T).max() < 2 * kinematics.tolerance


class _Fragile:
    """EAIK that raises at some poses, as it does for intersections at infinity."""

    def __init__(self, robot: object, every: int) -> None:
        self._robot, self._every, self._asked = robot, every, 0

    def calculate_IK(self, pose: np.ndarray) -> object:
        self._asked += 1
        if self._asked % self._every == 0:
            raise RuntimeError("Intersection point can't be calculated")
        return self._robot.calculate_IK(pose)  # type: ignore[attr-defined]


def test_an_exception_of_eaik_in_a_scan_costs_no_pose() -> None:
    """Poses at which it raises are solved by the next solver, the others as before."""
    kinematics = Kinematics(ur5(half_turn=True))
    arm = kinematics.robot
    Q = np.random.default_rng(5).uniform(arm.lower_rad, arm.upper_rad, (60, 6))
    T = kinematics.forward_many(Q)
    rows = kinematics._solver._rows  # type: ignore[attr-defined]
    robot = rows._robot
    rows._robot = _Fragile(robot, 3)
    try:
        found, frame = kinematics.solve_many(T)
    finally:
        rows._robot = robot
    assert len(np.unique(frame)) == 60
    assert misses(arm, found, T[frame]).max() < 1e-9
    assert (nearest_branch(found, frame, Q) < 1e-6).sum() >= 58
