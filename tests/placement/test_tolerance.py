"""The worst case under a tolerance, on scores that are known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.core.scene import Scene
from reachmap.placement.mapped.candidates import Candidate
from reachmap.placement.mapped.evaluator import open_evaluator
from reachmap.placement.mapped.exact import ALWAYS, NEVER, PoseScore
from reachmap.placement.mapped.sample import COARSE, DENSE, open_frames
from reachmap.placement.tolerance import (
    NOISE_POINTS,
    ROOM,
    Tolerance,
    away_from_losses,
    confirmed_worst,
    moved_by,
    worst_case,
)
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress
from tests.support.closed_form_evaluator import ClosedForm
from tests.support.optional import present

TOLERANCE = Tolerance(shift_m=0.03, turn_rad=np.radians(5.0))
SCALE = np.array([0.03, 0.03, 0.03, np.radians(5.0)])
POSE = (0.5, 0.1, 0.0, 0.4)
HARD_CELLS = Path(__file__).parents[2] / "benchmarks" / "hard_cells"
CHECKS = ("roadmap.max_checks=2000", "roadmap.sample_checks=4000")
# More points than the bin of the cell has, all of its orientations.
EVERY_GRASP = (8, 6, 1)


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


def test_all_directions_are_looked_at_with_either_turn():
    """Offsets and the others are the eight directions, each with both turns."""
    every = np.vstack([TOLERANCE.offsets(), TOLERANCE.others()]) / SCALE
    angle_deg = np.degrees(np.arctan2(every[:, 1], every[:, 0])).round(6) % 360
    seen = sorted(zip(angle_deg.tolist(), every[:, 3].round(9).tolist(), strict=True))
    assert seen == [(a, t) for a in np.arange(0.0, 360.0, 45.0) for t in (-1.0, 1.0)]
    assert np.linalg.norm(every[:, :3], axis=1) == pytest.approx(1.0)
    turned = Tolerance(shift_m=0.0, turn_rad=0.1)
    assert turned.others()[:, 3].tolist() == [-0.1, 0.1]
    assert turned.offsets()[:, 3].tolist() == [0.1, -0.1]


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


@pytest.mark.slow
def test_what_few_grasps_hide_is_confirmed_with_more():
    """In the window, a neighbour loses what the quick sample does not look at.

    Every test grasp of all neighbours, each mapped alone, says how much.
    """
    loaded = read_cell(str(HARD_CELLS / "window-ur5.yaml"), CHECKS)
    scene = Scene.shared(loaded, with_bin=False)
    is_open = open_frames(scene.robot, loaded)
    pose, q = (0.0875, 0.525, -0.03, 0.0), scene.scan_configuration
    tolerance = Tolerance(shift_m=0.03, turn_rad=np.radians(5.0), floats=True)
    quiet = RunOptions(workers=1, quiet=True)
    progress = Progress("test", quiet=True)
    with open_evaluator(loaded, is_open, quiet, progress=progress) as evaluator:
        (here,) = evaluator.evaluate([pose], q)
        found = Candidate(pose=pose, score=here.score, exact=True)
        quick = worst_case(found, tolerance, q, lambda pose: True, evaluator)
        confirmed = confirmed_worst(found, quick, tolerance, q, evaluator)
        offsets = np.vstack([tolerance.offsets(), tolerance.others()])
        neighbours = [moved_by(pose, offset) for offset in offsets]
        every = evaluator.evaluate(neighbours, q, grid=EVERY_GRASP)
    true = min(present(evaluation.score).score for evaluation in every)
    assert quick.score == present(here.score).score
    assert confirmed.score == pytest.approx(true)
    assert true < quick.score - NOISE_POINTS


def test_a_loss_that_only_another_turn_shows_counts():
    """A score that falls where the bin is shifted one way and turned the other."""

    def score(pose):
        x, _, _, yaw = (np.array(pose) - POSE) / SCALE
        return 90.0 - 8.0 * max(-x * yaw, 0.0)

    evaluator, found = ClosedForm(score), candidate(POSE, score)
    quick = worst_case(found, TOLERANCE, None, lambda pose: True, evaluator)
    assert quick.score == 90.0
    confirmed = confirmed_worst(found, quick, TOLERANCE, None, evaluator)
    assert confirmed.score == pytest.approx(82.0)


def test_a_loss_between_the_axes_counts():
    """A score that falls in one diagonal direction alone, with one turn alone."""

    def score(pose):
        x, y, _, yaw = (np.array(pose) - POSE) / SCALE
        return 90.0 - 5.0 * (min(-x, y) > 0.5 and yaw > 0.5)

    evaluator, found = ClosedForm(score), candidate(POSE, score)
    quick = worst_case(found, TOLERANCE, None, lambda pose: True, evaluator)
    assert quick.score == 90.0
    confirmed = confirmed_worst(found, quick, TOLERANCE, None, evaluator)
    assert confirmed.score == 85.0
    assert (confirmed.lost > 0).sum() == 1
    away = present(away_from_losses(POSE, TOLERANCE, confirmed, 0.0, 0.5))
    assert np.subtract(away, POSE) == pytest.approx([0.015, -0.015, 0.0, 0.0])


def test_what_a_thin_sample_understates_is_looked_at_with_every_orientation():
    """Two neighbours lose the same in the thin sample; all grasps tell them apart."""

    def thin(pose):
        return 90.0 - 0.1 * ((np.array(pose) - POSE)[3] > 0.0)

    class Sampled(ClosedForm):
        def evaluate(self, poses, q, *, above=ALWAYS, enough=NEVER, grid=COARSE):
            every = grid == DENSE
            self.formula = dense if every else thin
            return super().evaluate(poses, q, above=above, enough=enough, grid=grid)

    def dense(pose):
        x, _, _, yaw = (np.array(pose) - POSE) / SCALE
        return 90.0 - 1.0 * (yaw > 0.0 and x < -0.9) - 0.01 * (yaw > 0.0)

    evaluator, found = Sampled(thin), candidate(POSE, thin)
    quick = worst_case(found, TOLERANCE, None, lambda pose: True, evaluator)
    assert quick.score == 90.0
    confirmed = confirmed_worst(found, quick, TOLERANCE, None, evaluator)
    assert confirmed.score == pytest.approx(88.99)


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
