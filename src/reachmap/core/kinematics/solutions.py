"""Tables of solutions: rows of joint positions, each with the frame it belongs to.

A table is a pair of arrays, ``Q`` of shape (m, dof) and ``frame`` of shape (m,), the
rows of one frame side by side.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray

Rows = tuple[FloatArray, IntArray]

# Closer rows are one solution: near a fold of the arm two branches meet, and there
# a pose accuracy of 1e-10 is a joint accuracy of 1e-5 only.
SAME_SOLUTION_RAD = 1e-5

# Angles this far outside a limit are rounding; they are moved on to the limit.
_LIMIT_SLACK = 1e-9

_TURN = 2.0 * np.pi


def wrapped(Q: FloatArray, is_revolute: BoolArray | np.bool_) -> FloatArray:
    """Angles brought to [-π, π]; prismatic joints stay."""
    return Q - np.where(is_revolute, _TURN, 0.0) * np.round(Q * (1.0 / _TURN))


def angular_distance(
    difference: FloatArray, is_revolute: BoolArray | np.bool_
) -> FloatArray:
    """Size of joint differences, whole turns of revolute joints not counted."""
    return np.abs(wrapped(difference, is_revolute))


def joined(tables: list[Rows], dof: int) -> Rows:
    """One table of several, in order of frames; earlier tables come first."""
    Q = np.concatenate([np.zeros((0, dof)), *(table[0] for table in tables)])
    frame = np.concatenate([np.zeros(0, np.int64), *(table[1] for table in tables)])
    order = np.argsort(frame, kind="stable")
    return Q[order], frame[order]


def in_blocks(
    solve: Callable[[FloatArray], Rows], T: FloatArray, size: int, dof: int
) -> Rows:
    """Solve poses (n, 4, 4) a block at a time, which bounds the memory."""
    tables = []
    for start in range(0, len(T), size):
        Q, frame = solve(T[start : start + size])
        tables.append((Q, frame + start))
    return joined(tables, dof)


def distinct(rows: Rows, is_revolute: BoolArray) -> Rows:
    """Drop rows that repeat an earlier row of the same frame."""
    Q, frame = rows
    keep = np.ones(len(Q), bool)
    for lag in range(1, len(Q)):
        same = np.flatnonzero(frame[lag:] == frame[:-lag])
        if not len(same):
            break
        difference = angular_distance(Q[same + lag] - Q[same], is_revolute)
        repeated = np.maximum.reduce(difference, axis=1) < SAME_SOLUTION_RAD
        keep[same[repeated] + lag] = False
    return Q[keep], frame[keep]


def within_limits(
    rows: Rows,
    lower: FloatArray,
    upper: FloatArray,
    is_revolute: BoolArray,
    *,
    windings: bool = True,
    near: FloatArray | None = None,
) -> Rows:
    """Add whole turns to revolute joints, keep what lies within the limits.

    Parameters
    ----------
    rows : tuple
        Table with angles of any turn.
    lower, upper : array, shape (dof,)
    is_revolute : array of bool, shape (dof,)
    windings : bool
        All turns, up to 2⁶ rows for each row of a six-axis arm with limits ±2π;
        otherwise one, the nearest to `near`.
    near : array, shape (dof,), optional
        Default: the middle of the limits.

    Returns
    -------
    tuple
        Table in the order of the given one.
    """
    Q, frame = rows
    low, high = lower - _LIMIT_SLACK, upper + _LIMIT_SLACK
    first, last = np.ceil((low - Q) / _TURN), np.floor((high - Q) / _TURN)
    between = np.greater_equal(Q, low) & np.less_equal(Q, high)
    inside = np.where(is_revolute, last >= first, between)
    keep = inside.all(axis=1)
    Q, frame = Q[keep], frame[keep]
    first = np.where(is_revolute, first[keep], 0.0)
    last = np.where(is_revolute, last[keep], 0.0)
    if windings:
        Q, frame = _all_turns(Q, frame, first, last)
    else:
        middle = (lower + upper) / 2 if near is None else near
        nearest = np.round((middle - Q) / _TURN)
        Q = Q + _TURN * np.clip(nearest, first, last)
    return np.clip(Q, lower, upper), frame


def turned_into(
    Q: FloatArray, lower: FloatArray, upper: FloatArray, is_revolute: BoolArray
) -> FloatArray:
    """Turn of each angle nearest to the middle of its limits, cut to the limits."""
    turns = np.round(((lower + upper) / 2 - Q) / _TURN)
    return np.clip(np.where(is_revolute, Q + _TURN * turns, Q), lower, upper)


def can_be_within(
    Q: FloatArray, lower: FloatArray, upper: FloatArray, is_revolute: BoolArray
) -> BoolArray:
    """Whether some turn of each row lies within the limits, shape (m,)."""
    turns = np.where(is_revolute, np.ceil((lower - _LIMIT_SLACK - Q) / _TURN), 0.0)
    moved = Q + _TURN * turns
    return np.asarray(
        ((moved >= lower - _LIMIT_SLACK) & (moved <= upper + _LIMIT_SLACK)).all(axis=1)
    )


def _all_turns(
    Q: FloatArray, frame: IntArray, first: FloatArray, last: FloatArray
) -> Rows:
    choices = (last - first + 1).astype(np.int64)
    copies = choices.prod(axis=1)
    row = np.repeat(np.arange(len(Q)), copies)
    # Number of each copy within its row, read as digits: one per joint.
    number = np.arange(len(row)) - np.repeat(np.cumsum(copies) - copies, copies)
    Q = Q[row]
    for k in range(Q.shape[1]):
        number, digit = np.divmod(number, choices[row, k])
        Q[:, k] += _TURN * (first[row, k] + digit)
    return Q, frame[row]
