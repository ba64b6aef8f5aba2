"""The order of a list of grasps, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.parts import StageStatus, freeze

OUTSIDE_MAP: Final = 254
UNLIKE_MAP: Final = 253
INVALID: Final = 252
UNMATCHED: Final = {
    OUTSIDE_MAP: "outside_map",
    UNLIKE_MAP: "unlike_map",
    INVALID: "invalid",
}
"""States of grasps that the map says nothing about, beside those of test grasps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """The order of a list of grasps, and why. Rows are in supplied order.

    Attributes
    ----------
    order : int array, shape (n,)
        Supplied numbers of the grasps, best first; unreachable ones last in their
        supplied order.
    cost : array, shape (n,)
        J, or predicted seconds per pick; inf where unreachable.
    terms : array, shape (n, k)
        α φ3, β φ4, δ φ5, ε φ6 and the margins that were asked for, each with its
        weight, or seconds by stage; they add up to the cost. NaN where unreachable.
    term_names : tuple of str, length k
    status : uint8 array, shape (n,)
        :class:`reachmap.maps.records.Status` of the test grasp, or ``OUTSIDE_MAP``
        (too far from the test points), ``UNLIKE_MAP`` (no orientation is near enough)
        or ``INVALID`` (not finite, no direction, no rotation). Where the cost is of
        cycles, :class:`reachmap.maps.parts.StageStatus` of the stage that fails.
    test_grasp : int array, shape (n, 4)
        Layer, y, x, orientation of the nearest test grasp; -1 where invalid.
    distance : array, shape (n,)
        φ1 [m].
    angle : array, shape (n,)
        φ2 [rad]; between approach axes where the roll is free.
    roll_free : bool array, shape (n,)
    extrapolated : bool array, shape (n,)
        Beyond the outermost test points, where the map continues what it knows.
    probability : array, shape (n,)
        That planning reaches the grasp: calibrated where the ranker has a calibration,
        else the share reached around it; NaN where the map says nothing.
    orientation_wxyz : array, shape (n, 4)
        The tool orientation to use, in robot_base: R_test of the test grasp, turned
        about the approach by the roll that its best path takes, where roll is free.
    """

    order: IntArray
    cost: FloatArray
    terms: FloatArray
    term_names: tuple[str, ...]
    status: CodeArray
    test_grasp: IntArray
    distance: FloatArray
    angle: FloatArray
    roll_free: BoolArray
    extrapolated: BoolArray
    probability: FloatArray
    orientation_wxyz: FloatArray

    def __post_init__(self) -> None:
        freeze(self)

    def __repr__(self) -> str:
        return f"<Ranking: {len(self.order)} grasps, {self.reachable.sum()} reachable>"

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


def status_name(code: int) -> str:
    """Name of a status code as files have it, ``path_found`` for one."""
    return UNMATCHED.get(int(code)) or StageStatus(int(code)).name.lower()


def stable_order(cost: FloatArray, scores: ArrayLike | None = None) -> IntArray:
    """Order of costs, shape (n,): ties by score, higher first, then as supplied.

    Costs that differ by rounding only, beyond the twelfth decimal, tie. Infinite costs
    come last in supplied order whatever their scores; so do missing (NaN) scores among
    ties.
    """
    key = np.round(cost, 12)
    if scores is None:
        return np.argsort(key, kind="stable")
    given = np.asarray(scores, float)
    worst_first = np.where(np.isnan(given), -np.inf, given)
    second = np.where(np.isfinite(cost), -worst_first, 0.0)
    return np.lexsort((second, key))
