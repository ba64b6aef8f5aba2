"""Inverse kinematics of seven-axis arms: one joint on a grid, EAIK for the rest.

The solutions of a pose form curves; the grid takes points from them. A pose that has
none on the grid may still be reachable: the method is not complete.
"""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.kinematics.analytic import MET, EaikRows, can_use_eaik
from reachmap.core.kinematics.numeric import ACCEPTED, matrix_difference, refine_many
from reachmap.core.kinematics.solutions import (
    Rows,
    can_be_within,
    distinct,
    joined,
    turned_into,
    wrapped,
)
from reachmap.core.robot.chain import SerialChain

# Rows per pose from which a solution is sought where the grid has none.
_SEEDS = 8

# Frames per block, which bounds the memory.
_BLOCK = 256


class RedundantSolver:
    """Branches for each value of one joint.

    Parameters
    ----------
    chain : SerialChain
        Seven revolute joints.
    lower, upper : array, shape (7,)
    joint : int
        Index of the joint that is sampled.
    samples : int
        Number of values, from limit to limit.
    """

    method = "redundant-grid"
    complete = False

    def __init__(
        self,
        chain: SerialChain,
        lower: FloatArray,
        upper: FloatArray,
        joint: int,
        samples: int,
    ) -> None:
        self._chain, self._lower, self._upper = chain, lower, upper
        self.joint = joint
        self.values = [
            value
            for value in _grid(lower[joint], upper[joint], samples).tolist()
            if can_use_eaik(chain, [(joint, value)])
        ]
        self._rows = [EaikRows(chain, [(joint, value)]) for value in self.values]

    def branches(self, T: FloatArray) -> Rows:
        """Solutions that meet their poses, some turn of them within the limits.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        """
        tables = []
        for start in range(0, len(T), _BLOCK):
            Q, frame = self._block(T[start : start + _BLOCK])
            tables.append((Q, frame + start))
        return joined(tables, self._chain.dof)

    def _block(self, T: FloatArray) -> Rows:
        raw = joined([rows(T) for rows in self._rows], self._chain.dof)
        Q, frame = self._allowed(raw)
        met = matrix_difference(T[frame], self._chain.forward_many(Q)) <= MET
        solved = distinct((Q[met], frame[met]), self._chain.is_revolute)
        counts = np.bincount(solved[1], minlength=len(T))
        more = self._between_samples(raw, T, np.flatnonzero(counts == 0))
        return joined([solved, more], self._chain.dof)

    def _between_samples(self, raw: Rows, T: FloatArray, missing: IntArray) -> Rows:
        """Solutions near the best rows of the grid, with the sampled joint free.

        Near the edge of reach the curves of solutions are shorter than the grid's
        spacing.
        """
        keep = np.isin(raw[1], missing)
        frame = raw[1][keep]
        Q = turned_into(raw[0][keep], self._lower, self._upper, self._chain.is_revolute)
        residual = matrix_difference(T[frame], self._chain.forward_many(Q))
        order = np.lexsort((residual, frame))
        Q, frame = Q[order], frame[order]
        counts = np.bincount(frame, minlength=len(T))
        place = np.arange(len(Q)) - np.repeat(np.cumsum(counts) - counts, counts)
        Q, frame = Q[place < _SEEDS], frame[place < _SEEDS]
        Q, missed = refine_many(
            self._chain, Q, T[frame], tolerance=1e-11, iterations=30
        )
        good = missed <= ACCEPTED
        rows = self._allowed((wrapped(Q[good], self._chain.is_revolute), frame[good]))
        return distinct(rows, self._chain.is_revolute)

    def _allowed(self, rows: Rows) -> Rows:
        keep = can_be_within(rows[0], self._lower, self._upper, self._chain.is_revolute)
        return rows[0][keep], rows[1][keep]


def _grid(lower: float, upper: float, samples: int) -> FloatArray:
    """Values from limit to limit, or once around if the joint turns further."""
    if samples == 1:
        return np.array([(lower + upper) / 2])
    once_around = 2.0 * np.pi * (1.0 - 1.0 / samples)
    return np.linspace(lower, lower + min(upper - lower, once_around), samples)
