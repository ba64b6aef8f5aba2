"""The stored path to a test grasp as a motion: waypoints, stages, times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.planning.timing import (
    merge_straight,
    segment_times_s,
    smooth_way_time_s,
)
from reachmap.errors import SettingsError
from reachmap.maps.records import BinMap

PLANNED, APPROACH = "planned", "approach"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """From the scan configuration to a test grasp.

    Attributes
    ----------
    test_grasp : (int, int, int, int)
        Layer, y, x, orientation.
    configuration : array, shape (n, dof)
        Waypoints [rad]; between them the joints move in proportion, which is what
        was verified.
    stage : tuple of str
        Of the piece that ends at each waypoint: ``planned`` or ``approach``.
    time_s : array, shape (n,)
        When each is reached, within the limits of the joints: at rest at every corner
        of the planned part, without a stop along the straight approach.
    blend_rad : array, shape (n,), or None
        How far before and after each way-point, along the joint motion, it may be left
        and joined again on a parabola that was verified; 0 where it may not. None
        where the time law of the cell has stops at corners.
    """

    test_grasp: tuple[int, int, int, int]
    configuration: FloatArray
    stage: tuple[str, ...]
    time_s: FloatArray
    blend_rad: FloatArray | None = None

    @property
    def pre_grasp(self) -> int:
        """Waypoint at which the straight approach begins."""
        return len(self.stage) - self.stage.count(APPROACH) - 1

    def sampled(
        self, period_s: float, velocity: FloatArray, acceleration: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times (k,), positions and velocities (k, dof) at even steps and all stops.

        Between rests the speed along the way is the trapezoid that limits allow; a
        cubic through two samples stays on the straight joint motion between corners.
        """
        times, positions, speeds = [0.0], [self.configuration[0]], []
        speeds.append(np.zeros(self.configuration.shape[1]))
        for begin, end in self._pieces():
            way = self.configuration[begin : end + 1]
            whole = float(self.time_s[end] - self.time_s[begin])
            if whole <= 0.0:
                continue
            ramp = ramp_share(way, whole, velocity, acceleration)
            count = max(2, int(np.ceil(whole / period_s)) + 1)
            share = np.linspace(0.0, 1.0, count)[1:]
            place, rate = trapezoid(share, ramp)
            q, slope = _along(way, place)
            times += (self.time_s[begin] + whole * share).tolist()
            positions += list(q)
            speeds += list(slope * (rate / whole)[:, None])
        return np.array(times), np.array(positions), np.array(speeds)

    def _pieces(self) -> Iterator[tuple[int, int]]:
        """Waypoints between which the arm does not stop."""
        for k in range(self.pre_grasp):
            yield k, k + 1
        if self.pre_grasp < len(self.configuration) - 1:
            yield self.pre_grasp, len(self.configuration) - 1


def motion_of(
    bin_map: BinMap, row: int, velocity: FloatArray, acceleration: FloatArray
) -> Motion:
    """Time a stored path.

    Parameters
    ----------
    bin_map : BinMap
    row : int
        Of its paths.
    velocity, acceleration : array, shape (dof,)
        Limits [rad/s], [rad/s²].
    """
    layer, y, x, orientation = (int(k) for k in bin_map.paths.index[row][:4])
    return timed(
        *way_points(bin_map, row), (layer, y, x, orientation), velocity, acceleration
    )


def timed(
    planned: FloatArray,
    way: FloatArray,
    test_grasp: tuple[int, int, int, int],
    velocity: FloatArray,
    acceleration: FloatArray,
) -> Motion:
    """Time a planned part (n, dof) and the straight approach (m, dof) from its end."""
    corners = merge_straight(planned) if len(planned) > 1 else planned
    times = np.concatenate(
        [[0.0], np.cumsum(segment_times_s(corners, velocity, acceleration))]
    )
    stages = (PLANNED,) * len(corners)
    configuration = corners
    if len(way) > 1:
        whole = smooth_way_time_s(way, velocity, acceleration)
        reached = times[-1] + whole * _reached_at(way, whole, velocity, acceleration)
        times = np.concatenate([times, reached])
        stages += (APPROACH,) * (len(way) - 1)
        configuration = np.concatenate([corners, way[1:]])
    return Motion(
        test_grasp=test_grasp,
        configuration=configuration,
        stage=stages,
        time_s=times,
    )


