"""Inverse kinematics for any arm: damped least squares from many starts.

A solution that is not found may still exist: the method is never complete.
"""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.kinematics.refine import refine_many
from reachmap.core.kinematics.solutions import Rows, distinct, joined, wrapped
from reachmap.core.kinematics.solvers.arm import Arm, Way

_ITERATIONS = 60

# Starts per block, which bounds the memory.
_SEEDS_PER_BLOCK = 4096


class NumericSolver:
    """Branches found from a fixed set of starts.

    Parameters
    ----------
    arm : Arm
        Its limits are the range of the starts; of a joint that turns further, one
        turn is used.
    """

    method = "numeric"
    complete = False

    def __init__(self, arm: Arm) -> None:
        self._chain, self.tolerance = arm.chain, arm.tolerance
        half = (arm.upper - arm.lower) / 2
        half = np.where(arm.chain.is_revolute, np.minimum(half, np.pi), half)
        spread = 2.0 * _spread_points(arm.spec.restarts, arm.chain.dof) - 1.0
        self._starts = (arm.lower + arm.upper) / 2 + spread * half

    @property
    def approximation(self) -> str:
        """How solutions are sought."""
        return f"least squares from {len(self._starts)} starts"

    def branches(self, T: FloatArray) -> Rows:
        """Solutions that meet their poses, without limits and turns.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        """
        count = len(self._starts)
        per_block = max(1, _SEEDS_PER_BLOCK // count)
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
            good = residual <= self.tolerance
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


WAY = Way(rank=9, is_closed_form=False, offer=NumericSolver)
