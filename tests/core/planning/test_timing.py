"""Execution times, against integration and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import linprog

from reachmap.core.planning.timing import (
    execution_time_s,
    merge_straight,
    path_length_rad,
    segment_times_s,
    smooth_way_time_s,
)


def bang_bang_time(change, velocity, acceleration, dt=1e-4):
    """Time of a straight segment by integrating full acceleration, then braking."""
    d = np.abs(change)
    moving = d > 0
    top = (velocity[moving] / d[moving]).min()
    push = (acceleration[moving] / d[moving]).min()
    s = v = t = 0.0
    while s < 0.5:
        v = min(v + push * dt, top)
        s += v * dt
        t += dt
    return 2 * t


def test_a_segment_takes_as_long_as_integration_says():
    """The closed form agrees with a simulated trapezoid, with and without cruise."""
    rng = np.random.default_rng(1)
    velocity, acceleration = np.array([2.0, 1.0, 3.0]), np.array([4.0, 5.0, 2.0])
    for size in (0.05, 0.5, 5.0):
        change = rng.normal(size=3) * size
        path = np.array([np.zeros(3), change])
        expected = bang_bang_time(change, velocity, acceleration)
        got = execution_time_s(path, velocity, acceleration)
        assert got == pytest.approx(expected, rel=2e-3, abs=5e-4)


def test_one_joint_with_cruise():
    """One joint over 3 rad at 1 rad/s and 2 rad/s² takes 3/1 + 1/2 seconds."""
    path = np.array([[0.0], [3.0]])
    assert execution_time_s(path, np.ones(1), 2 * np.ones(1)) == pytest.approx(3.5)


def test_points_on_a_line_do_not_stop_the_arm():
    """Waypoints on a straight segment change nothing; a corner is a stop."""
    v, a = np.ones(2), np.ones(2)
    straight = np.array([[0.0, 0.0], [1.0, 2.0]])
    dotted = np.array([[0.0, 0.0], [0.3, 0.6], [0.3, 0.6], [0.7, 1.4], [1.0, 2.0]])
    assert execution_time_s(dotted, v, a) == pytest.approx(
        execution_time_s(straight, v, a)
    )
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]])
    parts = segment_times_s(corner, v, a)
    assert execution_time_s(corner, v, a) == pytest.approx(parts.sum())


def test_a_reversal_is_a_corner():
    """Going back along the same line is not merged away."""
    path = np.array([[0.0], [1.0], [0.5]])
    np.testing.assert_array_equal(merge_straight(path), path)
    assert path_length_rad(path) == pytest.approx(1.5)


def test_a_path_of_one_point_takes_no_time():
    """No motion, no time."""
    assert execution_time_s(np.zeros((1, 3)), np.ones(3), np.ones(3)) == 0.0
    assert execution_time_s(np.zeros((3, 3)), np.ones(3), np.ones(3)) == 0.0
    assert smooth_way_time_s(np.zeros((1, 3)), np.ones(3), np.ones(3)) == 0.0


def test_a_straight_way_in_joint_space_takes_its_segment_time():
    """Evenly spaced points on a joint-space line give the closed form of the line."""
    way = np.linspace(0, 1, 6)[:, None] * np.array([0.3, -0.1])
    v, a = np.array([1.0, 2.0]), np.array([3.0, 1.0])
    assert smooth_way_time_s(way, v, a) == pytest.approx(execution_time_s(way, v, a))


def fastest_by_linear_program(way, v, a, steps=200):
    """Time optimum of the spline through a way, as the greatest sum of squared speeds.

    The fastest profile is the greatest at every point at once, so that any sum of the
    squared speeds ẋ² has its maximum there: a linear program.
    """
    s = np.linspace(0, 1, steps + 1)
    spline = CubicSpline(np.linspace(0, 1, len(way)), way)
    slope, bend = spline(s, 1), spline(s, 2)
    step = s[1]
    rows, limits = [], []
    for k in range(steps):
        for joint in range(way.shape[1]):
            row = np.zeros(steps + 1)
            row[k + 1] = slope[k, joint] / (2 * step)
            row[k] = bend[k, joint] - row[k + 1]
            rows += [row, -row]
            limits += [a[joint], a[joint]]
    most = ((v / np.maximum(np.abs(slope), 1e-12)) ** 2).min(axis=1)
    most[[0, -1]] = 0.0
    found = linprog(
        -np.ones(steps + 1),
        A_ub=np.array(rows),
        b_ub=limits,
        bounds=[(0, top) for top in most],
    )
    speed = np.sqrt(np.maximum(found.x, 0))
    return (2 * step / (speed[1:] + speed[:-1])).sum()


@pytest.mark.parametrize("seed", range(6))
def test_a_bent_way_takes_its_optimum(seed):
    """Within 2 % of a linear program, and the way back takes as long."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, int(rng.integers(4, 9)))[:, None]
    way = s * rng.normal(0, 0.2, 6) + s**2 * rng.normal(0, 0.2, 6)
    way += 0.05 * np.sin(3 * s + rng.random(6))
    v, a = np.full(6, 3.1), rng.uniform(4, 9, 6)
    time = smooth_way_time_s(way, v, a)
    assert time == pytest.approx(fastest_by_linear_program(way, v, a), rel=0.02)
    assert smooth_way_time_s(way[::-1], v, a) == pytest.approx(time, rel=0.02)


def test_repeated_and_uneven_points_change_nothing():
    """The curve counts, not where its points lie."""
    even, uneven = np.linspace(0, 1, 9), np.linspace(0, 1, 12) ** 1.5
    v, a = np.array([0.8, 0.5]), np.array([2.0, 1.0])
    times = [
        smooth_way_time_s(np.column_stack([np.sin(1.2 * s), 0.4 * s**2]), v, a)
        for s in (even, uneven, np.sort([*even, *even]))
    ]
    np.testing.assert_allclose(times, times[0], rtol=0.01)
