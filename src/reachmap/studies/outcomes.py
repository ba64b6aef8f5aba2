"""Objectives of a variant, and the outcomes they are computed from."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import t as student

from reachmap._typing import BoolArray, FloatArray
from reachmap.geometry import approach_directions
from reachmap.maps.comparison.pose_matching import (
    TOLERANCE_DEG,
    TOLERANCE_M,
    FrameTable,
    frame_table,
)
from reachmap.maps.comparison.significance import (
    clustered_shares,
    paired_means,
)
from reachmap.maps.records import BinMap, Status, WorkspaceMap
from reachmap.maps.study.record import LOWER_IS_BETTER, MEANS, PATH_LENGTH
from reachmap.maps.summary.directions import (
    reachability_of_directions,
)
from reachmap.maps.summary.emptying import volume_left
from reachmap.maps.summary.statistics import best_level, level_means, wilson_interval

NAN: Final = float("nan")
# What a bin that was put down by hand, or a camera, is off by at most.
ROBUST_M: Final = 0.010
SMALL_TURN: Final = float(np.radians(TOLERANCE_DEG))


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcomes:
    """Outcomes of an objective one by one, and their aggregate.

    Attributes
    ----------
    value, low, high : float
        The objective, and its 95 % interval [percent, rad].
    key : array, shape (n, k)
        What the outcomes are about, one unit apart at the tolerance of poses: a pose,
        a point with a direction, a point.
    result : array, shape (n,)
        1 reached, 0 not; or a length, NaN where there is none.
    place_columns : int
        Columns of ``key`` that say where; what is at one place fails together.
    """

    value: float
    low: float
    high: float
    key: FloatArray
    result: FloatArray
    place_columns: int = 3

    def by_point(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points seen from above, and the share of outcomes that are 1 at each.

        Returns
        -------
        x, y : array, shape (nx,), (ny,)
            Rising [m].
        percent : array, shape (ny, nx)
            NaN where there is no outcome.
        """
        (x, column), (y, row) = (
            np.unique(np.round(self.key[:, k] * TOLERANCE_M, 9), return_inverse=True)
            for k in range(2)
        )
        hits, count = np.zeros((2, len(y), len(x)))
        np.add.at(hits, (row, column), self.result)
        np.add.at(count, (row, column), 1.0)
        percent = np.full(count.shape, np.nan)
        np.divide(100.0 * hits, count, out=percent, where=count > 0)
        return x, y, percent


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A variant against the base; see :class:`~reachmap.maps.study.record.Study`."""

    pairs: int = 0
    gained: int = 0
    lost: int = 0
    change: float = NAN
    change_low: float = NAN
    change_high: float = NAN
    p_value: float = NAN


def of_workspace(record: WorkspaceMap) -> dict[str, Outcomes]:
    """Level average: the frames of the best level, by place in the level and turn.

    The best levels of two variants may differ in height; their frames are the same
    where place in the plane and orientation are.
    """
    level = best_level(record.path_reachability)
    table = frame_table(record)
    if level is None:
        return {}
    value = float(level_means(record.path_reachability)[level])
    near = np.abs(table.square[:, 2] - record.z[level]) < TOLERANCE_M
    rows = table.rows(np.flatnonzero(near))
    key = np.column_stack([rows.position[:, :2] / TOLERANCE_M, _turns(rows)])
    hit = rows.status == Status.PATH_FOUND
    share = _share(key, hit, value)
    return {"level_average": dataclasses.replace(share, place_columns=2)}


def of_bin(record: BinMap) -> dict[str, Outcomes]:
    """What a bin map says of frames, directions, points, paths and cycles."""
    table = frame_table(record, "bin")
    hit = table.status == Status.PATH_FOUND
    place = table.position / TOLERANCE_M
    axis = approach_directions(table.rotation, record.approach_axis) / SMALL_TURN
    frame = np.column_stack([place, _turns(table)])
    found = {
        "bin_reachability": _share(frame, hit),
        "directions": _share(*_any(np.column_stack([place, axis]), hit)),
        "points": _share(*_any(place, hit)),
        PATH_LENGTH: _mean(frame, table.path_length_rad),
    }
    return found | _of_best_paths(record, table, frame) | _emptied(record)


def _of_best_paths(
    record: BinMap, table: FrameTable, frame: FloatArray
) -> dict[str, Outcomes]:
    """Lengths, times and clearances of best paths, and whole cycles."""
    status = record.status.ravel()
    known = ~np.isin(status, [Status.NOT_ATTEMPTED, Status.ERROR])
    hit = status == Status.PATH_FOUND
    # The order in which frame_table lists them.
    order = np.flatnonzero(known)[np.argsort(~hit[known], kind="stable")]
    if len(order) != len(table):  # a pose that occurs twice is listed once
        return {}
    found = {}
    if record.best is not None:
        length, time_s = record.best.path_length, record.best.execution_time
        found[PATH_LENGTH] = _mean(frame, length.ravel()[order])
        found["motion_time_s"] = _mean(frame, time_s.ravel()[order])
    if record.margins is not None:
        kept = hit & (record.margins.clearance.ravel() >= ROBUST_M)
        found["robust_reachability"] = _share(frame, kept[order])
    if record.cycle is not None:
        cycle_s = record.cycle.cycle_time.ravel()[order]
        found["cycle_reachability"] = _share(frame, ~np.isnan(cycle_s))
        found["cycle_time_s"] = _mean(frame, cycle_s)
    return found


def _emptied(record: BinMap) -> dict[str, Outcomes]:
    """Share of a full column of parts that can be picked, point by point [percent]."""
    _, points = reachability_of_directions(record)
    if len(record.layer) < 2 or np.isnan(points).any():
        return {}
    left = volume_left(points == 0, record.layer, float(record.bin_inner[2]))
    y, x = np.meshgrid(record.y, record.x, indexing="ij")
    place = np.column_stack([x.ravel(), y.ravel()]) / TOLERANCE_M
    return {"emptied": _mean(place, 100.0 * (1.0 - left.ravel()))}


def _turns(table: FrameTable) -> FloatArray:
    return np.asarray(table.rotation.reshape(-1, 9) / (np.sqrt(2.0) * SMALL_TURN))


def _any(key: FloatArray, hit: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Join outcomes about the same thing: reached if one of them is."""
    if not len(key):
        return key, hit
    # Rounding noise is far below a hundredth of the tolerance.
    _, first, which = np.unique(
        np.round(key, 2), axis=0, return_index=True, return_inverse=True
    )
    reached = np.zeros(len(first), bool)
    np.logical_or.at(reached, which.ravel(), hit)
    return key[first], reached


