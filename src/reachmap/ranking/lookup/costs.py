"""The cost of grasps: the requested terms, their median over neighbours, likeness.

J = α φ3 + β φ4 + δ φ5 + ε φ6, with φ3, φ4, φ5 the mean path length, planning time and
execution time of the test grasp, each divided by a high quantile (or the maximum) over
the path-reachable test grasps of the map, and φ6 how unlike its test grasp a grasp is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.errors import SettingsError
from reachmap.ranking.lookup.matching import Matches, NearestPoints, Queries
from reachmap.ranking.lookup.settings import ALIKE_STEPS, MARGINS, RankSettings
from reachmap.ranking.lookup.table import TERMS, GraspTable
from reachmap.ranking.terms import PLANNING, CycleSeconds

LIKENESS = "likeness"


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Terms that belong to test grasps.

    Attributes
    ----------
    names : tuple of str, length k
    weights : array, shape (k,)
    values : array, shape (points, orientations, k)
        Before weighting; NaN where unreachable.
    """

    names: tuple[str, ...]
    weights: FloatArray
    values: FloatArray

    def costs(self) -> FloatArray:
        """Weighted sum for every test grasp, shape (points, orientations).

        Infinite where unreachable.
        """
        cost = self.values @ self.weights
        return np.where(np.isnan(cost), np.inf, cost)


def columns_of(table: GraspTable, settings: RankSettings) -> Columns:
    """Arrange the requested terms.

    Raises
    ------
    SettingsError
        Margins or seconds are asked for and the map has none.
    """
    if settings.cost == "cycle":
        return _seconds(table, cycle_of(table))
    columns = Columns(
        names=TERMS,
        weights=np.asarray(settings.weights, float),
        values=table.normalised,
    )
    asked = [name for name in MARGINS if settings.margins.get(name)]
    if not asked:
        return columns
    if table.margins is None:
        raise SettingsError(
            f"{', '.join(asked)}: the map has no margins, as those of format 1.0; "
            "scan the bin again"
        )
    values = table.margins[..., [MARGINS.index(name) for name in asked]]
    return Columns(
        names=(*TERMS, *asked),
        weights=np.append(columns.weights, [settings.margins[k] for k in asked]),
        values=np.concatenate([columns.values, values], axis=-1),
    )


def cycle_of(table: GraspTable) -> CycleSeconds:
    """Seconds of whole picks.

    Raises
    ------
    SettingsError
        The map has none.
    """
    if table.cycle is None:
        raise SettingsError(
            "cost cycle: the map has paths to grasps but no whole cycles; give "
            "the cell part, lift and drop_off and scan the bin again, or rank by cost "
            "paper"
        )
    return table.cycle


def _seconds(table: GraspTable, cycle: CycleSeconds) -> Columns:
    planning = np.where(cycle.whole, table.means[..., TERMS.index("planning_time")], 0)
    values = np.concatenate([cycle.values, planning[..., None]], axis=-1)
    return Columns(
        names=(*cycle.names, PLANNING),
        weights=np.ones(values.shape[-1]),
        values=values,
    )


# Beyond half a grid diagonal sideways, and so far above or below the layers: grasp
# points of a heap lie centimetres above and below the height that stands for them.
SIDEWAYS_TOLERANCE_M: Final = 1e-3
VERTICAL_TOLERANCE_M: Final = 0.05
BOTTOM_TOLERANCE_M: Final = 5e-3
MIN_DISTANCE_M: Final = 1e-6
# Width of the kernel of likeness in spacings of the orientations. Chosen on maps of the
# machine door and the two bins of benchmarks/hard_cells, where 0.2 to 0.4 hardly differ
# (docs/explanation/prediction.md).
MEDIAN_STEPS: Final = 0.3
# Grasps that are compared with all their neighbours at once: some 100 MB.
ROWS_AT_ONCE: Final = 2000


def outside_map(points: FloatArray, nearest: IntArray, table: GraspTable) -> BoolArray:
    """Which grasps lie outside the map, shape (n,).

    A grasp is outside when it is sideways of its nearest test point by more than half
    a grid diagonal and a millimetre, or below the lowest or above the highest layer by
    more than 5 cm (half the distance of the layers, if that is more), or more than
    5 mm below the bin's bottom.

    Parameters
    ----------
    points : array, shape (n, 3)
        In robot_base [m].
    nearest : int array, shape (n,)
        Nearest test points.
    table : GraspTable
    """
    p = points @ table.T_bin_base[:3, :3].T + table.T_bin_base[:3, 3]
    sideways = np.hypot(*(p - table.bin_points[nearest])[:, :2].T)
    reach = 0.5 * float(np.hypot(*table.pitch)) + SIDEWAYS_TOLERANCE_M
    step = float(np.diff(table.layers).max(initial=0.0))
    margin = max(0.5 * step, VERTICAL_TOLERANCE_M)
    low = max(float(table.layers[0]) - margin, -BOTTOM_TOLERANCE_M)
    high = float(table.layers[-1]) + margin
    return np.asarray((sideways > reach) | (p[:, 2] < low) | (p[:, 2] > high))


