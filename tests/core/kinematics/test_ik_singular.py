"""Singular poses of a UR5, where EAIK alone loses branches.

The rates are those of reference measurements or better: at elbow and shoulder
singularities every original is found; at wrist singularities, where the solutions
form curves, points of the curve through the original.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.kinematics.kinematics import Kinematics
from tests.support import ur_closed_form
from tests.support.kinematics_arms import misses, nearest_branch, turns_apart, ur5

COUNT = 50


@pytest.fixture(scope="module", name="kinematics")
def _kinematics() -> Kinematics:
    """UR5 in the frames of its closed form, joints of ±π."""
    return Kinematics(ur5(half_turn=True, base_frame="base"))


def held(joint: int, value: float) -> Callable[[FloatArray], FloatArray]:
    """Hold one joint at a value."""

    def hold(Q: FloatArray) -> FloatArray:
        Q[:, joint] = value
        return Q

    return hold


def over_the_base(Q: FloatArray) -> FloatArray:
    """Put the wrist where joint 1 is not determined."""
    rng = np.random.default_rng(2)
    return np.array([ur_closed_form.wrist_centre_over_base(q, rng) for q in Q])


def right_angles(Q: FloatArray) -> FloatArray:
    """Every joint at a multiple of a right angle: several singularities at once."""
    return np.random.default_rng(3).integers(-1, 3, Q.shape) * np.pi / 2


def stretched(Q: FloatArray) -> FloatArray:
    """Elbow and wrist singular at once."""
    return held(2, 0.0)(held(4, 0.0)(Q))


def posed(change: Callable[[FloatArray], FloatArray], count: int) -> FloatArray:
    """Random configurations made singular."""
    return change(np.random.default_rng(1).uniform(-np.pi, np.pi, (count, 6)))


ISOLATED = {
    "elbow stretched": held(2, 0.0),
    "elbow nearly stretched": held(2, 1e-6),
    "elbow folded": held(2, np.pi),
    "shoulder": over_the_base,
    "wrist 1e-5 rad away": held(4, 1e-5),
}

CURVES = {
    "wrist": held(4, 0.0),
    "wrist turned": held(4, np.pi),
    "wrist 1e-8 rad away": held(4, 1e-8),
    "wrist 1e-7 rad away": held(4, 1e-7),
    "wrist 1e-6 rad away": held(4, 1e-6),
    "wrist and elbow": stretched,
    "right angles": right_angles,
}


@pytest.mark.parametrize("case", ISOLATED)
def test_originals_are_found_at_isolated_singularities(
    kinematics: Kinematics, case: str
) -> None:
    """Elbow and shoulder: every original, and every solution exact."""
    Q = posed(ISOLATED[case], COUNT)
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert nearest_branch(found, frame, Q).max() < 2e-5
    assert misses(kinematics.robot, found, T[frame]).max() < 1e-6


@pytest.mark.parametrize("case", CURVES)
def test_curves_of_solutions_are_met(kinematics: Kinematics, case: str) -> None:
    """Wrist: each pose solved, with a solution on the same branch of joint 1."""
    Q = posed(CURVES[case], COUNT)
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert len(np.unique(frame)) == COUNT
    assert same_first_joint(Q, found, frame).mean() >= 0.98
    assert misses(kinematics.robot, found, T[frame]).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("case", [*ISOLATED, *CURVES])
def test_rates_on_many_singular_poses(kinematics: Kinematics, case: str) -> None:
    """The same for 1,000 poses a case: all solved, 99 % on the branch of joint 1."""
    Q = posed({**ISOLATED, **CURVES}[case], 1000)
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    solved = len(np.unique(frame)) / len(Q)
    same = float(same_first_joint(Q, found, frame).mean())
    near = float((nearest_branch(found, frame, Q) < 2e-5).mean())
    print(f"{case}: solved {solved:.4f}, joint 1 {same:.4f}, original {near:.4f}")
    assert solved >= 0.999
    assert same >= 0.99
    assert case in CURVES or near >= 0.999


def same_first_joint(Q: FloatArray, found: FloatArray, frame: IntArray) -> BoolArray:
    """Whether a solution has the original's joint 1, per frame."""
    near = turns_apart(found[:, 0] - Q[frame, 0]) < 1e-4
    return np.isin(np.arange(len(Q)), frame[near])
