"""Summary of a validation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.maps.summary.reliability import Reliability, reliability_of
from reachmap.scans.measured import MEASURED
from reachmap.validation.calibration import ReliabilityDiagram, reliability_diagram
from reachmap.validation.cycles import CycleSummary, summarise_cycles
from reachmap.validation.judgement import ORDERS, JudgedList
from reachmap.validation.statistics import (
    Confusion,
    RankCorrelation,
    Share,
    confusion_of,
    expected_calls,
    rank_correlation,
    share_of,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ListSummary:
    """How well a list, or all lists together, was predicted.

    Attributes
    ----------
    label : str
    grasps : int
    confusion : Confusion
    recommended : Share
        Of the grasps called reachable, those that were reached in the very tool
        orientation that the ranking recommends.
    correlation : RankCorrelation
        Of predicted and measured J.
    repeatability : RankCorrelation
        Of measured J in every other attempt and in those between, for the same
        grasps: no prediction can be expected to correlate much better.
    """

    label: str
    grasps: int
    confusion: Confusion
    recommended: Share
    correlation: RankCorrelation
    repeatability: RankCorrelation


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderFigures:
    """The first grasps of a group in one order, as measured; means over those reached.

    Attributes
    ----------
    considered, reached : int
        How many of the first were looked at, and reached.
    cost : float
        Mean measured J, NaN if none was reached.
    terms : array, shape (3,)
        Its summands.
    path_length, planning_time, execution_time : float
        [rad], CPU [s], [s].
    calls_first, calls_top : float
        Expected planner calls, one per grasp, until the first success and until as
        many as are considered; at most the whole group.
    """

    considered: int
    reached: int
    cost: float
    terms: FloatArray
    path_length: float
    planning_time: float
    execution_time: float
    calls_first: float
    calls_top: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupSummary:
    """One quadrant of one list, in every order."""

    label: str
    grasps: int
    orders: Mapping[str, OrderFigures]

    @property
    def cheaper(self) -> bool:
        """Whether re-ranking made the first grasps cheaper.

        An unreachable grasp makes a mean infinite, so fewer of them come first; with
        as many, the mean of the reached ones decides.
        """
        before, after = self.orders["supplied"], self.orders["re-ranked"]
        lost = after.considered - after.reached, before.considered - before.reached
        return lost[0] < lost[1] or (lost[0] == lost[1] and after.cost < before.cost)


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """A bin map tested against planning.

    Attributes
    ----------
    settings : mapping
        What was planned and how, as JSON values.
    top : int
        How many of the first grasps the groups look at.
    lists : tuple of JudgedList
    summaries : tuple of ListSummary
        Of each list; with several, the last is of all together.
    groups : tuple of GroupSummary
    reliability : mapping of str to Reliability
        Of a single attempt's path length, state checks, CPU and execution time: what
        share of the variance is the grasp and not chance.
    diagram : ReliabilityDiagram
        Predicted probabilities beside the outcomes of the grasps.
    cycles : tuple of CycleSummary
        Of each list; with several, the last is of all together. Empty without cycles.
    """

    settings: Mapping[str, Any]
    top: int
    lists: tuple[JudgedList, ...]
    summaries: tuple[ListSummary, ...]
    groups: tuple[GroupSummary, ...]
    reliability: Mapping[str, Reliability]
    diagram: ReliabilityDiagram
    cycles: tuple[CycleSummary, ...] = ()

    @property
    def overall(self) -> ListSummary:
        """Summary of all lists together."""
        return self.summaries[-1]


def summarise(
    lists: Sequence[JudgedList], *, top: int, settings: Mapping[str, Any]
) -> Validation:
    """Count, correlate and average judged lists."""
    summaries = [summarise_lists(one.label, [one]) for one in lists]
    if len(lists) > 1:
        summaries.append(summarise_lists("all", lists))
    groups = [
        _group(f"{one.label} {name}" if len(lists) > 1 else name, one, rows, top)
        for one in lists
        for name, rows in one.groups.items()
    ]
    return Validation(
        settings=settings,
        top=top,
        lists=tuple(lists),
        summaries=tuple(summaries),
        groups=tuple(groups),
        reliability=_reliability(lists),
        cycles=summarise_cycles(
            [one.label for one in lists],
            [one.cycles for one in lists if one.cycles is not None],
            top,
        )
        if all(one.cycles is not None for one in lists)
        else (),
        diagram=reliability_diagram(
            np.concatenate([one.probability for one in lists]),
            np.concatenate([one.reached for one in lists]),
        ),
    )


def _reliability(lists: Sequence[JudgedList]) -> dict[str, Reliability]:
    """Of the attempts at all grasps, whatever the lists."""
    if len({one.results.found.shape[1] for one in lists}) != 1:
        return {}
    measured = np.concatenate([one.results.measured for one in lists])
    checks = np.concatenate([one.results.checks for one in lists]).astype(float)
    path = measured[..., MEASURED.index("path_length")]
    values = {
        "path_length": path,
        "effort_checks": np.where(np.isnan(path), np.nan, checks),
        **{
            name: measured[..., MEASURED.index(name)]
            for name in ("planning_cpu_time", "execution_time")
        },
    }
    return {name: reliability_of(attempts) for name, attempts in values.items()}


def summarise_lists(label: str, lists: Sequence[JudgedList]) -> ListSummary:
    """Summarise one list, or several as one."""

    def joined(name: str) -> Any:
        return np.concatenate([getattr(one, name) for one in lists])

    predicted, outside = joined("predicted"), joined("outside")
    as_recommended = joined("reached_as_recommended")
    # Only grasps inside the map: for the others nothing was predicted.
    halves = joined("halves")[predicted]
    return ListSummary(
        label=label,
        grasps=len(predicted),
        confusion=confusion_of(predicted, joined("reached"), outside),
        recommended=share_of(
            int((predicted & as_recommended).sum()), int(predicted.sum())
        ),
        correlation=rank_correlation(joined("predicted_cost"), joined("cost")),
        repeatability=rank_correlation(halves[:, 0], halves[:, 1]),
    )


def _group(label: str, one: JudgedList, rows: IntArray, top: int) -> GroupSummary:
    orders = {}
    for name in ORDERS:
        order = one.orders[name]
        orders[name] = _figures(one, order[np.isin(order, rows)], top)
    return GroupSummary(label=label, grasps=len(rows), orders=orders)


def _figures(one: JudgedList, order: IntArray, top: int) -> OrderFigures:
    first = order[:top]
    reached = first[one.reached[first]]
    terms, means = np.full(3, np.nan), np.full(len(MEASURED), np.nan)
    if len(reached):
        terms, means = one.terms[reached].mean(axis=0), one.measured[reached].mean(0)
    return OrderFigures(
        considered=len(first),
        reached=len(reached),
        cost=float(terms.sum()),
        terms=terms,
        path_length=float(means[MEASURED.index("path_length")]),
        planning_time=float(means[MEASURED.index("planning_cpu_time")]),
        execution_time=float(means[MEASURED.index("execution_time")]),
        calls_first=expected_calls(one.chance, order),
        calls_top=expected_calls(one.chance, order, len(first)),
    )
