"""Inverse kinematics for any arm: damped least squares from many starts.

A solution that is not found may still exist: the method is never complete.
"""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.chain import SerialChain
from reachmap.core.ik_newton import ACCEPTED, refine_many
from reachmap.core.ik_rows import Rows, distinct, joined, wrapped

_ITERATIONS = 60

# Starts per block, which bounds the memory.
_BLOCK = 4096


class NumericSolver:
    """Branches found from a fixed set of starts.

    Parameters
    ----------
    chain : SerialChain
    lower, upper : array, shape (dof,)
        Range of the starts; of a joint that turns further, one turn is used.
    restarts : int
        Number of starts for each pose.
    """

    method = "numeric"
    complete = False

    def __init__(
        self, chain: SerialChain, lower: FloatArray, upper: FloatArray, restarts: int
    ) -> None:
        self._chain = chain
        half = (upper - lower) / 2
        half = np.where(chain.is_revolute, np.minimum(half, np.pi), half)
        spread = 2.0 * _spread_points(restarts, chain.dof) - 1.0
        self._starts = (lower + upper) / 2 + spread * half

    def branches(self, T: FloatArray) -> Rows:
        """Solutions that meet their poses, without limits and turns.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        """
        count = len(self._starts)
        per_block = max(1, _BLOCK // count)
        tables = []
        for start in range(0, len(T), per_block):
            goals = T[start : start + per_block]
            frame = np.repeat(np.arange(len(goals)), count)
            Q, residual = refine_many(
                self._chain,
                np.tile(self._starts, (len(goals), 1)),
                goals[frame],
                tolerance=1e-11,
                iterations=_ITERATIONS,
            )
            good = residual <= ACCEPTED
            rows = (wrapped(Q[good], self._chain.is_revolute), frame[good] + start)
            tables.append(distinct(rows, self._chain.is_revolute))
        return joined(tables, self._chain.dof)


def _spread_points(count: int, dimension: int) -> FloatArray:
    """Evenly spread points of the unit cube, shape (count, dimension).

    An additive recurrence with powers of the generalised golden ratio: without
    random numbers every pose gets the same starts in every run, and they leave
    smaller gaps than random ones.
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (dimension + 1))
    steps = ratio ** -np.arange(1.0, dimension + 1)
    return np.asarray((0.5 + np.arange(count)[:, None] * steps) % 1.0)
