"""Stands in for the workers that score poses: a formula instead of a scene.

from tests.support.closed_form_evaluator import ClosedForm
"""

from __future__ import annotations

from reachmap.placement.mapped.evaluator import Evaluation, Evaluator
from reachmap.placement.mapped.exact import ALWAYS, NEVER, PoseScore
from reachmap.placement.mapped.sample import COARSE


class ClosedForm(Evaluator):
    """Scores poses by a formula, and keeps to what an evaluator promises.

    Parameters
    ----------
    formula : callable
        Pose to score [percent], or to a text: why there is no scan configuration.

    Attributes
    ----------
    asked : list of pose
        Every pose that was looked at, in order; a score is memoized.
    expected : list of (int, int)
        What was announced: poses looked at by then, and how many more at most.
    """

    def __init__(self, formula):
        self.formula = formula
        self.asked = []
        self.expected = []
        self._scored = {}

    def expect(self, poses):
        """Keep what was announced."""
        self.expected.append((len(self.asked), poses))

    def evaluate(self, poses, q, *, above=ALWAYS, enough=NEVER, grid=COARSE):
        """Score poses; those not above a score have none."""
        least = above if isinstance(above, list) else [above] * len(poses)
        return [
            self._scored.get((grid, pose)) or self._one(pose, bound, grid)
            for pose, bound in zip(poses, least, strict=True)
        ]

    def _one(self, pose, above, grid):
        self.asked.append(pose)
        value = self.formula(pose)
        if isinstance(value, str):
            return Evaluation(bound=0.0, score=None, reason=value)
        if value <= above:
            return Evaluation(bound=value, score=None)
        score = PoseScore(
            score=value, worst_point=value, reachable_share=100.0, path_length_rad=1.0
        )
        self._scored[grid, pose] = Evaluation(bound=value, score=score)
        return self._scored[grid, pose]
