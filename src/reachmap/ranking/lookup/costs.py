"""The cost of grasps, and the order it puts them in, with a reason for each.

J = α φ3 + β φ4 + δ φ5 + ε φ6, with φ3, φ4, φ5 the mean path length, planning time and
execution time of the test grasp, each divided by a high quantile (or the maximum) over
the path-reachable test grasps of the map, and φ6 how unlike its test grasp a grasp is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.errors import SettingsError
from reachmap.geometry import transform_points
from reachmap.maps.parts import Compared, StageStatus, freeze
from reachmap.ranking.lookup.matching import Matches, NearestPoints, Queries
from reachmap.ranking.lookup.probability import orientation_kernel
from reachmap.ranking.lookup.settings import ALIKE_STEPS, MARGINS, RankSettings
from reachmap.ranking.lookup.table import TERMS, GraspTable
from reachmap.ranking.terms import PLANNING, CycleSeconds

LIKENESS: Final = "likeness"
# Beyond half a grid diagonal sideways, and this far above or below the layers: grasp
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

# In place of a state, from the top of a byte downwards: states count from 0.
OUTSIDE_MAP: Final = 254
UNLIKE_MAP: Final = 253
INVALID: Final = 252
UNMATCHED: Final = {
    OUTSIDE_MAP: "outside_map",
    UNLIKE_MAP: "unlike_map",
    INVALID: "invalid",
}
"""States of grasps that the map says nothing about, beside those of test grasps."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ranking(Compared):
    """The order of a list of grasps, and why. Rows are in supplied order.

    Attributes
    ----------
    order : int array, shape (n,)
        Supplied numbers of the grasps, best first; unreachable ones last in their
        supplied order.
    cost : array, shape (n,)
        J, or predicted seconds per pick; inf where unreachable.
    terms : array, shape (n, k)
        α φ3, β φ4, δ φ5, ε φ6 and the margins that were asked for, each with its
        weight, or seconds by stage; they add up to the cost. NaN where unreachable.
    term_names : tuple of str, length k
    status : uint8 array, shape (n,)
        :class:`reachmap.maps.records.Status` of the test grasp, or ``OUTSIDE_MAP``
        (too far from the test points), ``UNLIKE_MAP`` (no orientation is near enough)
        or ``INVALID`` (not finite, no direction, no rotation). Where the cost is of
        cycles, :class:`reachmap.maps.parts.StageStatus` of the stage that fails.
    test_grasp : int array, shape (n, 4)
        Layer, y, x, orientation of the nearest test grasp; -1 where invalid.
    distance : array, shape (n,)
        φ1 [m].
    angle : array, shape (n,)
        φ2 [rad]; between approach axes where the roll is free.
    roll_free : bool array, shape (n,)
    extrapolated : bool array, shape (n,)
        Beyond the outermost test points, where the map continues what it knows.
    probability : array, shape (n,)
        That planning reaches the grasp: calibrated where the ranker has a calibration,
        else the share reached around it; NaN where the map says nothing.
    orientation_wxyz : array, shape (n, 4)
        The tool orientation to use, in robot_base: R_test of the test grasp, turned
        about the approach by the roll that its best path takes, where roll is free.
    """

    order: IntArray
    cost: FloatArray
    terms: FloatArray
    term_names: tuple[str, ...]
    status: CodeArray
    test_grasp: IntArray
    distance: FloatArray
    angle: FloatArray
    roll_free: BoolArray
    extrapolated: BoolArray
    probability: FloatArray
    orientation_wxyz: FloatArray

    def __post_init__(self) -> None:
        freeze(self)

    def __repr__(self) -> str:
        return f"<Ranking: {len(self.order)} grasps, {self.reachable.sum()} reachable>"

    @property
    def rank(self) -> IntArray:
        """Rank of each grasp, from 1, in supplied order; shape (n,)."""
        rank = np.empty(len(self.order), np.int64)
        rank[self.order] = np.arange(1, len(self.order) + 1)
        return rank

    @property
    def reachable(self) -> BoolArray:
        """Where the cost is finite, shape (n,)."""
        return np.isfinite(self.cost)


