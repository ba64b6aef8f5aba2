"""How far a bin may be off its pose before it is served much worse."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from reachmap._typing import FloatArray
from reachmap.placement.evaluator import Evaluator
from reachmap.placement.exact import Pose
from reachmap.placement.footprint import THIN
from reachmap.placement.region import AXES

DROP_POINTS = 5.0
SHIFTS_M = (0.01, 0.02, 0.03, 0.05, 0.07, 0.10, 0.15)
TURNS_RAD = tuple(np.radians((2.0, 5.0, 8.0, 12.0, 20.0, 30.0, 45.0)).tolist())


def margins(
    pose: Pose,
    q: FloatArray,
    is_possible: Callable[[Pose], bool],
    evaluator: Evaluator,
) -> dict[str, float]:
    """How far the bin can be off before the score drops by 5 points.

    Each direction has a short ladder of distances, whose last rung is the cap: 0.15 m
    and 45 degrees. The cap is tried first, then the ladder is bisected: what is found
    held, and the next rung did not. Scores are those of the thin sample, also the one
    that they are compared with.

    Parameters
    ----------
    pose : (x, y, z [m], yaw [rad])
    q : array, shape (dof,)
        Scan configuration, which stays as it is.
    is_possible : callable
        Whether the bin can stand at a pose; where it cannot, the margin ends.
    evaluator : Evaluator

    Returns
    -------
    dict
        ``+x``, ``-x``, … ``-yaw`` to metres or radians.
    """
    here = evaluator.evaluate([pose], q, grid=THIN)[0].score
    if here is None:
        return {}
    least = here.score - DROP_POINTS
    directions = [(k, sign) for k in range(4) for sign in (1.0, -1.0)]
    spans = {direction: (0, len(SHIFTS_M)) for direction in directions}
    while pending := [d for d, (low, high) in spans.items() if low < high]:
        # Rungs below `low` hold; the rung at `high` and those above do not.
        middle = {d: _next_rung(*spans[d]) for d in pending}
        poses = {d: _moved(pose, d, middle[d]) for d in pending}
        possible = [d for d in pending if is_possible(poses[d])]
        found = evaluator.evaluate(
            [poses[d] for d in possible],
            q,
            above=float(np.nextafter(least, -np.inf)),
            enough=least,
            grid=THIN,
        )
        holds = {
            d
            for d, e in zip(possible, found, strict=True)
            if e.score is not None and e.score.score >= least
        }
        for d in pending:
            low, high = spans[d]
            spans[d] = (middle[d] + 1, high) if d in holds else (low, middle[d])
    return {
        f"{'+' if sign > 0 else '-'}{AXES[k]}": _rung(k, low - 1)
        for (k, sign), (low, _) in spans.items()
    }


def _next_rung(low: int, high: int) -> int:
    """The last of the ladder first, then the middle."""
    return high - 1 if high - low == len(SHIFTS_M) else (low + high) // 2


def _rung(axis: int, index: int) -> float:
    ladder: Sequence[float] = TURNS_RAD if AXES[axis] == "yaw" else SHIFTS_M
    return ladder[index] if index >= 0 else 0.0


def _moved(pose: Pose, direction: tuple[int, float], index: int) -> Pose:
    axis, sign = direction
    values = list(pose)
    values[axis] += sign * _rung(axis, index)
    return (values[0], values[1], values[2], values[3])
