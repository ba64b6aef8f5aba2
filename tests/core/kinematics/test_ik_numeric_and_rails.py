"""Arms without a closed form, and arms with more joints than six."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.model.cell import IkSpec
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from tests.support.kinematics_arms import (
    Link,
    misses,
    nearest_branch,
    robot,
    serial_urdf,
    ur5,
)

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)

# Two parallel axes, a wrist whose axes do not meet: no family of EAIK.
OFFSET_WRIST = [
    Link(xyz=(0, 0, 0.28)),
    Link(axis=Y),
    Link(xyz=(0, 0, 0.7), axis=Y),
    Link(xyz=(0.5, 0, 0.1), axis=X),
    Link(xyz=(0, 0, 0.16), axis=Y),
    Link(xyz=(0.13, 0, 0), axis=X),
]
# The same with a wrist whose axes meet: a closed form.
SPHERICAL_WRIST = [
    Link(xyz=(0, 0, 0.3)),
    Link(xyz=(0.1, 0, 0), axis=Y),
    Link(xyz=(0, 0, 0.5), axis=Y),
    Link(xyz=(0.4, 0, 0.05), axis=X),
    Link(axis=Y),
    Link(axis=X),
]
RAIL = Link(kind="prismatic", axis=X, limit=(-1.0, 1.5))
CROSS_RAIL = Link(kind="prismatic", axis=Y, limit=(-0.4, 0.4))


def arm_of(links: list[Link]) -> RobotModel:
    """Arm whose TCP is 0.1 m in front of its last link."""
    tcp = {"parent": f"link_{len(links)}", "xyz": [0.1, 0.02, 0.0]}
    return robot(serial_urdf(links), tcp)


def test_an_offset_wrist_is_solved_numerically() -> None:
    """Every pose, 195 of 200 original branches, residuals of 1e-9."""
    arm = arm_of(OFFSET_WRIST)
    kinematics = Kinematics(arm)
    assert (kinematics.method, kinematics.complete) == ("numeric", False)
    Q = np.random.default_rng(1).uniform(arm.lower_rad, arm.upper_rad, (200, 6))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert len(np.unique(frame)) == 200
    assert (nearest_branch(found, frame, Q) < 1e-6).sum() >= 195
    assert misses(arm, found, T[frame]).max() < 1e-9


def test_numeric_solutions_do_not_depend_on_other_poses() -> None:
    """Alone, in parts or all at once: the same solutions to the bit."""
    kinematics = Kinematics(arm_of(OFFSET_WRIST))
    Q = np.random.default_rng(2).uniform(-3, 3, (120, 6))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    for k in (0, 7, 119):
        np.testing.assert_array_equal(kinematics.solve(T[k]), found[frame == k])
    parts = [kinematics.solve_many(T[p])[0] for p in (slice(0, 13), slice(13, 120))]
    np.testing.assert_array_equal(np.concatenate(parts), found)


def test_numeric_solutions_of_a_ur5_are_its_branches() -> None:
    """What is found numerically is what the closed form has, nearly all of it."""
    arm = ur5(half_turn=True)
    analytic, numeric = Kinematics(arm), Kinematics(arm, IkSpec(method="numeric"))
    Q = np.random.default_rng(3).uniform(-np.pi, np.pi, (200, 6))
    T = analytic.forward_many(Q)
    wanted, of_wanted = analytic.solve_many(T)
    found, of_found = numeric.solve_many(T)
    assert (nearest_branch(found, of_found, Q) < 1e-5).sum() >= 195
    for k in range(len(T)):
        a, b = wanted[of_wanted == k], found[of_found == k]
        assert np.abs(a[:, None] - b[None]).max(axis=2).min(axis=0).max() < 1e-4
    assert len(found) >= 0.95 * len(wanted)


@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_a_pose_out_of_reach_is_not_solved_numerically(turn: float) -> None:
    """Far away, and at a place where only the orientation is impossible."""
    kinematics = Kinematics(arm_of(OFFSET_WRIST))
    far = np.diag([1.0, np.cos(turn), np.cos(turn), 1.0])
    far[:3, 3] = [3.0, 0.0, 0.5]
    assert len(kinematics.solve(far)) == 0


@pytest.mark.parametrize(
    ("links", "sampled"),
    [
        ([RAIL, *SPHERICAL_WRIST], "joint_1 sampled at 25 values from -1.00 to 1.50 m"),
        ([RAIL, CROSS_RAIL, *SPHERICAL_WRIST], "joint_2 sampled at 5 values"),
        (
            [
                *SPHERICAL_WRIST[:3],
                Link(kind="prismatic", axis=X, limit=(0, 0.3)),
                *SPHERICAL_WRIST[3:],
            ],
            "joint_4 sampled at 25 values from 0.00 to 0.30 m",
        ),
    ],
    ids=["rail", "gantry", "telescope"],
)
def test_rails_are_sampled_and_the_arm_solved_in_closed_form(
    links: list[Link], sampled: str
) -> None:
    """Poses between the samples as well; each solution exact and within limits."""
    arm = arm_of(links)
    kinematics = Kinematics(arm)
    assert (kinematics.method, kinematics.complete) == ("redundant-grid", False)
    assert sampled in kinematics.approximation
    Q = np.random.default_rng(4).uniform(arm.lower_rad, arm.upper_rad, (200, arm.dof))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert len(np.unique(frame)) == len(Q)
    assert np.abs(kinematics.forward_many(found) - T[frame]).max() < 1e-6
    assert misses(arm, found[::40], T[frame[::40]]).max() < 1e-6
    assert (found >= arm.lower_rad).all()
    assert (found <= arm.upper_rad).all()


def test_a_rail_on_a_sample_gives_the_branches_of_the_arm_alone() -> None:
    """At each value of the rail the solutions are those of the arm on its place."""
    alone, on_rail = (
        Kinematics(arm_of(SPHERICAL_WRIST)),
        arm_of([RAIL, *SPHERICAL_WRIST]),
    )
    kinematics = Kinematics(on_rail)
    Q = np.random.default_rng(5).uniform(-3, 3, (40, 6))
    rail = np.linspace(-1.0, 1.5, 25)[np.arange(40) % 25]
    T = alone.forward_many(Q)
    wanted, of_wanted = alone.solve_many(T)
    T[:, 0, 3] += rail
    found, frame = kinematics.solve_many(T)
    for k in range(40):
        ours = found[(frame == k) & (np.abs(found[:, 0] - rail[k]) < 1e-9), 1:]
        theirs = wanted[of_wanted == k]
        assert len(ours) == len(theirs)
        apart = np.abs(ours[:, None] - theirs[None]).max(axis=2)
        assert apart.min(axis=1).max() < 1e-6


@pytest.mark.parametrize("offset", [0.0, 0.003])
def test_a_joint_is_sampled_that_the_pose_does_not_determine(offset: float) -> None:
    """Spherical shoulder and wrist: the elbow is no joint to sample."""
    links = [
        Link(xyz=(0, 0, 0.3)),
        Link(axis=Y),
        Link(xyz=(0, offset, 0), axis=Z),
        Link(xyz=(0, 0, 0.4), axis=Y),
        Link(xyz=(0, 0, 0.35), axis=Z),
        Link(axis=Y),
        Link(xyz=(0, offset, 0), axis=Z),
    ]
    arm = arm_of(links)
    kinematics = Kinematics(arm)
    assert kinematics.method == "redundant-grid"
    assert "joint_4 sampled" not in kinematics.approximation
    Q = np.random.default_rng(6).uniform(arm.lower_rad, arm.upper_rad, (200, 7))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert len(np.unique(frame)) == len(Q)
    assert np.abs(kinematics.forward_many(found) - T[frame]).max() < 1e-6
    assert misses(arm, found[::40], T[frame[::40]]).max() < 1e-6


def test_a_pose_a_half_turn_off_is_no_solution_of_a_scara() -> None:
    """Its tool points down, so poses with the tool up are not reached."""
    scara = [
        Link(xyz=(0, 0, 0.3)),
        Link(xyz=(0.3, 0, 0)),
        Link(kind="prismatic", xyz=(0.2, 0, 0), limit=(-0.2, 0.0)),
        Link(),
    ]
    tcp = {"parent": "link_4", "xyz": [0, 0, -0.1], "rpy_deg": [180, 0, 0]}
    kinematics = Kinematics(robot(serial_urdf(scara), tcp))
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    down[:3, 3] = [0.3, 0.1, 0.1]
    up = down.copy()
    up[:3, :3] = np.eye(3)
    assert len(kinematics.solve(down)) > 0
    assert len(kinematics.solve(up)) == 0


def test_an_arm_is_tried_once_in_a_process() -> None:
    """A second model of the same arm gets the solver of the first."""
    first, second = Kinematics(arm_of(OFFSET_WRIST)), Kinematics(arm_of(OFFSET_WRIST))
    other = Kinematics(arm_of(OFFSET_WRIST), IkSpec(restarts=4))
    assert first._solver is second._solver
    assert other._solver is not first._solver
