"""Verdicts between the test grasps, from the grasps of a map's refinement.

A test grasp represents a box of positions and a cone of directions, through which the
boundary of what is reachable may run. Whether the tool has room in the bin is asked of
each grasp itself; for all else a refined map has further grasps along that boundary. A
regression over them decides, and a test grasp near by gives the cost.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.geometry import (
    axis_vector,
    direction_angle,
    rotation_from_quaternion_wxyz,
)
from reachmap.maps.parts import Refinement
from reachmap.maps.records import Status
from reachmap.ranking.lookup.bin_room import BinRoom
from reachmap.ranking.lookup.matching import (
    TIE_M,
    TIE_RAD,
    Matches,
    NearestPoints,
    Queries,
)
from reachmap.ranking.lookup.table import GraspTable
from reachmap.sampling.regression import GraspRegression, tool_points

REACHED_FROM: Final = 0.5
"""Estimate from which a grasp counts as reached."""
AROUND: Final = 0.3
"""Weight of the test grasps around, beside the regression: of 0, 0.1, 0.2 and 0.3 that
with the fewest errors on 2,400 random grasps of a deep bin."""
# No estimate is certain; what the test grasps' own shares end at.
_LEAST_SHARE: Final = 0.01


class RefinedVerdicts:
    """Which grasps with a free roll a refined map calls reachable.

    Parameters
    ----------
    refinement : Refinement
    table : GraspTable
    room : BinRoom, optional
        For the tool.
    """

    def __init__(
        self, refinement: Refinement, table: GraspTable, room: BinRoom | None
    ) -> None:
        R = rotation_from_quaternion_wxyz(refinement.quaternion_wxyz)
        points, axes = refinement.position, R @ axis_vector(table.approach_axis)
        lever_m = refinement.lever_m
        self._table, self._room = table, room
        reached = refinement.status == Status.PATH_FOUND
        self._regression = GraspRegression.fit(
            points, axes, reached.astype(float), lever_m
        )
        self._cause = refinement.status[~reached]
        self._failed = _NearestGrasps(points[~reached], axes[~reached], lever_m)
        self._place, self._turn = np.nonzero(table.reachable)
        self._reachable = _NearestGrasps(
            table.points[self._place], table.axes[self._place, self._turn], lever_m
        )

    def share_reached(self, queries: Queries, around: FloatArray) -> FloatArray:
        """Estimate that each grasp is reached in some roll, in (0, 1); shape (n,).

        Parameters
        ----------
        queries : Queries
        around : array, shape (n,)
            Share reached among the test grasps around each.
        """
        between = self._regression(queries.points, queries.axes)
        estimate = AROUND * around + (1.0 - AROUND) * between
        estimate[self._without_room(queries, estimate >= REACHED_FROM)] = 0.0
        return np.clip(estimate, _LEAST_SHARE, 1.0 - _LEAST_SHARE)

    def _without_room(self, queries: Queries, rows: BoolArray) -> BoolArray:
        """Which of some rows have no room for the tool in any roll."""
        without = np.zeros(len(queries), bool)
        asked = np.flatnonzero(rows & queries.free)
        if self._room is not None and len(asked):
            without[asked] = ~self._room.is_there(queries.take(asked))
        return without

    def decide(
        self, queries: Queries, matches: Matches, share: FloatArray
    ) -> tuple[Matches, CodeArray]:
        """Choose the test grasps that represent grasps, by the verdicts between them.

        Parameters
        ----------
        queries : Queries
        matches : Matches
            Nearest test grasps.
        share : array, shape (n,)
            As :meth:`share_reached` gives it.

        Returns
        -------
        matches : Matches
            The same, but for grasps that are reached though their nearest test grasp
            is not: the nearest that is.
        causes : uint8 array, shape (n,)
            For grasps that are not reached though their test grasp is, what became of
            the nearest refining grasp that is not reached; else 0.
        """
        # A test grasp itself is known.
        own = (matches.distance_m < TIE_M) & (matches.angle_rad < TIE_RAD)
        decided = queries.free & queries.valid & ~own
        reached = share >= REACHED_FROM
        reachable = self._table.reachable[matches.point, matches.orientation]
        unreached = decided & ~reached & reachable
        matches = self._rematched(queries, matches, decided & reached & ~reachable)
        return matches, self._causes(queries, unreached)

    def _rematched(
        self, queries: Queries, matches: Matches, rows: BoolArray
    ) -> Matches:
        """Give rows the nearest test grasp that has a path, if there is one."""
        table = self._table
        if not rows.any() or not len(self._place):
            return matches
        nearest = self._reachable.to(queries.take(np.flatnonzero(rows)))
        point, orientation = matches.point.copy(), matches.orientation.copy()
        point[rows], orientation[rows] = self._place[nearest], self._turn[nearest]
        offset = queries.points - table.points[point]
        return replace(
            matches,
            point=point,
            orientation=orientation,
            distance_m=np.where(
                rows, np.linalg.norm(offset, axis=1), matches.distance_m
            ),
            angle_rad=np.where(
                rows,
                direction_angle(queries.axes, table.axes[point, orientation]),
                matches.angle_rad,
            ),
        )

    def _causes(self, queries: Queries, rows: BoolArray) -> CodeArray:
        status = np.where(rows, np.uint8(Status.NO_PATH_FOUND), np.uint8(0))
        if rows.any() and len(self._cause):
            nearest = self._failed.to(queries.take(np.flatnonzero(rows)))
            status[rows] = self._cause[nearest]
        status[self._without_room(queries, rows)] = Status.IK_IN_COLLISION
        return status


class _NearestGrasps:
    """Grasps to be searched for the one that the tool has to move least to."""

    def __init__(self, points: FloatArray, axes: FloatArray, lever_m: float) -> None:
        self._lever_m = lever_m
        self._points = NearestPoints(tool_points(points, axes, lever_m))

    def to(self, queries: Queries) -> IntArray:
        """Index of the nearest to each, the first of several as near; shape (n,)."""
        asked = tool_points(queries.points, queries.axes, self._lever_m)
        return self._points.in_order(asked, 1)[1][:, 0]