def status_name(code: int) -> str:
    """Name of a status code as files have it, ``path_found`` for one."""
    return UNMATCHED.get(int(code)) or StageStatus(int(code)).name.lower()


def stable_order(cost: FloatArray, scores: ArrayLike | None = None) -> IntArray:
    """Order of costs, shape (n,): ties by score, higher first, then as supplied.

    Costs that differ by rounding only, beyond the twelfth decimal, tie. Infinite costs
    come last in supplied order whatever their scores; so do missing (NaN) scores among
    ties.
    """
    key = np.round(cost, 12)
    if scores is None:
        return np.argsort(key, kind="stable")
    given = np.asarray(scores, float)
    worst_first = np.where(np.isnan(given), -np.inf, given)
    second = np.where(np.isfinite(cost), -worst_first, 0.0)
    return np.lexsort((second, key))


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
    p = transform_points(table.T_bin_base, points)
    sideways = np.hypot(*(p - table.bin_points[nearest])[:, :2].T)
    reach = 0.5 * float(np.hypot(*table.pitch_m)) + SIDEWAYS_TOLERANCE_M
    step = float(np.diff(table.layers_m).max(initial=0.0))
    margin = max(0.5 * step, VERTICAL_TOLERANCE_M)
    low = max(float(table.layers_m[0]) - margin, -BOTTOM_TOLERANCE_M)
    high = float(table.layers_m[-1]) + margin
    return np.asarray((sideways > reach) | (p[:, 2] < low) | (p[:, 2] > high))


def unlike_map(
    matches: Matches, free: BoolArray, table: GraspTable, max_angle_deg: float | None
) -> BoolArray:
    """Which grasps are turned too far from every orientation of the map, shape (n,).

    Too far is more than ``max_angle_deg``, or than 1.5 times the greatest angle between
    neighbouring orientations (of approach axes where the roll is free).
    """
    if max_angle_deg is not None:
        return np.asarray(matches.angle_rad > np.radians(max_angle_deg))
    spacing = np.where(free, table.spacing_rad[0], table.spacing_rad[1])
    return np.asarray(matches.angle_rad > ALIKE_STEPS * spacing)


def beyond_points(points: FloatArray, table: GraspTable) -> BoolArray:
    """Which grasps lie sideways of all test points, where costs extrapolate, (n,)."""
    p = transform_points(table.T_bin_base, points)
    low, high = table.bin_points.min(axis=0), table.bin_points.max(axis=0)
    slack = MIN_DISTANCE_M
    return np.asarray(((p < low - slack) | (p > high + slack))[:, :2].any(axis=1))


def likeness_terms(matches: Matches, free: BoolArray, table: GraspTable) -> FloatArray:
    """φ6: distance between a grasp and its test grasp, shape (n,).

    φ6 = ½ (φ1 / h + φ2 / ω), where h is the larger pitch of the grid and ω the
    greatest angle between neighbouring orientations of the map (of approach axes where
    the roll is free). 0 on a test grasp, about 1 a whole step away in both.
    """
    h = float(table.pitch_m.max())
    spacing = np.where(free, table.spacing_rad[0], table.spacing_rad[1])
    return np.asarray(0.5 * (matches.distance_m / h + matches.angle_rad / spacing))


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
            vectors, stored = (
                (some.axes, table.axes)
                if free
                else (some.quaternions, table.quaternions)
            )
            kernel, _ = orientation_kernel(
                np.repeat(vectors, point.shape[1], axis=0),
                table.distinct(stored),
                point.ravel(),
                MEDIAN_STEPS * float(table.spacing_rad[0 if free else 1]),
                free=free,
            )
            near_m = np.maximum(distance, MIN_DISTANCE_M)
            weight = kernel.reshape(*point.shape, -1) / near_m[..., None]
            row, middle = _weighted_median(
                cost[point].reshape(len(part), -1), weight.reshape(len(part), -1)
            )
            near, orientation = np.divmod(middle, cost.shape[1])
            terms[part[row]] = columns.values[point[row, near], orientation]
    return terms


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