def way_points(record: BinMap, row: int) -> tuple[FloatArray, FloatArray]:
    """Waypoints of a stored path: the planned part, and the straight approach.

    The last of the first is the first of the second.
    """
    path, planned = record.path(row), int(record.paths.planned_size[row])
    return path[:planned], path[planned - 1 :]


def best_rows(bin_map: BinMap) -> dict[tuple[int, int, int, int], int]:
    """Row of the best stored path of each test grasp that has one.

    Of a map of version 1.0, which names none, it is the shortest.
    """
    if bin_map.best is not None:
        places = zip(*np.nonzero(bin_map.best.row >= 0), strict=True)
        return {
            (int(a), int(b), int(c), int(d)): int(bin_map.best.row[a, b, c, d])
            for a, b, c, d in places
        }
    rows: dict[tuple[int, int, int, int], int] = {}
    length = bin_map.path_length
    for row, index in enumerate(bin_map.paths.index.tolist()):
        place = (index[0], index[1], index[2], index[3])
        known = rows.get(place)
        if (
            known is None
            or length[(*place, index[4])]
            < length[(*place, int(bin_map.paths.index[known][4]))]
        ):
            rows[place] = row
    return rows


def row_of(bin_map: BinMap, name: str) -> int:
    """Row of the path to a test grasp named ``y,x,orientation`` or with its layer.

    Raises
    ------
    SettingsError
        The name is none, or there is no path to that test grasp.
    """
    parts = name.replace(" ", "").split(",")
    shape = bin_map.status.shape
    try:
        numbers = [int(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) == 3:
        numbers = [0, *numbers]
    place = tuple(numbers)
    if len(place) != 4 or not all(
        0 <= k < n for k, n in zip(place, shape, strict=True)
    ):
        raise SettingsError(
            f"--grasp {name}: expected y,x,orientation or layer,y,x,orientation below "
            f"{', '.join(map(str, shape))}"
        )
    row = best_rows(bin_map).get(place)
    if row is None:
        raise SettingsError(f"--grasp {name}: the map has no path to this test grasp")
    return row


def ramp_share(
    way: FloatArray, time_s: float, velocity: FloatArray, acceleration: FloatArray
) -> float:
    """Share of the time spent speeding up, and again slowing down; at most a half."""
    change = np.abs(np.diff(way, axis=0)).sum(axis=0)
    with np.errstate(divide="ignore"):
        ramp_s = float((velocity / change).min() / (acceleration / change).min())
    return float(np.clip(ramp_s / max(time_s, 1e-9), 1e-3, 0.5))


def trapezoid(share: FloatArray, ramp: float) -> tuple[FloatArray, FloatArray]:
    """Share of the way and its rate at shares of the time, from rest to rest."""
    top = 1.0 / (1.0 - ramp)
    left = 1.0 - share
    place = np.where(
        share < ramp,
        0.5 * top * share**2 / ramp,
        np.where(left < ramp, 1 - 0.5 * top * left**2 / ramp, top * (share - ramp / 2)),
    )
    rate = top * np.clip(np.minimum(share, left) / ramp, 0.0, 1.0)
    return place, rate


def _along(way: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points of a way at shares of its joint length, and how they change with it."""
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
    knots = np.concatenate([[0.0], np.cumsum(steps)])
    knots /= knots[-1]
    k = np.clip(np.searchsorted(knots, place, side="right") - 1, 0, len(way) - 2)
    width = np.maximum(knots[k + 1] - knots[k], 1e-12)[:, None]
    slope = (way[k + 1] - way[k]) / width
    inside: BoolArray = place >= 1.0
    q = way[k] + slope * (place - knots[k])[:, None]
    return np.where(inside[:, None], way[-1], q), slope


def _reached_at(
    way: FloatArray, time_s: float, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Shares of the time at which the waypoints after the first are reached."""
    ramp = ramp_share(way, time_s, velocity, acceleration)
    share = np.linspace(0.0, 1.0, 2001)
    place, _ = trapezoid(share, ramp)
    steps = np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))
    return np.asarray(np.interp(steps / steps[-1], place, share))
