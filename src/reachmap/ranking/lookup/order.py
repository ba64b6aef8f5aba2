"""The order of a list of grasps, with the reason of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.records import freeze

OUTSIDE_MAP: Final = 254


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """The order of a list of grasps, and why. Rows are in supplied order.

    Attributes
    ----------
    order : int array, shape (n,)
        Supplied numbers of the grasps, best first; unreachable ones last in their
        supplied order.
    cost : array, shape (n,)
        J; inf where unreachable.
    terms : array, shape (n, 4)
        α φ3, β φ4, δ φ5, ε φ6, which add up to J; NaN where unreachable.
    status : uint8 array, shape (n,)
        :class:`reachmap.maps.records.Status` of the test grasp, or ``OUTSIDE_MAP``.
    test_grasp : int array, shape (n, 4)
        Layer, y, x, orientation of the nearest test grasp.
    distance : array, shape (n,)
        φ1 [m].
    angle : array, shape (n,)
        φ2 [rad]; between approach axes where the roll is free.
    roll_free : bool array, shape (n,)
    orientation_wxyz : array, shape (n, 4)
        R_test of the test grasp in robot_base: the tool orientation to use.
    """

    order: IntArray
    cost: FloatArray
    terms: FloatArray
    status: CodeArray
    test_grasp: IntArray
    distance: FloatArray
    angle: FloatArray
    roll_free: BoolArray
    orientation_wxyz: FloatArray

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def rank(self) -> IntArray:
        """Rank of each grasp, from 1, in supplied order; shape (n,)."""
        rank = np.empty(len(self.order), np.int64)
        rank[self.order] = np.arange(1, len(self.order) + 1)
        return rank

    @property
    def reachable(self) -> BoolArray:
        """Where the cost is finite, shape (n,)."""
        return np.isfinite(self.cost)


def stable_order(cost: FloatArray, scores: FloatArray | None = None) -> IntArray:
    """Order of costs, shape (n,): ties by score, higher first, then as supplied.

    Costs that differ by rounding only, beyond the twelfth decimal, tie. Infinite costs
    come last in supplied order whatever their scores; so do missing (NaN) scores among
    ties.
    """
    key = np.round(cost, 12)
    if scores is None:
        return np.argsort(key, kind="stable")
    worst_first = np.where(np.isnan(scores), -np.inf, scores)
    second = np.where(np.isfinite(cost), -worst_first, 0.0)
    return np.lexsort((second, key))
