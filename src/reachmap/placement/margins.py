"""How far a bin may be off its pose before its score drops."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from reachmap._typing import FloatArray
from reachmap.placement.mapped.evaluator import Evaluator
from reachmap.placement.mapped.exact import Pose
from reachmap.placement.mapped.sample import THIN
from reachmap.placement.predicted.region import AXES

# Points of the score that a designer would notice.
DROP_POINTS = 5.0
# From what a fixture holds to what a forklift driver does; finer where it matters.
SHIFTS_M = (0.01, 0.02, 0.03, 0.05, 0.07, 0.10, 0.15)
TURNS_RAD = tuple(np.radians((2.0, 5.0, 8.0, 12.0, 20.0, 30.0, 45.0)).tolist())
# The pose itself; in each direction the last rung, then a bisection of the others.
MARGIN_POSES = 1 + 2 * len(AXES) * (1 + int(np.log2(len(SHIFTS_M))) + 1)
Direction = tuple[int, float]


def margins(
    pose: Pose,
    q: FloatArray,
    is_possible: Callable[[Pose], bool],
    evaluator: Evaluator,
) -> dict[str, float]:
    """How far the bin can be off before the score drops by 5 points.

    Each direction has a short ladder of distances, whose last rung is the cap: 0.15 m
    and 45 degrees. It is cut off where the bin cannot stand any more. What is left is
    bisected, its last rung first: what is found held, and the next rung did not.
    Scores are those of the thin sample, also the one that they are compared with.

    Parameters
    ----------
    pose : (x, y, z [m], yaw [rad])
    q : array, shape (dof,)
        Scan configuration, which stays as it is.
    is_possible : callable
        Whether the bin can stand at a pose, with the arm at the scan configuration.
    evaluator : Evaluator

    Returns
    -------
    dict
        ``+x``, ``-x``, … ``-yaw`` to metres or radians; empty where the score cannot
        drop that far.
    """
    evaluator.expect(MARGIN_POSES)
    here = evaluator.evaluate([pose], q, grid=THIN)[0].score
    if here is None or here.score <= DROP_POINTS:
        return {}
    least = here.score - DROP_POINTS
    directions = [(k, sign) for k in range(len(AXES)) for sign in (1.0, -1.0)]
    # Rungs below the first number hold; the rung at the second does not.
    spans = {d: (0, _possible_rungs(pose, d, is_possible)) for d in directions}
    rung = {d: high - 1 for d, (_, high) in spans.items()}
    evaluator.expect(sum(high.bit_length() + 1 for _, high in spans.values() if high))
    while pending := [d for d, (low, high) in spans.items() if low < high]:
        found = evaluator.evaluate(
            [_moved(pose, d, rung[d]) for d in pending],
            q,
            above=float(np.nextafter(least, -np.inf)),
            enough=least,
            grid=THIN,
        )
        for d, evaluation in zip(pending, found, strict=True):
            low, high = spans[d]
            holds = evaluation.score is not None and evaluation.score.score >= least
            low, high = (rung[d] + 1, high) if holds else (low, rung[d])
            spans[d], rung[d] = (low, high), (low + high) // 2
        # A bisection of n rungs takes as many steps as n has bits.
        evaluator.expect(sum((high - low).bit_length() for low, high in spans.values()))
    return {
        f"{'+' if sign > 0 else '-'}{AXES[k]}": _rung(k, low - 1)
        for (k, sign), (low, _) in spans.items()
    }


def _possible_rungs(
    pose: Pose, direction: Direction, is_possible: Callable[[Pose], bool]
) -> int:
    """How many rungs the bin can be moved by, one after the other."""
    for index in range(len(SHIFTS_M)):
        if not is_possible(_moved(pose, direction, index)):
            return index
    return len(SHIFTS_M)


def _rung(axis: int, index: int) -> float:
    ladder: Sequence[float] = TURNS_RAD if AXES[axis] == "yaw" else SHIFTS_M
    return ladder[index] if index >= 0 else 0.0


def _moved(pose: Pose, direction: Direction, index: int) -> Pose:
    axis, sign = direction
    values = list(pose)
    values[axis] += sign * _rung(axis, index)
    return (values[0], values[1], values[2], values[3])