def unlike_map(
    matches: Matches, free: BoolArray, table: GraspTable, max_angle_deg: float | None
) -> BoolArray:
    """Which grasps are turned too far from every orientation of the map, shape (n,).

    Too far is more than ``max_angle_deg``, or than 1.5 times the greatest angle between
    neighbouring orientations (of approach axes where the roll is free).
    """
    if max_angle_deg is not None:
        return np.asarray(matches.angle > np.radians(max_angle_deg))
    spacing = np.where(free, table.spacing_rad[0], table.spacing_rad[1])
    return np.asarray(matches.angle > ALIKE_STEPS * spacing)


def beyond_points(points: FloatArray, table: GraspTable) -> BoolArray:
    """Which grasps lie sideways of all test points, where costs extrapolate, (n,)."""
    p = points @ table.T_bin_base[:3, :3].T + table.T_bin_base[:3, 3]
    low, high = table.bin_points.min(axis=0), table.bin_points.max(axis=0)
    slack = MIN_DISTANCE_M
    return np.asarray(((p < low - slack) | (p > high + slack))[:, :2].any(axis=1))


def likeness_terms(matches: Matches, free: BoolArray, table: GraspTable) -> FloatArray:
    """φ6: distance between a grasp and its test grasp, shape (n,).

    φ6 = ½ (φ1 / h + φ2 / ω), where h is the larger pitch of the grid and ω the
    greatest angle between neighbouring orientations of the map (of approach axes where
    the roll is free). 0 on a test grasp, about 1 a whole step away in both.
    """
    h = float(table.pitch.max())
    spacing = np.where(free, table.spacing_rad[0], table.spacing_rad[1])
    return np.asarray(0.5 * (matches.distance / h + matches.angle / spacing))


def median_terms(
    phi: FloatArray,
    queries: Queries,
    table: GraspTable,
    tree: NearestPoints,
    columns: Columns,
    neighbours: int,
) -> FloatArray:
    """Terms of the test grasp of median cost among the reachable ones around a grasp.

    Those of the k nearest test points count by the inverse of their distance, and at
    each point those of like orientation by a von Mises-Fisher kernel. A median rather
    than a mean, since an arm reaches neighbours by ways of very different length, and
    a way between two of them is none. Whether a grasp is reachable is still decided by
    its nearest test grasp alone.

    Parameters
    ----------
    phi : array, shape (n, k)
        Terms of the nearest test grasps; NaN where unreachable.
    queries, table, tree
        The grasps, the test grasps, and where to look.
    columns : Columns
    neighbours : int

    Returns
    -------
    array, shape (n, k)
        NaN where the nearest test grasp is unreachable.
    """
    terms, cost = phi.copy(), columns.costs()
    for free in (True, False):
        rows = np.flatnonzero((queries.free == free) & ~np.isnan(phi[:, 0]))
        if not rows.size:
            continue
        for part in np.array_split(rows, -(-len(rows) // ROWS_AT_ONCE)):
            some = queries.take(part)
            distance, point = tree.in_order(some.points, neighbours)
            weight = _likeness(some, table, point, free=free)
            weight /= np.maximum(distance, MIN_DISTANCE_M)[..., None]
            row, middle = _weighted_median(
                cost[point].reshape(len(part), -1), weight.reshape(len(part), -1)
            )
            near, orientation = np.divmod(middle, cost.shape[1])
            terms[part[row]] = columns.values[point[row, near], orientation]
    return terms


def _likeness(
    queries: Queries,
    table: GraspTable,
    point: IntArray,
    *,
    free: bool,
) -> FloatArray:
    """Kernel of φ2, 1 for the most alike at each point (n, k); shape (n, k, m)."""
    stored = table.axes if free else table.quaternions
    vectors = queries.axes if free else queries.quaternions
    cosine = np.einsum("nk,npmk->npm", vectors, stored[point])
    if not free:
        # Between quaternions the product is the cosine of half the angle.
        cosine = 2.0 * cosine**2 - 1.0
    width = MEDIAN_STEPS * float(table.spacing_rad[0 if free else 1])
    return np.asarray(np.exp((cosine - cosine.max(axis=-1, keepdims=True)) / width**2))


def _weighted_median(cost: FloatArray, weight: FloatArray) -> tuple[IntArray, IntArray]:
    """Rows (m,) with finite costs, and the column of their weighted median (m,).

    Parameters
    ----------
    cost, weight : array, shape (n, k)
    """
    weight = np.where(np.isfinite(cost), weight, 0.0)
    known = np.flatnonzero(weight.sum(axis=1) > 0)
    order = np.argsort(cost[known], axis=1, kind="stable")
    sums = np.cumsum(np.take_along_axis(weight[known], order, axis=1), axis=1)
    middle = np.argmax(sums >= 0.5 * sums[:, -1:], axis=1)
    return known, order[np.arange(len(known)), middle]
