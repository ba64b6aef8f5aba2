"""Whole cycles as predicted by the map against re-planned ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.parts import freeze
from reachmap.ranking.answers.ranked_list import RankedList
from reachmap.ranking.lookup.costs import OUTSIDE_MAP
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.ranking.lookup.settings import EVEN, RankSettings
from reachmap.validation.cycle_planning import CycleResults
from reachmap.validation.statistics import (
    Confusion,
    RankCorrelation,
    confusion_of,
    rank_correlation,
)

CYCLE_ORDERS: Final = ("supplied", "re-ranked", "by seconds")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JudgedCycles:
    """Cycles over one list of n grasps, in supplied order.

    Attributes
    ----------
    predicted_s : array, shape (n,)
        Seconds of a pick by the map; inf where it has no whole cycle.
    outside : bool array, shape (n,)
    found : bool array, shape (n,)
        Where an attempt found a whole cycle.
    status : uint8 array, shape (n,)
        :class:`~reachmap.maps.parts.StageStatus` of the first attempt.
    measured_s : array, shape (n,)
        Mean cycle time of the attempts that did; NaN without any.
    failure_s : float
        What a grasp without a whole cycle costs [s].
    orders : mapping of str to int array
        Rows in the order in which they would be tried, by name in ``CYCLE_ORDERS``.
    """

    predicted_s: FloatArray
    outside: BoolArray
    found: BoolArray
    status: CodeArray
    measured_s: FloatArray
    failure_s: float
    orders: Mapping[str, IntArray]

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstSeconds:
    """The first grasps of one order: how many have a whole cycle, and what they take.

    Attributes
    ----------
    considered, whole : int
    seconds : float
        Mean of those with a whole cycle [s]; NaN without any.
    seconds_per_part : float
        All of them in turn, what failures cost included, for each whole cycle [s];
        NaN without any.
    """

    considered: int
    whole: int
    seconds: float
    seconds_per_part: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleSummary:
    """How well the cycles of a list, or of all lists, were predicted.

    Attributes
    ----------
    label : str
    confusion : Confusion
        Of whole cycles.
    correlation : RankCorrelation
        Of predicted seconds and measured cycle times.
    orders : mapping of str to FirstSeconds
    """

    label: str
    confusion: Confusion
    correlation: RankCorrelation
    orders: Mapping[str, FirstSeconds]


def settings_in_seconds(settings: RankSettings) -> RankSettings:
    """The same settings with the cost in predicted seconds."""
    return replace(
        settings, cost="cycle", weights=EVEN, likeness=0.0, margins={}, neighbours=1
    )


def settings_in_j(settings: RankSettings) -> RankSettings:
    """The same settings with the cost J."""
    return replace(settings, cost="paper", failure_cost_s=None)


def judge_cycles(
    ranked: RankedList,
    ranker: Ranker,
    settings: RankSettings,
    results: CycleResults,
) -> JudgedCycles:
    """Compare planned cycles with predicted ones.

    Parameters
    ----------
    ranked : RankedList
        By J.
    ranker : Ranker
        Of a map with cycles.
    settings : RankSettings
        As they were asked for.
    results : CycleResults
        Of the same grasps.
    """
    asked = settings_in_seconds(settings)
    ranking = ranker.rank_queries(ranked.queries, asked, ranked.grasps.scores)
    found = np.isfinite(results.seconds)
    count = found.sum(axis=1)
    total = np.where(found, results.seconds, 0.0).sum(axis=1)
    return JudgedCycles(
        status=results.status[:, 0].copy(),
        predicted_s=ranking.cost.copy(),
        outside=ranking.status == OUTSIDE_MAP,
        found=count > 0,
        measured_s=np.where(count > 0, total / np.maximum(count, 1), np.nan),
        failure_s=ranker.failure_cost_s(asked),
        orders={
            "supplied": np.arange(len(count)),
            "re-ranked": ranked.ranking.order.copy(),
            "by seconds": ranking.order.copy(),
        },
    )


def summarise_cycles(
    labels: Sequence[str], lists: Sequence[JudgedCycles], top: int
) -> tuple[CycleSummary, ...]:
    """Summaries of each list; with several, the last is of all together."""
    found = [
        _summary(label, [one], top) for label, one in zip(labels, lists, strict=True)
    ]
    return (*found, _summary("all", lists, top)) if len(lists) > 1 else tuple(found)


def _summary(label: str, lists: Sequence[JudgedCycles], top: int) -> CycleSummary:
    def joined(name: str) -> FloatArray:
        return np.concatenate([getattr(one, name) for one in lists])

    predicted_s, measured_s = joined("predicted_s"), joined("measured_s")
    return CycleSummary(
        label=label,
        confusion=confusion_of(
            np.isfinite(predicted_s),
            joined("found").astype(bool),
            joined("outside").astype(bool),
        ),
        correlation=rank_correlation(
            predicted_s, np.where(np.isnan(measured_s), np.inf, measured_s)
        ),
        orders={name: _first(lists, name, top) for name in CYCLE_ORDERS},
    )


def _first(lists: Sequence[JudgedCycles], order: str, top: int) -> FirstSeconds:
    """First grasps of each list in one order, all lists together."""
    firsts = [one.measured_s[one.orders[order][:top]] for one in lists]
    measured = np.concatenate(firsts)
    known = measured[np.isfinite(measured)]
    lost_s = sum(
        one.failure_s * float(np.isnan(first).sum())
        for one, first in zip(lists, firsts, strict=True)
    )
    total_s, nan = float(known.sum()), float("nan")
    return FirstSeconds(
        considered=len(measured),
        whole=len(known),
        seconds=total_s / len(known) if len(known) else nan,
        seconds_per_part=(total_s + lost_s) / len(known) if len(known) else nan,
    )
