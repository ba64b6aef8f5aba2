"""Margins of poses whose score is a formula with a known drop."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reachmap.placement.margins import (
    DROP_POINTS,
    MARGIN_POSES,
    SHIFTS_M,
    TURNS_RAD,
    margins,
)
from tests.support.closed_form_evaluator import ClosedForm

POSE = (0.5, 0.1, 0.0, np.pi / 2)
Q = np.zeros(6)
DIRECTIONS = ["+x", "-x", "+y", "-y", "+z", "-z", "+yaw", "-yaw"]


def rung(distance, ladder):
    """Largest rung of a ladder up to a distance, 0 for none."""
    return max([0.0, *(step for step in ladder if step <= distance)])


def cliff(limits):
    """Score that drops by more than 5 points beyond a distance in each direction."""

    def score(pose):
        away = np.subtract(pose, POSE)
        for k in range(4):
            low, high = limits[2 * k + 1], limits[2 * k]
            if not -low - 1e-9 <= away[k] <= high + 1e-9:
                return 97.0 - DROP_POINTS - 0.01
        return 97.0

    return score


lengths = st.floats(0.0, 0.2)
angles = st.floats(0.0, 1.0)


@given(limits=st.tuples(*[lengths] * 6, *[angles] * 2))
def test_cliffs_at_known_distances(limits):
    """In each direction the margin is the last rung before the cliff."""
    evaluator = ClosedForm(cliff(limits))
    found = margins(POSE, Q, lambda pose: True, evaluator)
    assert list(found) == DIRECTIONS
    for name, limit in zip(DIRECTIONS, limits, strict=True):
        ladder = TURNS_RAD if "yaw" in name else SHIFTS_M
        assert found[name] == pytest.approx(rung(limit + 1e-9, ladder))
    assert len(evaluator.asked) <= MARGIN_POSES


def test_a_slope_of_known_steepness():
    """A score that falls by 50 points a metre holds for 0.1 m, 5 points."""
    evaluator = ClosedForm(lambda p: 95.0 - 50.0 * abs(p[0] - POSE[0]))
    found = margins(POSE, Q, lambda pose: True, evaluator)
    assert found["+x"] == found["-x"] == 0.10
    assert found["+y"] == SHIFTS_M[-1]
    assert found["-yaw"] == TURNS_RAD[-1]


def test_the_margin_ends_where_the_bin_cannot_stand():
    """A post in the way ends a margin, although the bin could stand beyond it."""

    def is_possible(pose):
        return not 0.04 < pose[1] - POSE[1] < 0.06

    evaluator = ClosedForm(lambda pose: 97.0)
    found = margins(POSE, Q, is_possible, evaluator)
    assert found["+y"] == 0.03
    assert found["-y"] == SHIFTS_M[-1]
    assert all(is_possible(pose) for pose in evaluator.asked)


def test_a_blocked_scan_configuration_ends_the_margin():
    """Where the arm would touch the bin while it takes its image, nothing is scored."""
    evaluator = ClosedForm(
        lambda p: "bin wall +x | forearm" if p[2] > POSE[2] + 0.04 else 97.0
    )
    found = margins(POSE, Q, lambda pose: True, evaluator)
    assert found["+z"] == 0.03


def test_no_score_at_the_pose_itself_is_no_margin():
    """Nothing can be said where the pose itself has no score."""
    evaluator = ClosedForm(lambda pose: "bin wall +x | forearm")
    assert margins(POSE, Q, lambda pose: True, evaluator) == {}


def test_a_score_that_cannot_drop_has_no_margin():
    """A bin out of reach is not said to have a margin of everything."""
    assert margins(POSE, Q, lambda pose: True, ClosedForm(lambda pose: 4.0)) == {}


@given(limits=st.tuples(*[lengths] * 6, *[angles] * 2))
def test_what_is_announced_is_enough_and_ever_less(limits):
    """Announced poses never fall short of those that follow; the total never rises."""
    evaluator = ClosedForm(cliff(limits))
    margins(POSE, Q, lambda pose: True, evaluator)
    totals = [before + more for before, more in evaluator.expected]
    assert totals == sorted(totals, reverse=True)
    assert totals[-1] >= len(evaluator.asked)
