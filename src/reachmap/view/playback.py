"""A stored path as configurations in even steps of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.planning.timing import (
    merge_straight,
    segment_times_s,
    smooth_way_time_s,
)
from reachmap.core.robot.model import RobotModel
from reachmap.errors import SettingsError
from reachmap.maps.records import BinMap
from reachmap.motions.motion import trapezoid, way_points
from reachmap.view.points import shortest_paths

# A choice: the rate of cinema, at which motions look smooth.
FRAMES_PER_S = 24.0
HELD_STAGES = 3
"""Stages with the part in hand: lift, transfer, place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Playback:
    """Motion of the arm from the scan configuration to a grasp, and after it.

    After the grasp it runs the whole cycle where one is stored, else it goes back out.

    Attributes
    ----------
    configuration : array, shape (k, dof)
        [rad].
    time_s : array, shape (k,)
        When each is taken, from 0; that of the grasp is the execution time. After it
        come the stages of the cycle, waits left out, or the same straight way back.
    grasp : int
        Index of the configuration at the grasp.
    release : int
        Index of the configuration at which the part is released; that of the grasp
        where no cycle is played.
    test_grasp : tuple of int
        layer, y, x, orientation.
    """

    configuration: FloatArray
    time_s: FloatArray
    grasp: int
    release: int
    test_grasp: tuple[int, int, int, int]

    @property
    def has_cycle(self) -> bool:
        """Whether the whole cycle is played."""
        return self.release > self.grasp

    def part_at(self, index: int) -> FloatArray | None:
        """Configuration (dof,) whose tool determines the part's pose; None without one.

        It lies at the grasp, hangs on the tool, lies where it was let go.
        """
        if not self.has_cycle:
            return None
        held: FloatArray = self.configuration[min(max(index, self.grasp), self.release)]
        return held


def playback_of(record: BinMap, row: int, robot: RobotModel) -> Playback:
    """Time a stored path by the arm's limits, as its execution time was measured.

    Parameters
    ----------
    record : BinMap
    row : int
        Of its paths.
    robot : RobotModel
        Gives the limits.
    """
    planned, approach = way_points(record, row)
    parts = _pieces(planned, approach, robot)
    at_grasp, at_release = len(parts), len(parts)
    stages = stage_rows(record, row)
    for number, stage in enumerate(stages):
        parts += _pieces(*way_points(record, stage), robot)
        # The tool goes away empty after the third stage: lift, transfer, place.
        at_release = len(parts) if number < HELD_STAGES else at_release
    if not stages and len(approach) > 1:
        down, when = parts[-1]
        parts.append((down[::-1], when))
    configuration, time_s, starts = _joined(planned[:1], parts)
    starts.append(len(configuration) - 1)
    index = record.paths.index[row]
    return Playback(
        configuration=configuration,
        time_s=time_s,
        grasp=starts[at_grasp],
        release=starts[at_release],
        test_grasp=(int(index[0]), int(index[1]), int(index[2]), int(index[3])),
    )


def stage_rows(record: BinMap, row: int) -> list[int]:
    """Rows of the paths that follow a path to a grasp, in order; none without cycle."""
    paths = record.paths
    if paths.stage is None or record.best is None:
        return []
    place = tuple(paths.index[row, :4].tolist())
    if record.best.row[place] != row:
        return []
    own = (paths.index[:, :4] == paths.index[row, :4]).all(axis=1) & (paths.stage > 0)
    rows = np.flatnonzero(own)
    return [int(k) for k in rows[np.argsort(paths.stage[rows], kind="stable")]]


