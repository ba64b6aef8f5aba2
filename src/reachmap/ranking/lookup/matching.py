"""The nearest test grasp of each grasp: φ1 over points, then φ2 over orientations.

Ties are common, not accidents: the rolls of one approach direction tie for a grasp
whose roll is free, and a grasp midway between grid points ties in φ1. They are decided
within stated tolerances, so that rounding never is what decides: among all test grasps
that tie, the path-reachable one of least cost wins, then the first in map order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.geometry import direction_angle
from reachmap.ranking.lookup.table import GraspTable, quaternion_angle

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Importing scipy's k-d tree takes half a second, comparing this many pairs of points
# a few milliseconds: a single command that ranks one image never needs the tree.
FEW_PAIRS: Final = 100_000


class NearestPoints:
    """Test points to be searched, from several threads if need be.

    Few pairs are compared one by one, many are looked up in a k-d tree, which is built
    when it is first needed.

    Parameters
    ----------
    points : array, shape (p, 3)
        [m].
    """

    def __init__(self, points: FloatArray) -> None:
        self._points = points
        self._tree: cKDTree | None = None

    def query(self, points: FloatArray, k: int) -> tuple[FloatArray, IntArray]:
        """Distances [m] and numbers of the k nearest, nearest first, shapes (n, k).

        Fewer columns when there are fewer points. The order of points at the same
        distance means nothing.
        """
        k = min(k, len(self._points))
        if len(points) * len(self._points) <= FEW_PAIRS and self._tree is None:
            return self._compared(points, k)
        distance, index = self._grown_tree().query(points, k=k)
        return distance.reshape(-1, k), np.asarray(index, np.int64).reshape(-1, k)

    def in_order(self, points: FloatArray, k: int) -> tuple[FloatArray, IntArray]:
        """Like :meth:`query`, with points at the same distance in map order."""
        distance, point = self.query(points, k + TIED_POINTS)
        order = np.lexsort((point, np.round(distance, 9)), axis=1)[:, :k]
        return (
            np.take_along_axis(distance, order, axis=1),
            np.take_along_axis(point, order, axis=1),
        )

    def _compared(self, points: FloatArray, k: int) -> tuple[FloatArray, IntArray]:
        # One axis at a time: an array (n, k, 3) takes several times as long.
        square = np.zeros((len(points), len(self._points)))
        for column, own in zip(points.T, self._points.T, strict=True):
            square += (column[:, None] - own) ** 2
        if k == 2:
            index = _two_least(square)
        else:
            index = np.argpartition(square, k - 1, axis=1)[:, :k]
        near = np.take_along_axis(square, index, axis=1)
        order = np.argsort(near, axis=1, kind="stable")
        distance = np.sqrt(np.take_along_axis(near, order, axis=1))
        return distance, np.take_along_axis(index, order, axis=1)

    def _grown_tree(self) -> cKDTree:
        if self._tree is None:
            from scipy.spatial import cKDTree

            self._tree = cKDTree(self._points)
        return self._tree


def _two_least(values: FloatArray) -> IntArray:
    """Columns of the two least of each row (n, 2); a partition takes far longer."""
    first = values.argmin(axis=1)
    rest = values.copy()
    rest[np.arange(len(values)), first] = np.inf
    return np.stack([first, rest.argmin(axis=1)], axis=1)


# Distances this close are equal: positions in lists are rounded to the micrometre.
TIE_M: Final = 1e-6
TIE_RAD: Final = 1e-6
# A point of a lattice has at most seven others at the same distance from a grasp.
TIED_POINTS: Final = 8
# The test points around a grasp: a cube of three by three by three.
PASSED_POINTS: Final = 27


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
    valid : bool array, shape (n,)
        Whether the row is a grasp at all; the others hold stand-ins.
    """

    points: FloatArray
    axes: FloatArray
    quaternions: FloatArray
    free: BoolArray
    valid: BoolArray

    def __len__(self) -> int:
        return len(self.points)

    def take(self, rows: IntArray) -> Queries:
        """Return some of the grasps."""
        return Queries(
            points=self.points[rows],
            axes=self.axes[rows],
            quaternions=self.quaternions[rows],
            free=self.free[rows],
            valid=self.valid[rows],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Matches:
    """The test grasp of each grasp. Rows as in the queries.

    Attributes
    ----------
    point, orientation : int array, shape (n,)
    distance_m : array, shape (n,)
        φ1 [m].
    angle_rad : array, shape (n,)
        φ2 [rad]; between approach axes where the roll is free.
    """

    point: IntArray
    orientation: IntArray
    distance_m: FloatArray
    angle_rad: FloatArray


def match(
    queries: Queries, table: GraspTable, tree: NearestPoints, cost: FloatArray
) -> Matches:
    """Find the nearest test grasp of each grasp, as Algorithm 1 does.

    Parameters
    ----------
    queries : Queries
    table : GraspTable
    tree : NearestPoints
        Of ``table.points``.
    cost : array, shape (points, orientations)
        J of each test grasp, inf where unreachable; decides ties.
    """
    tie_cost = tie_costs(cost)
    distance, point = tree.query(queries.points, 2)
    matches = match_at(queries, table, point[:, 0], distance[:, 0], tie_cost)
    if distance.shape[1] > 1:
        # Few grasps lie midway between points; only they are looked at again.
        midway = np.flatnonzero(distance[:, 1] - distance[:, 0] <= TIE_M)
        if midway.size:
            _rematch(matches, midway, queries, table, tree, tie_cost)
    return matches


def tie_costs(cost: FloatArray) -> FloatArray:
    """Costs as ties compare them: to twelve decimals, and never infinite.

    Rounded, costs that differ in the last digit count as equal. Below infinity, an
    unreachable test grasp that ties still wins over one that does not tie.
    """
    return np.minimum(np.round(cost, 12), 1e300)


def match_at(
    queries: Queries,
    table: GraspTable,
    point: IntArray,
    distance: FloatArray,
    tie_cost: FloatArray,
) -> Matches:
    """Match each grasp among the orientations of a given test point.

    Parameters
    ----------
    queries : Queries
    table : GraspTable
    point : int array, shape (n,)
    distance : array, shape (n,)
        φ1 to that point [m].
    tie_cost : array, shape (points, orientations)
        Costs from :func:`tie_costs`.
    """
    cosines = _cosines(queries, table, point)
    first = np.argmax(cosines, axis=1)
    near = cosines >= _tie_limit(queries, table, point, first)[:, None]
    orientation = np.argmin(np.where(near, tie_cost[point], np.inf), axis=1)
    return Matches(
        point=point.copy(),
        orientation=orientation,
        distance_m=distance.copy(),
        angle_rad=_angles(queries, table, point, orientation),
    )


def match_past(
    matches: Matches,
    rows: IntArray,
    left_out: BoolArray,
    queries: Queries,
    table: GraspTable,
    tree: NearestPoints,
    cost: FloatArray,
) -> Matches:
    """Match some grasps again, skipping test grasps that do not apply to them.

    Parameters
    ----------
    matches : Matches
        From :func:`match`.
    rows : int array, shape (m,)
        Grasps to match again; one without another near test grasp stays as it is.
    left_out : bool array, shape (points, orientations)
        Test grasps to skip.
    queries, table, tree, cost
        As in :func:`match`.
    """
    if not rows.size:
        return matches
    values = {name: getattr(matches, name).copy() for name in Matches.__slots__}
    some, tie_cost = queries.take(rows), tie_costs(cost)
    distance, point = tree.in_order(some.points, PASSED_POINTS)
    open_ = np.ones(len(rows), bool)
    for column in range(point.shape[1]):
        near = match_at(some, table, point[:, column], distance[:, column], tie_cost)
        fits = open_ & ~left_out[near.point, near.orientation]
        for name, column_of in values.items():
            column_of[rows[fits]] = getattr(near, name)[fits]
        open_ &= ~fits
    return Matches(**values)


def tied(
    query: Queries, table: GraspTable, tree: NearestPoints
) -> tuple[IntArray, IntArray]:
    """List the test grasps that tie for one grasp, in map order.

    Parameters
    ----------
    query : Queries
        Of length 1.

    Returns
    -------
    point, orientation : int array, shape (t,)
    """
    _, point, near = _tied_points(query, table, tree)
    column, orientation = np.nonzero(near[0])
    return point[0, column], orientation


def _rematch(
    matches: Matches,
    rows: IntArray,
    queries: Queries,
    table: GraspTable,
    tree: NearestPoints,
    tie_cost: FloatArray,
) -> None:
    """Match rows again over all points that tie in φ1."""
    part = queries.take(rows)
    distance, point, near = _tied_points(part, table, tree)
    flat = np.where(near, tie_cost[point], np.inf).reshape(len(rows), -1)
    column, orientation = np.divmod(np.argmin(flat, axis=1), near.shape[2])
    every = np.arange(len(rows))
    matches.point[rows] = point[every, column]
    matches.orientation[rows] = orientation
    matches.distance_m[rows] = distance[every, column]
    matches.angle_rad[rows] = _angles(part, table, point[every, column], orientation)


def _tied_points(
    queries: Queries, table: GraspTable, tree: NearestPoints
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Nearest points (n, k), and which of their orientations tie (n, k, m)."""
    distance, point = tree.query(queries.points, TIED_POINTS)
    # In map order, so that "the first" means the same on every machine.
    order = np.argsort(point, axis=1)
    point = np.take_along_axis(point, order, axis=1)
    distance = np.take_along_axis(distance, order, axis=1)
    n, k = point.shape
    repeated = queries.take(np.repeat(np.arange(n), k))
    cosines = _cosines(repeated, table, point.ravel()).reshape(n, k, -1)
    close = distance <= distance.min(axis=1, keepdims=True) + TIE_M
    cosines = np.where(close[..., None], cosines, -np.inf)
    flat = np.argmax(cosines.reshape(n, -1), axis=1)
    column, first = np.divmod(flat, cosines.shape[2])
    limit = _tie_limit(queries, table, point[np.arange(n), column], first)
    return distance, point, cosines >= limit[:, None, None]


def _cosines(queries: Queries, table: GraspTable, point: IntArray) -> FloatArray:
    """Cosine of φ2 where the roll is free, else of φ2 / 2; shape (n, m).

    Both fall as φ2 grows, and cost no inverse function for every test grasp. Their
    rounding hides angles below about 1e-8, a hundredth of what counts as a tie.
    """
    free = queries.free
    if free.all():
        return products(queries.axes, table.distinct(table.axes), point)
    if not free.any():
        quaternions = table.distinct(table.quaternions)
        return np.abs(products(queries.quaternions, quaternions, point))
    cosines = np.empty((len(queries), table.axes.shape[1]))
    for rows in (np.flatnonzero(free), np.flatnonzero(~free)):
        cosines[rows] = _cosines(queries.take(rows), table, point[rows])
    return cosines


def products(vectors: FloatArray, stored: FloatArray, point: IntArray) -> FloatArray:
    """Scalar products with every orientation of one point each, shape (n, m).

    Where all points have the same orientations, those of one will do.
    """
    if len(stored) == 1:
        return np.asarray(vectors @ stored[0].T)
    return np.asarray(np.einsum("nk,nmk->nm", vectors, stored[point]))


def _tie_limit(
    queries: Queries, table: GraspTable, point: IntArray, orientation: IntArray
) -> FloatArray:
    """Least cosine that ties with a given, nearest orientation; shape (n,)."""
    limit = _angles(queries, table, point, orientation) + TIE_RAD
    limit = np.minimum(limit, np.pi)
    return np.cos(np.where(queries.free, limit, 0.5 * limit)) - 1e-15


def _angles(
    queries: Queries, table: GraspTable, point: IntArray, orientation: IntArray
) -> FloatArray:
    """φ2 to one orientation each, to full precision; shape (n,)."""
    axes = direction_angle(queries.axes, table.axes[point, orientation])
    if queries.free.all():
        return axes
    turns = quaternion_angle(queries.quaternions, table.quaternions[point, orientation])
    return np.where(queries.free, axes, turns)
