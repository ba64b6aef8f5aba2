"""Inverse kinematics for any arm: damped least squares from many starts.

A solution that is not found may still exist: the method is never complete.
"""

from __future__ import annotations

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.kinematics.least_squares import least_squares_many
from reachmap.core.kinematics.seeds import SeedTable, spread_points
from reachmap.core.kinematics.solutions import (
    Rows,
    can_be_within,
    distinct,
    in_blocks,
    joined,
    turned_into,
    wrapped,
)
from reachmap.core.kinematics.solvers.choice import Arm, Way

# Rows of the table of starts that are looked at, per start that is asked for: a fifth
# of them shares a cell with a nearer one.
_ROWS_PER_START = 1.25

# The first steps are made in single precision, for all starts; then those that have
# come together are one [rad or m], unless they are further from the pose.
_FIRST_STEPS = 3
_TOGETHER = 0.1
_NEAR = 0.1

# Rows that still miss by more [m or rad] are given up: of 400 poses each of HC10,
# M-430iA and xArm6 that lost no solution.
_HOPELESS = 0.4

# Other starts lead to the solutions of rows that take longer.
_LAST_STEPS = 30
_PATIENCE = 4

# Poses that are nearly met [m or rad], or met outside the limits only, get this many
# times the starts again, and steps that stay within the limits. A larger miss is that
# of a pose out of reach nearly always.
_HOPEFUL = 1e-3
_MORE = 4

# Arms of this few joints need no table.
_FEW_JOINTS = 2

# Poses per block, which bounds the memory.
_BLOCK = 1024


class NumericSolver:
    """Branches found from starts near the pose.

    Parameters
    ----------
    arm : Arm
        Its limits are the range of the starts; of a joint that turns further, one
        turn is used.
    """

    method = "numeric"
    complete = False

    def __init__(self, arm: Arm) -> None:
        self._arm, self._chain = arm, arm.chain
        self.tolerance = arm.tolerance
        middle, half = (arm.lower + arm.upper) / 2, (arm.upper - arm.lower) / 2
        half = np.where(arm.chain.is_revolute, np.minimum(half, np.pi), half)
        self._restarts = arm.spec.restarts
        self._table: SeedTable | None = None
        if arm.chain.dof > _FEW_JOINTS:
            self._table = SeedTable(arm.chain, middle, half)
        spread = 2.0 * spread_points(self._restarts, arm.chain.dof) - 1.0
        self._starts = middle + spread * half

    @property
    def approximation(self) -> str:
        """How solutions are sought."""
        if self._table is None:
            return (
                f"least squares from {self._restarts} starts{self._arm.rounding_note}"
            )
        return (
            f"least squares from up to {self._count} starts: the nearest of "
            f"{len(self._table)} configurations{self._arm.rounding_note}"
        )

    @property
    def _count(self) -> int:
        return int(np.ceil(_ROWS_PER_START * self._restarts))

    def branches(self, T: FloatArray) -> Rows:
        """Solutions that meet their poses, without limits and turns.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        """
        return in_blocks(self._block, T, _BLOCK, self._chain.dof)

    def _block(self, T: FloatArray) -> Rows:
        rows, missed = self._round(T, self._count)
        allowed = can_be_within(
            rows[0], self._arm.lower, self._arm.upper, self._chain.is_revolute
        )
        hopeful = missed < _HOPEFUL
        hopeful[rows[1][allowed]] = False
        again = np.flatnonzero(hopeful)
        if self._table is None or not len(again):
            return rows
        (Q, frame), _ = self._round(T[again], _MORE * self._count, within=True)
        return joined([rows, (Q, again[frame])], self._chain.dof)

    def _round(
        self, T: FloatArray, count: int, *, within: bool = False
    ) -> tuple[Rows, FloatArray]:
        """Solutions from a number of starts, and the smallest miss of each pose.

        With `within`, steps do not leave the limits.
        """
        Q, frame = self._near(T, count)
        limits = None
        if within:
            limits = self._arm.lower, self._arm.upper
            Q = turned_into(Q, *limits, self._chain.is_revolute)
        Q, residual = least_squares_many(
            self._chain,
            Q,
            T[frame],
            tolerance=1e-10,
            iterations=_LAST_STEPS,
            patience=_LAST_STEPS if within or self._table is None else _PATIENCE,
            limits=limits,
        )
        missed = np.full(len(T), np.inf)
        np.minimum.at(missed, frame, residual)
        good = residual <= self.tolerance
        rows = (wrapped(Q[good], self._chain.is_revolute), frame[good])
        return distinct(rows, self._chain.is_revolute), missed

    def _near(self, T: FloatArray, count: int) -> Rows:
        """Starts, those of the table a few steps nearer to their poses."""
        if self._table is None:
            frame = np.repeat(np.arange(len(T)), len(self._starts))
            return np.tile(self._starts, (len(T), 1)), frame
        Q, frame = self._table.starts(T, count)
        Q, residual = least_squares_many(
            self._chain,
            Q.astype(np.float32),
            T[frame],
            tolerance=1e-5,
            iterations=_FIRST_STEPS,
        )
        keep = _apart(wrapped(Q, self._chain.is_revolute), frame, residual)
        return Q[keep].astype(float), frame[keep]


def _apart(Q: FloatArray, frame: IntArray, residual: FloatArray) -> BoolArray:
    """Whether a row is worth more steps, and the nearest of those come together."""
    cells = np.floor(Q / _TOGETHER).astype(np.int64)
    key = frame.astype(np.int64)
    for column in cells.T:
        # An odd factor mixes the cells; what collides by chance is one in 2⁶⁰.
        key = key * np.int64(6364136223846793005) + column
    order = np.lexsort((residual, key))
    first = np.ones(len(key), bool)
    first[1:] = key[order][1:] != key[order][:-1]
    keep = np.zeros(len(key), bool)
    keep[order[first]] = True
    return (keep | (residual > _NEAR)) & (residual < _HOPELESS)


WAY = Way(rank=9, is_closed_form=False, offer=NumericSolver)