def _pieces(
    planned: FloatArray, way: FloatArray, robot: RobotModel
) -> list[tuple[FloatArray, FloatArray]]:
    """Motions from rest to rest of a planned path and a straight way after it."""
    limits = robot.velocity_rad_s, robot.acceleration_rad_s2
    corners = merge_straight(planned) if len(planned) > 1 else planned
    times = segment_times_s(corners, *limits) if len(corners) > 1 else np.zeros(0)
    parts = [
        _eased(np.stack([a, b]), float(time), *limits)
        for a, b, time in zip(corners[:-1], corners[1:], times, strict=True)
    ]
    if len(way) > 1:
        parts.append(_eased(way, smooth_way_time_s(way, *limits), *limits))
    return parts


def _joined(
    first: FloatArray, parts: Sequence[tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray, list[int]]:
    """Configurations and times of parts one after another, and where each begins."""
    configurations, times, starts = [first], [np.zeros(1)], []
    count, now = 1, 0.0
    for way, when in parts:
        starts.append(count - 1)
        configurations.append(way[1:])
        times.append(now + when[1:])
        count, now = count + len(way) - 1, now + float(when[-1])
    return np.concatenate(configurations), np.concatenate(times), starts


def _eased(
    way: FloatArray, time_s: float, velocity: FloatArray, acceleration: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points of a way from rest to rest in a time, (k, dof), and their times (k,).

    Speed is the trapezoid that :func:`.segment_times_s` times: with
    the bounds V and A of the share of the way, each ramp takes V/A.
    """
    count = max(2, round(time_s * FRAMES_PER_S) + 1)
    steps = np.linspace(0.0, 1.0, count)
    change = np.abs(way[-1] - way[0])
    with np.errstate(divide="ignore"):
        ramp_s = (velocity / change).min() / (acceleration / change).min()
    # Share of the time spent on each ramp; one half is a triangle.
    ramp = float(np.clip(ramp_s / max(time_s, 1e-9), 0.01, 0.5))
    share, _ = trapezoid(steps, ramp)
    place = share * (len(way) - 1)
    knots = np.arange(len(way))
    points = np.stack([np.interp(place, knots, column) for column in way.T], axis=-1)
    return points, time_s * steps


def choose_paths(record: BinMap) -> tuple[int, ...]:
    """Rows of paths worth watching: a typical one in each quadrant of the bin.

    Typical is the median of the lengths; the shortest paths all lead to the middle.
    Where there are whole cycles, one of them.
    """
    rows = shortest_paths(record)
    length = np.full(rows.shape, np.inf)
    has = rows >= 0
    if record.best is not None:
        length[has] = record.best.path_length[has]
    else:
        length[has] = record.path_length[tuple(record.paths.index[rows[has]].T)]
    if record.cycle is not None and np.isfinite(record.cycle.cycle_time).any():
        length[np.isnan(record.cycle.cycle_time)] = np.inf
    chosen = []
    for north in (True, False):
        for east in (False, True):
            mask = (record.y >= 0) == north
            inside = mask[None, :, None, None] & ((record.x >= 0) == east)[:, None]
            here = np.where(np.broadcast_to(inside, rows.shape), length, np.inf)
            known = int(np.isfinite(here).sum())
            if known:
                typical = int(here.argsort(axis=None, kind="stable")[(known - 1) // 2])
                chosen.append(int(rows.flat[typical]))
    return tuple(dict.fromkeys(chosen))


def find_path(record: BinMap, test_grasp: tuple[int, int, int, int]) -> int:
    """Row of the shortest path to a test grasp.

    Parameters
    ----------
    record : BinMap
    test_grasp : tuple of int
        layer, y, x, orientation.

    Raises
    ------
    SettingsError
        There is no such test grasp, or no path to it.
    """
    shape = record.status.shape
    name = ",".join(map(str, test_grasp))
    if not all(0 <= i < n for i, n in zip(test_grasp, shape, strict=True)):
        last = ",".join(str(n - 1) for n in shape)
        raise SettingsError(f"--path {name}: no such test grasp (0,0,0,0 to {last})")
    row = int(shortest_paths(record)[test_grasp])
    if row < 0:
        raise SettingsError(f"--path {name}: no path to this test grasp is stored")
    return row
