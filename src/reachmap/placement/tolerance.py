"""Worst case of a pose when the bin is slightly misplaced."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.placement.mapped.candidates import Candidate
from reachmap.placement.mapped.evaluator import Evaluation, Evaluator
from reachmap.placement.mapped.exact import Pose
from reachmap.placement.mapped.sample import DENSE, QUICK, THIN

# A pose is moved away from what its neighbours miss by this much more than the
# tolerance, so that what is found there has some room left.
ROOM = 5.0 / 3.0
# Lost by a neighbour, this is the sample's noise, and no more is looked for.
NOISE_POINTS = 0.5
# Neighbours that are looked at with every orientation, of each sample. In the deep
# conveyor cell four lose one grasp of the thin sample, two of them a third of a point.
SUSPECTS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """How far the bin may be off in the plane [m], and about the vertical [rad].

    Where ``floats`` is set, the shift goes for its height as well: nothing says how
    high what it will stand on is.
    """

    shift_m: float
    turn_rad: float
    floats: bool = False

    @property
    def is_none(self) -> bool:
        """Whether the pose itself is all that counts."""
        return self.shift_m == 0.0 and self.turn_rad == 0.0

    def offsets(self) -> FloatArray:
        """Poses on the edge of what is allowed, less the pose, shape (n, 4).

        Each direction of the plane with one turn or the other: the corners of the
        neighbourhood, where reachability falls off first. A bin that floats may be off
        in height, too.
        """
        unit = [(1.0, 0.0, 0.0, 1.0), (-1.0, 0.0, 0.0, -1.0)]
        if self.shift_m:
            unit += [(0.0, 1.0, 0.0, -1.0), (0.0, -1.0, 0.0, 1.0)]
        if self.floats and self.shift_m:
            unit += [(0.0, 0.0, 1.0, 0.0), (0.0, 0.0, -1.0, 0.0)]
        return np.array(unit) * self.scale

    @property
    def scale(self) -> FloatArray:
        """What is allowed of x, y, z [m] and yaw [rad], shape (4,)."""
        return np.array([*[self.shift_m] * 3, self.turn_rad])

    def others(self) -> FloatArray:
        """Poses on the edge that :meth:`offsets` leaves out, less the pose, (n, 4).

        The directions of the plane with the other turn, and those between them with
        either. Of a tolerance without shift, the offsets themselves.
        """
        straight = self.offsets()
        straight = straight[straight[:, 2] == 0.0] * (1.0, 1.0, 1.0, -1.0)
        if not self.shift_m:
            return np.asarray(straight)
        turns = np.array([1.0, -1.0])
        angle, turn = np.meshgrid(np.radians([45, 135, 225, 315]), turns, indexing="ij")
        unit = [np.cos(angle), np.sin(angle), np.zeros(angle.shape), turn]
        between = np.stack(unit, axis=-1).reshape(-1, 4) * self.scale
        return np.vstack([straight, between])

    def steps(self) -> FloatArray:
        """One step along each axis either way, with some room, shape (n, 4)."""
        axes = (0, 1, 2, 3) if self.floats else (0, 1, 3)
        unit = np.vstack([np.eye(4)[list(axes)], -np.eye(4)[list(axes)]])
        return np.unique(ROOM * unit * self.scale, axis=0)


EXACT = Tolerance(shift_m=0.0, turn_rad=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstCase:
    """The least score under a tolerance.

    Attributes
    ----------
    score : float
        [percent].
    offsets : array, shape (n, 4)
        What was looked at, less the pose itself.
    lost : array, shape (n,)
        What each of the offsets costs against the pose itself [points].
    """

    score: float
    offsets: FloatArray
    lost: FloatArray


def worst_case(
    candidate: Candidate,
    tolerance: Tolerance,
    q: FloatArray | None,
    is_possible: Callable[[Pose], bool],
    evaluator: Evaluator,
) -> WorstCase:
    """Least score of a pose and of its neighbours.

    Neighbours are mapped with the quick sample and compared with the pose itself mapped
    with it. Where the bin cannot stand the score is 0, and no other is looked at.

    Parameters
    ----------
    candidate : Candidate
        With an exact score.
    tolerance : Tolerance
    q : array, shape (dof,), or None
        Scan configuration; see :meth:`Evaluator.evaluate`.
    is_possible : callable
        Whether the bin can stand at a pose.
    evaluator : Evaluator
    """
    assert candidate.score is not None
    own, offsets = candidate.score.score, tolerance.offsets()
    # Whether the bin fits somewhere is cheap to check, so more poses are checked.
    every = np.vstack([offsets, tolerance.others()])
    possible = [is_possible(moved_by(candidate.pose, offset)) for offset in every]
    if not all(possible):
        return WorstCase(score=0.0, offsets=every, lost=np.where(possible, 0.0, own))
    poses = [moved_by(candidate.pose, offset) for offset in offsets]
    evaluator.expect(1 + len(poses))
    (here,) = evaluator.evaluate([candidate.pose], q, grid=QUICK)
    least = here.score.score if here.score is not None else own
    found = evaluator.evaluate(poses, q, enough=least - NOISE_POINTS, grid=QUICK)
    lost = np.array(
        [own if e.score is None else max(least - e.score.score, 0.0) for e in found]
    )
    # No more was looked for where the rest is the sample's noise.
    lost[lost <= NOISE_POINTS] = 0.0
    score = max(own - float(lost.max()), 0.0)
    return WorstCase(score=score, offsets=offsets, lost=lost)


def confirmed_worst(
    candidate: Candidate,
    worst: WorstCase,
    tolerance: Tolerance,
    q: FloatArray | None,
    evaluator: Evaluator,
) -> WorstCase:
    """Least score of a pose and of its neighbours, from more test grasps.

    Few grasps hide points that a neighbour loses. The directions that were left out are
    looked at with more grasps; where something is lost, there or in those before, the
    worst of them have every orientation.

    Parameters
    ----------
    candidate : Candidate
        With an exact score.
    worst : WorstCase
        Of the candidate, from the quick sample; the bin can stand at all neighbours.
    tolerance : Tolerance
    q : array, shape (dof,), or None
        Scan configuration; see :meth:`Evaluator.evaluate`.
    evaluator : Evaluator
    """
    assert candidate.score is not None
    own, others = candidate.score.score, tolerance.others()
    poses = [moved_by(candidate.pose, offset) for offset in others]
    evaluator.expect(len(poses) + 1 + 2 * SUSPECTS)
    here = _score(evaluator.evaluate([candidate.pose], q, grid=THIN)[0])
    found = evaluator.evaluate(poses, q, enough=here, grid=THIN)
    lost = np.array([max(here - _score(evaluation), 0.0) for evaluation in found])
    suspects = np.concatenate(
        [_suspects(worst.lost), len(worst.lost) + _suspects(lost)]
    )
    offsets, lost = np.vstack([worst.offsets, others]), np.append(worst.lost, lost)
    poses = [moved_by(candidate.pose, offsets[suspect]) for suspect in suspects]
    dense = evaluator.evaluate(poses, q, enough=own, grid=DENSE)
    lost[suspects] = [max(own - _score(evaluation), 0.0) for evaluation in dense]
    return WorstCase(score=own - float(lost.max()), offsets=offsets, lost=lost)


def _suspects(lost: FloatArray) -> IntArray:
    """Rows that lose most, a few at most: at least half of what the worst loses."""
    order = np.argsort(-lost, kind="stable")[:SUSPECTS]
    return np.asarray(order[lost[order] > lost.max(initial=0.0) / 2])


def _score(evaluation: Evaluation) -> float:
    return 0.0 if evaluation.score is None else evaluation.score.score


def away_from_losses(
    pose: Pose, tolerance: Tolerance, worst: WorstCase, slack: float, by: float = ROOM
) -> Pose | None:
    """A pose further from where the score is lost; None where nothing is.

    Parameters
    ----------
    pose : (x, y, z [m], yaw [rad])
    tolerance : Tolerance
    worst : WorstCase
    slack : float
        A loss that does not matter [points].
    by : float
        How far, in tolerances.
    """
    offsets, bad = worst.offsets, worst.lost > slack
    if not bad.any() or bad.all():
        return None
    push = -(worst.lost[bad][:, None] * offsets[bad]).sum(axis=0)
    scale = tolerance.scale
    relative = np.divide(push, scale, out=np.zeros(4), where=scale > 0)
    if np.abs(relative[:3]).max() > 1e-9:
        # Each offset has a turn of its own, of which a loss to its shift says nothing.
        relative[3] = 0.0
    largest = float(np.abs(relative).max())
    if largest < 1e-9:
        return None
    step = np.where(np.abs(relative) > largest / 2, np.sign(relative), 0.0)
    return moved_by(pose, by * scale * step)


def moved_by(pose: Pose, offset: FloatArray | Sequence[float]) -> Pose:
    """A pose and an offset of it, rounded so that equal ones are found again."""
    x, y, z, yaw = (round(float(a + b), 9) for a, b in zip(pose, offset, strict=True))
    return (x, y, z, yaw)
