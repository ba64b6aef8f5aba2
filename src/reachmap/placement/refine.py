"""From a good pose to the best one near it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reachmap._typing import FloatArray
from reachmap.placement.candidates import Candidate
from reachmap.placement.evaluator import Evaluator
from reachmap.placement.exact import Pose
from reachmap.placement.places import rank_key
from reachmap.placement.region import AXES, Region

FIRST_STEPS = (0.04, 0.04, 0.04, np.radians(15.0))
ROUNDS = 4
HALVINGS = 1
MIN_GAIN_POINTS = 0.25
MOST_POSES = ROUNDS * 2 * len(AXES)


def refine(
    start: Candidate,
    q: FloatArray | None,
    region: Region,
    reason_against: Callable[[Pose], str],
    evaluator: Evaluator,
) -> Candidate:
    """Search around a pose, exactly: the best neighbour is the next start.

    Neighbours are one step away along one of x, y, z, yaw; when none is better, the
    step is halved, and when again none is, or after four rounds, the search ends. A
    neighbour whose bound is less than a quarter of a point above the score is not
    worth mapping.

    Parameters
    ----------
    start : Candidate
        With an exact score.
    q : array, shape (dof,), or None
        Scan configuration; see :meth:`Evaluator.evaluate`.
    region : Region
    reason_against : callable
        Why a pose is not feasible, "" if it is.
    evaluator : Evaluator

    Returns
    -------
    Candidate
        The best that was found, which may be the start.
    """
    best, steps, halvings = start, np.array(FIRST_STEPS), 0
    for _ in range(ROUNDS):
        poses = [
            pose
            for pose in _neighbours(best.pose, steps, region)
            if not reason_against(pose)
        ]
        assert best.score is not None
        found = evaluator.evaluate(poses, q, above=best.score.score + MIN_GAIN_POINTS)
        better = [
            Candidate(pose=pose, score=e.score, exact=True)
            for pose, e in zip(poses, found, strict=True)
            if e.score is not None
        ]
        champion = min([best, *better], key=rank_key)
        if champion is best:
            if halvings == HALVINGS:
                break
            steps, halvings = steps / 2, halvings + 1
        best = champion
    return best


def _neighbours(pose: Pose, steps: FloatArray, region: Region) -> list[Pose]:
    found: list[Pose] = []
    for k, name in enumerate(AXES):
        if region.fixed(name):
            continue
        for sign in (1.0, -1.0):
            moved = list(pose)
            moved[k] = round(moved[k] + sign * float(steps[k]), 9)
            if not region.outside(np.array(moved)):
                found.append((moved[0], moved[1], moved[2], moved[3]))
    return found
