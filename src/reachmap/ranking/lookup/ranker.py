"""Ranking by look-up: Algorithm 1 of the paper, vectorised."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.errors import MapFileError, SettingsError
from reachmap.maps.format.bin import read_bin_map
from reachmap.maps.parts import StageStatus
from reachmap.maps.records import BinMap, Stamp
from reachmap.ranking.lookup.bin_room import BinRoom
from reachmap.ranking.lookup.costs import (
    INVALID,
    LIKENESS,
    OUTSIDE_MAP,
    UNLIKE_MAP,
    Columns,
    Ranking,
    beyond_points,
    columns_of,
    cycle_of,
    likeness_terms,
    median_terms,
    outside_map,
    stable_order,
    unlike_map,
)
from reachmap.ranking.lookup.matching import (
    Matches,
    NearestPoints,
    Queries,
    match,
    match_past,
    tied,
)
from reachmap.ranking.lookup.probability import (
    Calibration,
    Surroundings,
    usual_calibration,
)
from reachmap.ranking.lookup.queries import (
    frames_of,
    queries_from_arrays,
    rotations_from_quaternions,
    scores_of,
)
from reachmap.ranking.lookup.settings import (
    EVEN,
    Cost,
    CostBasis,
    Invalid,
    RankSettings,
    Roll,
)
from reachmap.ranking.lookup.table import GraspTable, table_from_bin_map
from reachmap.ranking.lookup.verdict import RefinedVerdicts
from reachmap.ranking.terms import FAILURE


class Ranker:
    """Ranks grasps by the cost of the nearest test grasp of a bin map.

    Made once, used for every image: it holds nothing that changes, so one ranker may
    serve several threads.

    Parameters
    ----------
    bin_map : BinMap
    basis : CostBasis, optional
        What the terms of J are made of.
    calibration : Calibration, optional
        What turns the share reached around a grasp into its probability.

    Raises
    ------
    MapFileError
        The calibration is another map's.

    Attributes
    ----------
    table : GraspTable
        The test grasps with their costs.
    frames : mapping
        Frames that grasp lists may be in, as poses in robot_base.
    stamp : Stamp
        Identity of the map.
    calibration : Calibration or None
    refined : RefinedVerdicts or None
        Verdicts between the test grasps; None where the map has none.
    """

    def __init__(
        self,
        bin_map: BinMap,
        basis: CostBasis | None = None,
        calibration: Calibration | None = None,
    ) -> None:
        if calibration and calibration.map_sha256 != bin_map.stamp.content_sha256:
            raise MapFileError("the calibration was made for another map")
        self.calibration = calibration
        self.table: GraspTable = table_from_bin_map(bin_map, basis)
        self._around = Surroundings(self.table)
        between = bin_map.refinement
        self.refined: RefinedVerdicts | None = None
        if between is not None:
            cell = bin_map.provenance.cell_resolved_json
            tool = BinRoom.for_tool(cell, self.table.T_bin_base)
            self.refined = RefinedVerdicts(between, self.table, tool)
        self._room = BinRoom.for_part(bin_map, self.table.T_bin_base)
        self._whole_around, self._held_around = self._cycles_around()
        self.frames: Mapping[str, FloatArray] = frames_of(bin_map)
        self.stamp: Stamp = bin_map.stamp
        self._tree = NearestPoints(self.table.points)

    def __repr__(self) -> str:
        known = "calibrated" if self.calibration else "not calibrated"
        sha256, tests = self.stamp.content_sha256[:12], self.table.reachable.size
        return f"<Ranker: map {sha256}, {tests} test grasps, {known}>"

    @cached_property
    def cost_table_sha256(self) -> str:
        """Hash of what costs are looked up in; see :meth:`GraspTable.sha256`."""
        return self.table.sha256()

    @classmethod
    def from_map(cls, path: str | Path, basis: CostBasis | None = None) -> Ranker:
        """Load a bin map, and the calibration beside it if there is one.

        A calibration of another map is ignored with a warning.

        Raises
        ------
        MapFileError
            The file is not a readable bin map, or its calibration is damaged.
        """
        bin_map = read_bin_map(Path(path))
        return cls(bin_map, basis, usual_calibration(path, bin_map.stamp))

    def rank(
        self,
        points: ArrayLike,
        directions: ArrayLike | None = None,
        rotations: ArrayLike | None = None,
        *,
        quaternions_wxyz: ArrayLike | None = None,
        quaternions_xyzw: ArrayLike | None = None,
        cost: Cost = "paper",
        failure_cost_s: float | None = None,
        weights: Sequence[float] = EVEN,
        likeness: float = 0.0,
        margins: Mapping[str, float] | None = None,
        neighbours: int = 1,
        roll: Roll = "as-given",
        max_angle_deg: float | None = None,
        invalid: Invalid = "mark",
        scores: ArrayLike | None = None,
    ) -> Ranking:
        """Rank grasps given in robot_base.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            Grasp points [m]; one grasp may be flat, and there may be none.
        directions : array_like, shape (n, 3), optional
            Approach directions into the object, of any length but 0.
        rotations : array_like, shape (n, 3, 3), optional
            TCP orientations. A row of NaN has none; its direction counts then.
        quaternions_wxyz, quaternions_xyzw : array_like, shape (n, 4), optional
            TCP orientations as quaternions, instead of ``rotations``.
        cost : {"paper", "cycle"}
            J, or predicted seconds per pick.
        failure_cost_s : float, optional
            What a failed pick costs where cost is cycle [s].
        weights : sequence of 3 float
            α, β, δ of path length, planning time and execution time.
        likeness : float
            ε of the likeness term φ6.
        margins : mapping, optional
            Weights of ``clearance``, ``joint_margin``, ``singularity`` and
            ``wind_up``; those left out weigh 0.
        neighbours : int
            Test points of which the median cost is taken.
        roll : {"as-given", "free", "fixed"}
            Whether the roll about the approach counts; see :class:`RankSettings`.
        max_angle_deg : float, optional
            Largest φ2 of a grasp that the map speaks about; see :class:`RankSettings`.
        invalid : {"mark", "raise"}
            Whether rows that are not grasps get the status ``INVALID``, or an error.
        scores : array_like, shape (n,), optional
            Break ties of J, higher first; the supplied order breaks what remains.

        Raises
        ------
        SettingsError
            Arrays that do not fit together; weights out of range; with
            ``invalid="raise"`` also the rows that are not grasps; margins or cycles of
            a map that has none.
        """
        settings = RankSettings(
            cost=cost,
            failure_cost_s=failure_cost_s,
            weights=weights,  # type: ignore[arg-type]
            likeness=likeness,
            margins={} if margins is None else margins,
            neighbours=neighbours,
            roll=roll,
            max_angle_deg=max_angle_deg,
            invalid=invalid,
        )
        turned = rotations_from_quaternions(quaternions_wxyz, quaternions_xyzw)
        if turned is not None and rotations is not None:
            raise SettingsError("give rotations or quaternions, not both")
        queries = queries_from_arrays(
            self.table,
            points,
            directions,
            rotations if turned is None else turned,
            roll=settings.roll,
            invalid=settings.invalid,
        )
        return self.rank_queries(queries, settings, scores)

    def rank_queries(
        self,
        queries: Queries,
        settings: RankSettings,
        scores: ArrayLike | None = None,
    ) -> Ranking:
        """Rank grasps that are checked already."""
        table = self.table
        columns = columns_of(table, settings)
        matches = match(queries, table, self._tree, columns.costs())
        outside = outside_map(queries.points, matches.point, table)
        unlike = unlike_map(matches, queries.free, table, settings.max_angle_deg)
        share = self.share_reached(queries)
        probability = self.calibration(share) if self.calibration else share
        causes = np.zeros(len(queries), np.uint8)
        if self.refined is not None:
            matches, causes = self.refined.decide(queries, matches, share)
        room = np.ones(len(queries), bool)
        if settings.cost == "cycle" and self._room is not None:
            room = self._room.is_there(queries)
            matches = self._past_walls(queries, matches, columns, room)
        if settings.cost == "cycle":
            whole = probability * self._share_whole(queries)
            names, terms = self._seconds(matches, columns, settings, whole)
        else:
            names, terms = self._terms(queries, matches, columns, settings)
        matched = queries.valid & ~outside & ~unlike
        cost = np.where(matched & room & (causes == 0), terms.sum(axis=1), np.inf)
        cost[np.isnan(cost)] = np.inf
        reachable = np.isfinite(cost)
        status = _status_of(table, settings)[matches.point, matches.orientation]
        reached = table.reachable[matches.point, matches.orientation]
        absent = np.uint8(StageStatus.PART_IN_COLLISION)
        status = np.where(~room & reached, absent, status)
        status = np.where(causes > 0, causes, status)
        status = np.where(unlike, np.uint8(UNLIKE_MAP), status)
        status = np.where(outside, np.uint8(OUTSIDE_MAP), status)
        status = np.where(queries.valid, status, np.uint8(INVALID))
        valid = queries.valid
        return Ranking(
            order=stable_order(cost, scores_of(scores, len(queries))),
            cost=cost,
            terms=np.where(reachable[:, None], terms, np.nan),
            term_names=names,
            status=status,
            test_grasp=np.where(valid[:, None], _unravelled(matches, table), -1),
            distance=np.where(valid, matches.distance_m, np.nan),
            angle=np.where(valid, matches.angle_rad, np.nan),
            roll_free=queries.free.copy(),
            extrapolated=valid & ~outside & beyond_points(queries.points, table),
            probability=np.where(matched, probability, np.nan),
            orientation_wxyz=table.recommended[matches.point, matches.orientation]
            + 0.0,
        )

    def share_reached(self, queries: Queries) -> FloatArray:
        """Share reached around each grasp, in (0, 1); shape (n,).

        By what is known between the test grasps, where it is and the roll is free.
        """
        share = self._around.share_reached(queries)
        if self.refined is None or not queries.free.any():
            return share
        return np.where(queries.free, self.refined.share_reached(queries, share), share)

    def _cycles_around(self) -> tuple[Surroundings | None, Surroundings | None]:
        """Share with a whole cycle around any grasp, and share that it is of."""
        table = self.table
        if table.cycle is None:
            return None, None
        held = table.reachable.copy()
        if self._room is not None:
            # Whether the part has room is known of each grasp, not guessed from others.
            held &= table.cycle.status != StageStatus.PART_IN_COLLISION
        return (
            Surroundings(replace(table, reachable=table.cycle.whole)),
            Surroundings(replace(table, reachable=held)),
        )

    def _past_walls(
        self, queries: Queries, matches: Matches, columns: Columns, room: BoolArray
    ) -> Matches:
        """Matches past test grasps without room for the part, where a grasp has it."""
        absent = cycle_of(self.table).status == StageStatus.PART_IN_COLLISION
        rows = np.flatnonzero(room & absent[matches.point, matches.orientation])
        return match_past(
            matches, rows, absent, queries, self.table, self._tree, columns.costs()
        )

    def _share_whole(self, queries: Queries) -> FloatArray:
        """Share of what is held around each grasp that has a whole cycle, (n,)."""
        assert self._whole_around is not None
        assert self._held_around is not None
        whole = self._whole_around.share_reached(queries)
        held = self._held_around.share_reached(queries)
        return np.minimum(whole / np.maximum(held, 1e-9), 1.0)

    def tied(self, query: Queries) -> tuple[IntArray, IntArray]:
        """Points and orientations of the test grasps that tie for one grasp."""
        return tied(query, self.table, self._tree)

    def test_costs(self, settings: RankSettings) -> FloatArray:
        """Cost of every test grasp, shape (points, orientations); inf: unreachable.

        Without what depends on the grasp that is ranked.
        """
        return columns_of(self.table, settings).costs()

    def _terms(
        self,
        queries: Queries,
        matches: Matches,
        columns: Columns,
        settings: RankSettings,
    ) -> tuple[tuple[str, ...], FloatArray]:
        """Summands of J with names, (n, k); NaN where the test grasp is unreachable."""
        table = self.table
        phi = columns.values[matches.point, matches.orientation]
        if settings.neighbours > 1:
            phi = median_terms(
                phi, queries, table, self._tree, columns, settings.neighbours
            )
        unlike = settings.likeness * likeness_terms(matches, queries.free, table)
        terms = np.insert(phi * columns.weights, 3, unlike, axis=1)
        return (*columns.names[:3], LIKENESS, *columns.names[3:]), terms

    def _seconds(
        self,
        matches: Matches,
        columns: Columns,
        settings: RankSettings,
        probability: FloatArray,
    ) -> tuple[tuple[str, ...], FloatArray]:
        """Predicted seconds of each pick by stage, what a failure costs last."""
        seconds = columns.values[matches.point, matches.orientation]
        failing = self.failure_cost_s(settings) * (1.0 - probability)
        return (*columns.names, FAILURE), np.column_stack([seconds, failing])

    def failure_cost_s(self, settings: RankSettings) -> float:
        """Cost of a failed pick, by default the median cycle [s]."""
        if settings.failure_cost_s is not None:
            return settings.failure_cost_s
        return cycle_of(self.table).usual_failure_s()


def _status_of(table: GraspTable, settings: RankSettings) -> CodeArray:
    """State of each test grasp, of its whole cycle where that is asked for."""
    return table.status if settings.cost == "paper" else cycle_of(table).status


def _unravelled(matches: Matches, table: GraspTable) -> IntArray:
    place = np.unravel_index(matches.point, table.shape[:3])
    return np.stack([*place, matches.orientation], axis=1)
