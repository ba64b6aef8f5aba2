"""A ranked list compared with planning: predictions, measurements, orders."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.geometry import transform_points
from reachmap.maps.parts import freeze
from reachmap.maps.records import BinMap
from reachmap.ranking.answers.ranked_list import QUADRANT_ORDER, RankedList
from reachmap.ranking.lookup.costs import OUTSIDE_MAP
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.scans.measured import MEASURED
from reachmap.validation.cycles import JudgedCycles
from reachmap.validation.planning import PickResults

ORDERS = ("supplied", "re-ranked", "ik-only")
IN_COST = tuple(
    MEASURED.index(name)
    for name in ("path_length", "planning_cpu_time", "execution_time")
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JudgedList:
    """One list of n grasps, in supplied order.

    Attributes
    ----------
    label : str
    ids : tuple of str
    groups : mapping of str to int array
        Rows of each quadrant: as the list names them, else by place in the bin.
    predicted_cost : array, shape (n,)
        J by the map; inf where it calls the grasp unreachable or says nothing.
    predicted_status : uint8 array, shape (n,)
    share : array, shape (n,)
        Share reached around each grasp; NaN where the map says nothing.
    probability : array, shape (n,)
        Predicted probability of being reached; NaN where the map says nothing.
    outside : bool array, shape (n,)
        Grasps that the map says nothing about.
    results : PickResults
    measured : array, shape (n, 7)
        Mean over the successful attempts; NaN without any.
    terms : array, shape (n, 3)
        Measured summands of J: weighted, normalised as the map's.
    halves : array, shape (n, 2)
        Measured J of every other attempt, and of those between.
    orders : mapping of str to int array
        Rows in the order in which they would be tried, by name in ``ORDERS``.
    cycles : JudgedCycles or None
        Whole cycles, where the map has them.
    """

    label: str
    ids: tuple[str, ...]
    groups: Mapping[str, IntArray]
    predicted_cost: FloatArray
    predicted_status: CodeArray
    share: FloatArray
    probability: FloatArray
    outside: BoolArray
    results: PickResults
    measured: FloatArray
    terms: FloatArray
    halves: FloatArray
    orders: Mapping[str, IntArray]
    cycles: JudgedCycles | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def predicted(self) -> BoolArray:
        """Where the map calls a grasp reachable, shape (n,)."""
        return np.isfinite(self.predicted_cost)

    @property
    def reached(self) -> BoolArray:
        """Where an attempt found a path, shape (n,)."""
        return np.asarray(self.results.found.any(axis=1))

    @property
    def chance(self) -> FloatArray:
        """Share of attempts that succeeded, shape (n,)."""
        return np.asarray(self.results.found.mean(axis=1))

    @property
    def cost(self) -> FloatArray:
        """Measured J, shape (n,); inf where no attempt found a path."""
        total = self.terms.sum(axis=1)
        return np.where(np.isnan(total), np.inf, total)

    @property
    def reached_as_recommended(self) -> BoolArray:
        """Where an attempt reached the recommended tool pose itself, shape (n,)."""
        return np.asarray((self.results.pose == 0).any(axis=1))


def judge_list(
    label: str,
    ranked: RankedList,
    ranker: Ranker,
    bin_map: BinMap,
    results: PickResults,
) -> JudgedList:
    """Compare planning results with the map's predictions."""
    ranking = ranked.ranking
    weights = np.asarray(ranked.asked.weights, float)
    scale = weights / ranker.table.scale
    costs = _costs(bin_map, ranker, results)
    attempts = costs @ scale
    mean = _mean_of_successes(results.measured)
    outside = ranking.status == OUTSIDE_MAP
    with_ik = _with_ik(ranked, ranker, bin_map) & ~outside
    supplied = np.arange(len(outside))
    return JudgedList(
        label=label,
        ids=ranked.grasps.ids,
        groups=_groups(ranked, ranker),
        predicted_cost=ranking.cost.copy(),
        predicted_status=ranking.status.copy(),
        share=np.where(
            np.isnan(ranking.probability),
            np.nan,
            ranker.share_reached(ranked.queries),
        ),
        probability=ranking.probability.copy(),
        outside=outside,
        results=results,
        measured=mean,
        terms=_mean_of_successes(costs) * scale,
        halves=np.stack(
            [_mean_of_successes(attempts[:, k::2, None])[:, 0] for k in (0, 1)], axis=1
        ),
        orders={
            "supplied": supplied,
            "re-ranked": ranking.order.copy(),
            "ik-only": np.argsort(~with_ik, kind="stable"),
        },
    )


def _costs(bin_map: BinMap, ranker: Ranker, results: PickResults) -> FloatArray:
    """Terms of J attempt by attempt, shape (n, r, 3); NaN without a path."""
    costs = results.measured[..., IN_COST].copy()
    if ranker.table.basis.planning_time == "checks" and bin_map.effort is not None:
        # In the unit of the map: a nominal cost per check, not this machine's.
        seconds = results.checks * bin_map.effort.seconds_per_check
        costs[..., 1] = np.where(np.isnan(costs[..., 0]), np.nan, seconds)
    return costs


def _mean_of_successes(values: FloatArray) -> FloatArray:
    """Mean over attempts, (n, r, k) to (n, k); NaN where none succeeded."""
    found = ~np.isnan(values[..., 0])
    count = found.sum(axis=1)[:, None]
    total = np.where(found[..., None], values, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _with_ik(ranked: RankedList, ranker: Ranker, bin_map: BinMap) -> BoolArray:
    """Whether the nearest test grasp, in any roll that ties, has a solution."""
    n_ik = bin_map.n_ik.reshape(len(ranker.table.points), -1)
    queries = ranked.queries
    tied = (ranker.tied(queries.take(np.array([k]))) for k in range(len(queries)))
    return np.array([bool(n_ik[rows].any()) for rows in tied], bool)


def _groups(ranked: RankedList, ranker: Ranker) -> dict[str, IntArray]:
    """Rows by quadrant, N being +y and E +x of the bin; no empty ones."""
    names = list(ranked.grasps.quadrants)
    if not any(names):
        T = ranker.table.T_bin_base
        p_bin = transform_points(T, ranked.queries.points)
        names = [
            ("N" if y >= 0 else "S") + ("E" if x >= 0 else "W") for x, y, _ in p_bin
        ]
    rows = {
        name or "other": np.array([k for k, own in enumerate(names) if own == name])
        for name in QUADRANT_ORDER
    }
    return {name: found for name, found in rows.items() if len(found)}
