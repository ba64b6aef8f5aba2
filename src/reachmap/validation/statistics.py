"""Statistics that compare predictions with outcomes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.maps.summary.statistics import wilson_interval


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """A share of a count with its Wilson 95 % interval, as fractions; NaN of none."""

    hits: int
    total: int
    share: float
    low: float
    high: float


def share_of(hits: int, total: int) -> Share:
    """Make a share of a count."""
    if total == 0:
        nan = float("nan")
        return Share(hits=0, total=0, share=nan, low=nan, high=nan)
    low, high = wilson_interval(np.array(float(hits)), np.array(float(total)))
    return Share(
        hits=hits, total=total, share=hits / total, low=float(low), high=float(high)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Confusion:
    """Predictions against outcomes. Grasps outside the map are counted separately.

    Attributes
    ----------
    true_positive, false_positive, false_negative, true_negative : int
        Positive: the map gives a finite cost. True: planning agrees.
    outside_reached, outside_missed : int
        Grasps that the map says nothing about.
    """

    true_positive: int
    false_positive: int
    false_negative: int
    true_negative: int
    outside_reached: int
    outside_missed: int

    @property
    def precision(self) -> Share:
        """Of the grasps called reachable, those that were reached."""
        return share_of(self.true_positive, self.true_positive + self.false_positive)

    @property
    def recall(self) -> Share:
        """Of the grasps that were reached, those called reachable."""
        return share_of(self.true_positive, self.true_positive + self.false_negative)

    @property
    def false_positive_rate(self) -> Share:
        """Of the grasps that were not reached, those called reachable."""
        return share_of(self.false_positive, self.false_positive + self.true_negative)

    @property
    def agreement(self) -> Share:
        """Of all grasps inside the map, those predicted rightly."""
        right = self.true_positive + self.true_negative
        return share_of(right, right + self.false_positive + self.false_negative)


def confusion_of(
    predicted: BoolArray, reached: BoolArray, outside: BoolArray
) -> Confusion:
    """Count predictions by their outcome, arrays of shape (n,)."""

    def count(mask: BoolArray) -> int:
        return int(np.count_nonzero(mask))

    inside = ~outside
    return Confusion(
        true_positive=count(inside & predicted & reached),
        false_positive=count(inside & predicted & ~reached),
        false_negative=count(inside & ~predicted & reached),
        true_negative=count(inside & ~predicted & ~reached),
        outside_reached=count(outside & reached),
        outside_missed=count(outside & ~reached),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RankCorrelation:
    """Agreement of two orders: Spearman's ρ and Kendall's τ-b, NaN without spread."""

    count: int
    spearman: float
    kendall: float


def rank_correlation(a: FloatArray, b: FloatArray) -> RankCorrelation:
    """Correlate the ranks of two arrays (n,) over the rows where both are finite."""
    both = np.isfinite(a) & np.isfinite(b)
    a, b = a[both], b[both]
    spearman = kendall = math.nan
    if len(a) > 1 and np.ptp(a) > 0 and np.ptp(b) > 0:
        spearman = float(stats.spearmanr(a, b).statistic)
        kendall = float(stats.kendalltau(a, b).statistic)
    return RankCorrelation(count=len(a), spearman=spearman, kendall=kendall)


def expected_calls(chance: FloatArray, order: IntArray, successes: int = 1) -> float:
    """Planner calls until enough succeed, one call per grasp in the given order.

    Parameters
    ----------
    chance : array, shape (n,)
        Chance that a call for a grasp succeeds, in supplied order.
    order : int array, shape (m,)
        Grasps in the order in which they are tried.
    successes : int

    Returns
    -------
    float
        Expected number of calls; all of the list where the successes do not suffice.

    Examples
    --------
    >>> expected_calls(np.array([0.0, 0.5, 1.0]), np.array([0, 1, 2]))
    2.5
    """
    # have[k]: chance of k successes so far; a call is made while k < successes.
    have = np.zeros(successes)
    have[0] = 1.0
    calls = 0.0
    for p in chance[order]:
        calls += float(have.sum())
        have[1:] = have[1:] * (1.0 - p) + have[:-1] * p
        have[0] *= 1.0 - p
    return calls