def _share(key: FloatArray, hit: BoolArray, value: float | None = None) -> Outcomes:
    total = len(hit)
    if not total:
        return Outcomes(value=NAN, low=NAN, high=NAN, key=key, result=np.zeros(0))
    value = 100.0 * float(hit.mean()) if value is None else value
    low, high = wilson_interval(np.array(value / 100.0 * total), np.array(float(total)))
    return Outcomes(
        value=value,
        low=min(100.0 * float(low), value),
        high=max(100.0 * float(high), value),
        key=key,
        result=hit.astype(float),
    )


def _mean(key: FloatArray, lengths: FloatArray) -> Outcomes:
    known = lengths[~np.isnan(lengths)]
    mean = float(known.mean()) if len(known) else NAN
    half = NAN
    if len(known) > 1:
        error = float(known.std(ddof=1)) / np.sqrt(len(known))
        half = float(student.ppf(0.975, len(known) - 1)) * error
    return Outcomes(
        value=mean, low=mean - half, high=mean + half, key=key, result=lengths
    )


def compare_outcomes(name: str, before: Outcomes, after: Outcomes) -> Change:
    """Compare two variants on the outcomes that both have."""
    in_a, in_b = _matches(before.key, after.key)
    a, b = before.result[in_a], after.result[in_b]
    if name in MEANS:
        both = ~np.isnan(a) & ~np.isnan(b)
        if not both.any():
            return Change()
        mean, low, high, p_value = paired_means(b[both] - a[both])
        return Change(
            pairs=int(both.sum()),
            change=mean,
            change_low=low,
            change_high=high,
            p_value=p_value,
        )
    pairs = len(a)
    if not pairs:
        return Change()
    gained, lost = int((b > a).sum()), int((b < a).sum())
    where = np.round(before.key[in_a][:, : before.place_columns], 2)
    _, cluster = np.unique(where, axis=0, return_inverse=True)
    p_value, low, high = clustered_shares(b - a, cluster.ravel())
    return Change(
        pairs=pairs,
        gained=gained,
        lost=lost,
        change=100.0 * (gained - lost) / pairs,
        change_low=100.0 * low,
        change_high=100.0 * high,
        p_value=p_value,
    )


def _matches(a: FloatArray, b: FloatArray) -> tuple[Any, Any]:
    """Rows that are the same in both, each at most once."""
    none = np.zeros(0, np.int64)
    if not len(a) or not len(b) or a.shape[1] != b.shape[1]:
        return none, none
    _, nearest = cKDTree(b).query(a, distance_upper_bound=np.sqrt(2.0))
    in_a = np.flatnonzero(nearest < len(b))
    _, first = np.unique(nearest[in_a], return_index=True)
    in_a = in_a[np.sort(first)]
    return in_a, nearest[in_a]


OPERATORS: Final[dict[str, Callable[[float, float], bool]]] = {
    ">=": lambda value, bound: value >= bound,
    "<=": lambda value, bound: value <= bound,
    ">": lambda value, bound: value > bound,
    "<": lambda value, bound: value < bound,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirement:
    """A bound on an objective."""

    objective: str
    operator: str
    bound: float

    def __str__(self) -> str:
        return f"{self.objective} {self.operator} {self.bound:g}"

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether it is met; a missing value meets nothing."""
        return OPERATORS[self.operator](values[self.objective], self.bound)


def is_met(requirements: Sequence[Requirement], values: Mapping[str, float]) -> bool:
    """Whether all requirements are met."""
    return all(requirement.holds(values) for requirement in requirements)


# What failed is worth less than anything, and what breaks a requirement less than
# anything that meets them all, the more the further off it is.
FAILED, UNMET = -1e9, -1e6


def utility(
    payload: Mapping[str, Any], objective: str, requirements: Sequence[Requirement]
) -> float:
    """Utility of a variant; more is better."""
    values = {
        name: float(found["value"]) for name, found in payload["outcomes"].items()
    }
    value = values.get(objective, np.nan)
    if np.isnan(value):
        return FAILED
    short = sum(
        abs(values[item.objective] - item.bound)
        for item in requirements
        if not item.holds(values)
    )
    if short > 0.0:
        return UNMET - short
    return -value if objective in LOWER_IS_BETTER else value
