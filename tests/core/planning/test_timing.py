"""Execution times, against integration and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.core.planning.timing import (
    execution_time_s,
    merge_straight,
    path_length_rad,
    segment_times_s,
    straight_way_time_s,
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
    """Way-points on a straight segment change nothing; a corner is a stop."""
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
    assert straight_way_time_s(np.zeros((1, 3)), np.ones(3), np.ones(3)) == 0.0


def test_a_straight_way_in_joint_space_takes_its_segment_time():
    """Evenly spaced points on a joint-space line give the closed form of the line."""
    way = np.linspace(0, 1, 6)[:, None] * np.array([0.3, -0.1])
    v, a = np.array([1.0, 2.0]), np.array([3.0, 1.0])
    assert straight_way_time_s(way, v, a) == pytest.approx(execution_time_s(way, v, a))


def test_a_bent_way_respects_the_limits():
    """Sampled velocities and accelerations along a bent way stay within the limits."""
    s = np.linspace(0, 1, 41)
    way = np.column_stack([np.sin(1.2 * s), 0.4 * s**2])
    v, a = np.array([0.8, 0.5]), np.array([2.0, 1.0])
    total = straight_way_time_s(way, v, a)
    slope = np.abs(np.diff(way, axis=0) * 40).max(axis=0)
    assert total >= float((slope / v).max())
    bend = np.abs(np.diff(way, 2, axis=0) * 1600).max(axis=0)
    # The trapezoid with this total time: no joint exceeds its acceleration.
    share = np.where(bend > 1e-9, 0.5, 1.0)
    push = float((share * a / slope).min())
    top = min(float((v / slope).min()), float(np.sqrt((share * a / bend).min())))
    assert total == pytest.approx(
        2 / np.sqrt(push) if top**2 >= push else 1 / top + top / push
    )
    assert (slope * push + bend * top**2 <= a + 1e-9).all()
