"""The worst case under a tolerance, on scores that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.placement.mapped.candidates import Candidate
from reachmap.placement.mapped.exact import PoseScore
from reachmap.placement.tolerance import (
    NOISE_POINTS,
    ROOM,
    Tolerance,
    away_from_losses,
    worst_case,
)
from tests.support.closed_form_evaluator import ClosedForm
from tests.support.optional import present

TOLERANCE = Tolerance(shift_m=0.03, turn_rad=np.radians(5.0))
SCALE = np.array([0.03, 0.03, 0.03, np.radians(5.0)])
POSE = (0.5, 0.1, 0.0, 0.4)


def candidate(pose, formula):
    """A pose with its score by a formula."""
    score = PoseScore(
        score=formula(pose), worst_point=0.0, reachable_share=100.0, path_length_rad=1.0
    )
    return Candidate(pose=pose, score=score, exact=True)


def worst(formula, *, tolerance=TOLERANCE, is_possible=lambda pose: True):
    """The worst case of the pose."""
    evaluator = ClosedForm(formula)
    return worst_case(candidate(POSE, formula), tolerance, None, is_possible, evaluator)


def test_offsets_stay_within_the_tolerance_and_on_its_edge():
    """No shift is longer than allowed, no turn wider; heights only where it floats."""
    for floats in (False, True):
        tolerance = Tolerance(shift_m=0.03, turn_rad=0.1, floats=floats)
        offsets = tolerance.offsets()
        shifts = np.linalg.norm(offsets[:, :3], axis=1)
        assert shifts == pytest.approx(0.03)
        assert np.abs(offsets[:, 3]).max() == pytest.approx(0.1)
        assert (np.abs(offsets[:, 2]) > 0).any() == floats
        np.testing.assert_allclose(offsets.sum(axis=0), 0.0, atol=1e-12)
    assert Tolerance(shift_m=0.0, turn_rad=0.0).is_none


def test_a_plane_falls_by_its_slope():
    """A linear score loses slope times shift in one direction, nothing in the other."""
    slope = 200.0

    def score(pose):
        return 80.0 + slope * (pose[0] - POSE[0])

    found = worst(score)
    assert found.score == pytest.approx(80.0 - slope * 0.03)
    ahead = TOLERANCE.offsets()[:, 0] > 0
    assert (found.lost[ahead] == 0.0).all()
    moved = present(away_from_losses(POSE, TOLERANCE, found, NOISE_POINTS))
    assert np.subtract(moved, POSE) == pytest.approx([ROOM * 0.03, 0.0, 0.0, 0.0])


def test_a_plateau_keeps_its_pose():
    """Where nothing is lost there is nowhere to go."""
    found = worst(lambda pose: 90.0)
    assert found.score == 90.0
    assert away_from_losses(POSE, TOLERANCE, found, NOISE_POINTS) is None


def test_where_the_bin_cannot_stand_the_worst_case_is_nothing():
    """A wall at 20 mm makes the score 0, and the way out leads away from it."""
    found = worst(lambda pose: 90.0, is_possible=lambda pose: pose[1] < POSE[1] + 0.02)
    assert found.score == 0.0
    moved = present(away_from_losses(POSE, TOLERANCE, found, NOISE_POINTS))
    assert moved[1] == pytest.approx(POSE[1] - ROOM * 0.03)


def test_the_worst_case_bounds_poses_inside_a_cone():
    """Of a score that falls off with distance, no pose inside has less."""

    def score(pose):
        away = (np.array(pose) - POSE) / SCALE
        return 95.0 - 10.0 * float(np.linalg.norm(away[:3]) + abs(away[3]))

    found = worst(score)
    rng = np.random.default_rng(3)
    for _ in range(200):
        angle, radius = rng.uniform(0, 2 * np.pi), rng.uniform(0, 1)
        offset = [radius * np.cos(angle), radius * np.sin(angle), 0, rng.uniform(-1, 1)]
        inside = np.array(POSE) + SCALE * offset
        assert score(tuple(inside)) >= found.score - 1e-9
