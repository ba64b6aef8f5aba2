"""Ranking by look-up: Algorithm 1 of the paper, vectorised."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.maps.format.bin import read_bin_map
from reachmap.maps.records import BinMap, Stamp
from reachmap.ranking.lookup.costs import (
    blended_terms,
    grasp_costs,
    likeness_terms,
    outside_map,
)
from reachmap.ranking.lookup.frames import frames_of
from reachmap.ranking.lookup.matching import (
    Matches,
    NearestPoints,
    Queries,
    match,
    tied,
)
from reachmap.ranking.lookup.order import OUTSIDE_MAP, Ranking, stable_order
from reachmap.ranking.lookup.queries import queries_from_arrays
from reachmap.ranking.lookup.settings import CostBasis, RankSettings, Roll
from reachmap.ranking.lookup.table import GraspTable, table_from_bin_map


class Ranker:
    """Ranks grasps by the cost of the nearest test grasp of a bin map.

    Made once, used for every image: it holds nothing that changes, so one ranker may
    serve several threads.

    Parameters
    ----------
    bin_map : BinMap
    basis : CostBasis, optional
        What the terms of J are made of.

    Attributes
    ----------
    table : GraspTable
        The test grasps with their costs.
    frames : mapping
        Frames that grasp lists may be in, as poses in robot_base.
    stamp : Stamp
        Identity of the map.
    """

    def __init__(self, bin_map: BinMap, basis: CostBasis | None = None) -> None:
        self.table: GraspTable = table_from_bin_map(bin_map, basis)
        self.frames: Mapping[str, FloatArray] = frames_of(bin_map)
        self.stamp: Stamp = bin_map.stamp
        self._tree = NearestPoints(self.table.points)

    @cached_property
    def cost_table_sha256(self) -> str:
        """Hash of what costs are looked up in; see :meth:`GraspTable.sha256`."""
        return self.table.sha256()

    @classmethod
    def from_map(cls, path: str | Path, basis: CostBasis | None = None) -> Ranker:
        """Load a bin map.

        Raises
        ------
        MapFileError
            The file is not a readable bin map.
        """
        return cls(read_bin_map(Path(path)), basis)

    def rank(
        self,
        points: FloatArray,
        directions: FloatArray | None = None,
        rotations: FloatArray | None = None,
        *,
        weights: Sequence[float] = (1.0, 1.0, 1.0),
        likeness: float = 0.0,
        neighbours: int = 1,
        roll: Roll = "as-given",
        scores: FloatArray | None = None,
    ) -> Ranking:
        """Rank grasps given in robot_base.

        Parameters
        ----------
        points : array, shape (n, 3)
            Grasp points [m].
        directions : array, shape (n, 3), optional
            Approach directions into the object; their length does not matter.
        rotations : array, shape (n, 3, 3), optional
            TCP orientations. A row of NaN has none; its direction counts then.
        weights : sequence of 3 float
            α, β, δ of path length, planning time and execution time.
        likeness : float
            ε of the likeness term φ6.
        neighbours : int
            Test points whose costs are blended.
        roll : {"as-given", "free", "fixed"}
            Whether the roll about the approach counts; see :class:`RankSettings`.
        scores : array, shape (n,), optional
            Break ties of J, higher first; the supplied order breaks what remains.

        Raises
        ------
        SettingsError
            Arrays that do not fit together or are not finite; weights out of range.
        """
        settings = RankSettings.of(weights, likeness, neighbours, roll)
        queries = queries_from_arrays(
            self.table, points, directions, rotations, roll=settings.roll
        )
        return self.rank_queries(queries, settings, scores)

    def rank_queries(
        self,
        queries: Queries,
        settings: RankSettings,
        scores: FloatArray | None = None,
    ) -> Ranking:
        """Rank grasps that are checked already."""
        table = self.table
        table_cost = grasp_costs(table, settings.weights)
        matches = match(queries, table, self._tree, table_cost)
        outside = outside_map(queries.points, matches.point, table)
        terms = self._terms(queries, matches, table_cost, settings)
        cost = np.where(outside, np.inf, terms.sum(axis=1))
        cost[np.isnan(cost)] = np.inf
        reachable = np.isfinite(cost)
        status = table.status[matches.point, matches.orientation]
        return Ranking(
            order=stable_order(cost, scores),
            cost=cost,
            terms=np.where(reachable[:, None], terms, np.nan),
            status=np.where(outside, np.uint8(OUTSIDE_MAP), status),
            test_grasp=_unravelled(matches, table),
            distance=matches.distance,
            angle=matches.angle,
            roll_free=queries.free.copy(),
            orientation_wxyz=table.quaternions[matches.point, matches.orientation]
            + 0.0,
        )

    def tied(self, query: Queries) -> tuple[IntArray, IntArray]:
        """Points and orientations of the test grasps that tie for one grasp."""
        return tied(query, self.table, self._tree)

    def test_costs(self, weights: tuple[float, float, float]) -> FloatArray:
        """J of every test grasp, shape (points, orientations); inf if unreachable."""
        return grasp_costs(self.table, weights)

    def _terms(
        self,
        queries: Queries,
        matches: Matches,
        table_cost: FloatArray,
        settings: RankSettings,
    ) -> FloatArray:
        """Summands of J, shape (n, 4); NaN where the test grasp is unreachable."""
        table = self.table
        phi = table.normalised[matches.point, matches.orientation]
        if settings.neighbours > 1:
            phi = blended_terms(
                phi,
                queries,
                matches,
                table,
                self._tree,
                table_cost,
                settings.neighbours,
            )
        terms = np.empty((len(queries), 4))
        terms[:, :3] = phi * settings.weights
        terms[:, 3] = settings.likeness * likeness_terms(matches, queries.free, table)
        return terms


def _unravelled(matches: Matches, table: GraspTable) -> IntArray:
    place = np.unravel_index(matches.point, table.shape[:3])
    return np.stack([*place, matches.orientation], axis=1)
