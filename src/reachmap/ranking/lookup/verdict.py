"""Verdicts between the test grasps, from the grasps of a map's refinement.

A test grasp represents a box of positions and a cone of directions, through which the
boundary of what is reachable may run. A refined map has further grasps along that
boundary; a regression over them decides, and a test grasp near by gives the cost.
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
from reachmap.ranking.lookup.matching import TIE_M, TIE_RAD, Matches, Queries
from reachmap.ranking.lookup.table import GraspTable
from reachmap.sampling.regression import (
    GraspRegression,
    squared_distances,
    tool_points,
)

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
    """

    def __init__(self, refinement: Refinement, table: GraspTable) -> None:
        R = rotation_from_quaternion_wxyz(refinement.quaternion_wxyz)
        self._axes = R @ axis_vector(table.approach_axis)
        self._refinement, self._table = refinement, table
        reached = refinement.status == Status.PATH_FOUND
        self._regression = GraspRegression.fit(
            refinement.position,
            self._axes,
            reached.astype(float),
            refinement.lever_m,
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
        return np.clip(estimate, _LEAST_SHARE, 1.0 - _LEAST_SHARE)

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
        own = (matches.distance < TIE_M) & (matches.angle < TIE_RAD)
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
        place, turn = np.nonzero(table.reachable)
        if not rows.any() or not len(place):
            return matches
        part = queries.take(np.flatnonzero(rows))
        nearest = self._nearest(part, table.points[place], table.axes[place, turn])
        point, orientation = matches.point.copy(), matches.orientation.copy()
        point[rows], orientation[rows] = place[nearest], turn[nearest]
        offset = queries.points - table.points[point]
        return replace(
            matches,
            point=point,
            orientation=orientation,
            distance=np.where(rows, np.linalg.norm(offset, axis=1), matches.distance),
            angle=np.where(
                rows,
                direction_angle(queries.axes, table.axes[point, orientation]),
                matches.angle,
            ),
        )

    def _causes(self, queries: Queries, rows: BoolArray) -> CodeArray:
        status = np.where(rows, np.uint8(Status.NO_PATH_FOUND), np.uint8(0))
        failed = np.flatnonzero(self._refinement.status != Status.PATH_FOUND)
        if rows.any() and len(failed):
            part = queries.take(np.flatnonzero(rows))
            nearest = self._nearest(
                part, self._refinement.position[failed], self._axes[failed]
            )
            status[rows] = self._refinement.status[failed[nearest]]
        return status

    def _nearest(
        self, queries: Queries, points: FloatArray, axes: FloatArray
    ) -> IntArray:
        """Index of the grasp with the least tool motion, shape (n,)."""
        lever_m = self._refinement.lever_m
        asked = tool_points(queries.points, queries.axes, lever_m)
        nodes = tool_points(points, axes, lever_m)
        return np.array(
            [int(squared_distances(one[None], nodes).argmin()) for one in asked],
            np.int64,
        )
