"""The nearest test grasp of each grasp: φ1 over points, then φ2 over orientations.

Ties are common, not accidents: the rolls of one approach direction tie for a grasp
whose roll is free, and a grasp midway between grid points ties in φ1. They are decided
within stated tolerances, so that rounding never is what decides: among all test grasps
that tie, the path-reachable one of least cost wins, then the first in map order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.geometry import direction_angle
from reachmap.ranking.table import GraspTable, quaternion_angle

TIE_M: Final = 1e-6
TIE_RAD: Final = 1e-6
# A point of a lattice has at most seven others at the same distance from a grasp.
TIED_POINTS: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Queries:
    """Grasps to be matched, in robot_base.

    Attributes
    ----------
    points : array, shape (n, 3)
    axes : array, shape (n, 3)
        Unit approach directions.
    quaternions : array, shape (n, 4)
        Unit; read only where the roll is not free.
    free : bool array, shape (n,)
        Whether the roll about the approach is left out of the comparison.
    """

    points: FloatArray
    axes: FloatArray
    quaternions: FloatArray
    free: BoolArray

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, slots=True, kw_only=True)
class Matches:
    """The test grasp of each grasp. Rows as in the queries.

    Attributes
    ----------
    point, orientation : int array, shape (n,)
    distance : array, shape (n,)
        φ1 [m].
    angle : array, shape (n,)
        φ2 [rad]; between approach axes where the roll is free.
    """

    point: IntArray
    orientation: IntArray
    distance: FloatArray
    angle: FloatArray


def build_tree(table: GraspTable) -> cKDTree:
    """Build the k-d tree over test points; it may be queried from several threads."""
    return cKDTree(table.points)


def match(
    queries: Queries, table: GraspTable, tree: cKDTree, cost: FloatArray
) -> Matches:
    """Find the nearest test grasp of each grasp, as Algorithm 1 does.

    Parameters
    ----------
    queries : Queries
    table : GraspTable
    tree : cKDTree
        Of ``table.points``.
    cost : array, shape (points, orientations)
        J of each test grasp, inf where unreachable; decides ties.
    """
    distance, point = nearest_points(queries.points, tree, 2)
    matches = match_at(queries, table, point[:, 0], distance[:, 0], cost)
    if distance.shape[1] > 1:
        # Few grasps lie midway between points; only they are looked at again.
        midway = np.flatnonzero(distance[:, 1] - distance[:, 0] <= TIE_M)
        if midway.size:
            _rematch(matches, midway, queries, table, tree, cost)
    return matches


def nearest_points(
    points: FloatArray, tree: cKDTree, k: int
) -> tuple[FloatArray, IntArray]:
    """Distances [m] and numbers of the k nearest test points, shapes (n, k).

    Fewer columns when the map has fewer points.
    """
    k = min(k, tree.n)
    distance, index = tree.query(points, k=k)
    return distance.reshape(-1, k), np.asarray(index, np.int64).reshape(-1, k)


def match_at(
    queries: Queries,
    table: GraspTable,
    point: IntArray,
    distance: FloatArray,
    cost: FloatArray,
) -> Matches:
    """Match each grasp among the orientations of a given test point.

    Parameters
    ----------
    queries : Queries
    table : GraspTable
    point : int array, shape (n,)
    distance : array, shape (n,)
        φ1 to that point [m].
    cost : array, shape (points, orientations)
    """
    angles = _angles(queries, table, np.arange(len(queries)), point)
    orientation, angle = _least(angles, cost[point])
    return Matches(
        point=point.copy(),
        orientation=orientation,
        distance=distance.copy(),
        angle=angle,
    )


def tied(query: Queries, table: GraspTable, tree: cKDTree) -> tuple[IntArray, IntArray]:
    """List the test grasps that tie for one grasp, in map order.

    Parameters
    ----------
    query : Queries
        Of length 1.

    Returns
    -------
    point, orientation : int array, shape (t,)
    """
    _, point, angles = _candidates(query, np.array([0]), table, tree)
    column, orientation = np.nonzero(angles[0] <= angles.min() + TIE_RAD)
    return point[0, column], orientation


def _rematch(
    matches: Matches,
    rows: IntArray,
    queries: Queries,
    table: GraspTable,
    tree: cKDTree,
    cost: FloatArray,
) -> None:
    """Match rows again over all points that tie in φ1."""
    distance, point, angles = _candidates(queries, rows, table, tree)
    flat = angles.reshape(len(rows), -1)
    best, angle = _least(flat, cost[point].reshape(len(rows), -1))
    column, orientation = np.divmod(best, angles.shape[2])
    every = np.arange(len(rows))
    matches.point[rows] = point[every, column]
    matches.orientation[rows] = orientation
    matches.distance[rows] = distance[every, column]
    matches.angle[rows] = angle


def _candidates(
    queries: Queries, rows: IntArray, table: GraspTable, tree: cKDTree
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Nearest points of some grasps, with angles: inf at points that do not tie."""
    distance, point = nearest_points(queries.points[rows], tree, TIED_POINTS)
    # In map order, so that "the first" means the same on every machine.
    order = np.argsort(point, axis=1)
    point = np.take_along_axis(point, order, axis=1)
    distance = np.take_along_axis(distance, order, axis=1)
    count = point.shape[1]
    repeated = np.repeat(rows, count)
    angles = _angles(queries, table, repeated, point.ravel())
    angles = angles.reshape(len(rows), count, -1)
    near = distance <= distance.min(axis=1, keepdims=True) + TIE_M
    return distance, point, np.where(near[..., None], angles, np.inf)


def _angles(
    queries: Queries, table: GraspTable, rows: IntArray, point: IntArray
) -> FloatArray:
    """φ2 from grasps to every orientation of one point each, shape (n, m)."""
    free = queries.free[rows]
    if free.all():
        return direction_angle(queries.axes[rows][:, None], table.axes[point])
    if not free.any():
        quaternions = queries.quaternions[rows][:, None]
        return quaternion_angle(quaternions, table.quaternions[point])
    angles = np.empty((len(rows), table.axes.shape[1]))
    for part in (free, ~free):
        angles[part] = _angles(queries, table, rows[part], point[part])
    return angles


def _least(angles: FloatArray, cost: FloatArray) -> tuple[IntArray, FloatArray]:
    """Column of the least angle in each row; ties go to the least cost, then first."""
    near = angles <= angles.min(axis=1, keepdims=True) + TIE_RAD
    # Rounded, so that costs equal but for the last digit count as equal; an
    # unreachable test grasp that ties still wins over one that does not tie.
    worth = np.where(near, np.minimum(np.round(cost, 12), 1e300), np.inf)
    best = np.argmin(worth, axis=1)
    return best, angles[np.arange(len(angles)), best]
