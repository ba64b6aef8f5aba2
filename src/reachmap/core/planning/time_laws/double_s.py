"""The double-S profile: shortest time from rest to rest under a limit on jerk.

Along a straight joint motion the joints move in proportion, so one coordinate s from
0 to 1 has limits V, A, J of its own, and the profile has a closed form (Biagiotti and
Melchiorri, "Trajectory Planning for Automatic Machines and Robots", 2008).
"""

from __future__ import annotations

import math

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.planning.timing import merge_straight, with_knots

SAMPLES = 200
"""Instants at which limits along a smooth way are compared; 2000 change the time by
0.1 % at most."""


def double_s_time_s(distance: float, v: float, a: float, j: float) -> float:
    """Shortest time over a distance from rest to rest [s].

    Parameters
    ----------
    distance : float
        [rad].
    v, a, j : float
        Limits on speed [rad/s], acceleration [rad/s²] and jerk [rad/s³].

    Examples
    --------
    >>> double_s_time_s(2.0, 10.0, 10.0, 1.0)  # all of it jerk: 4 ∛(d / 2j)
    4.0
    """
    if distance <= 0.0:
        return 0.0
    to_top_s = _to_top_speed_s(v, a, j)
    if distance >= v * to_top_s:
        return distance / v + to_top_s
    if distance >= 2 * a**3 / j**2:
        return a / j + math.sqrt((a / j) ** 2 + 4 * distance / a)
    return 4 * math.cbrt(distance / (2 * j))


def polyline_time_s(
    path: FloatArray, velocity: FloatArray, acceleration: FloatArray, jerk: FloatArray
) -> float:
    """Shortest time of a polyline (n, dof) that is followed exactly, in stops [s]."""
    if len(path) < 2:
        return 0.0
    change = np.abs(np.diff(merge_straight(path), axis=0))
    with np.errstate(divide="ignore"):
        limits = [(limit / change).min(axis=1) for limit in (velocity, acceleration)]
        limits.append((jerk / change).min(axis=1))
    rows = zip(*(limit.tolist() for limit in limits), strict=True)
    return sum(double_s_time_s(1.0, v, a, j) for v, a, j in rows)


def smooth_way_time_s(
    way: FloatArray, velocity: FloatArray, acceleration: FloatArray, jerk: FloatArray
) -> float:
    """Time of a double-S profile along the smooth curve through a way's points [s].

    The profile is that of the curve's tangents, stretched in time until bends keep to
    the limits as well: stretching by λ divides speeds, accelerations and jerks by λ,
    λ² and λ³. A little longer than the optimum where the curve bends.
    """
    way, knots = with_knots(way)
    if len(way) < 3:
        return polyline_time_s(way, velocity, acceleration, jerk)
    # Imported here: splines take long to import, and few commands time a way.
    from scipy.interpolate import CubicSpline

    curve = CubicSpline(knots, way)
    length = float(knots[-1])
    steepest = np.abs(curve(np.linspace(0.0, length, SAMPLES), 1)).max(axis=0)
    with np.errstate(divide="ignore"):
        v, a, j = (
            float((limit / steepest).min()) for limit in (velocity, acceleration, jerk)
        )
    whole_s = double_s_time_s(length, v, a, j)
    s, s1, s2, s3 = _profile(length, v, a, j, whole_s)
    q1, q2, q3 = (curve(s, order) for order in (1, 2, 3))
    rates = (
        q1 * s1,
        q2 * s1**2 + q1 * s2,
        q3 * s1**3 + 3 * q2 * s1 * s2 + q1 * s3,
    )
    limits = (velocity, acceleration, jerk)
    stretch = [
        (np.abs(rate) / limit).max() ** (1 / order)
        for order, (rate, limit) in enumerate(zip(rates, limits, strict=True), start=1)
    ]
    return whole_s * float(max(1.0, *stretch))


def _profile(
    length: float, v: float, a: float, j: float, whole_s: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Place, speed, acceleration and jerk of the profile at even instants, (n, 1)."""
    # Seven phases, the middle three of length 0 where a limit is not reached.
    to_top_s = _to_top_speed_s(v, a, j)
    speeding_s = to_top_s if length >= v * to_top_s else whole_s / 2
    bend_s = min(a / j, speeding_s / 2)
    hold_s, cruise_s = speeding_s - 2 * bend_s, whole_s - 2 * speeding_s
    phases = ((bend_s, j), (hold_s, 0.0), (bend_s, -j), (cruise_s, 0.0),
              (bend_s, -j), (hold_s, 0.0), (bend_s, j))  # fmt: skip
    t = np.linspace(0.0, whole_s, SAMPLES)
    rows = np.zeros((4, SAMPLES))
    place = speed = pull = begin = 0.0
    for duration, rate in phases:
        inside = t >= begin - 1e-12
        x = t[inside] - begin
        rows[0, inside] = place + speed * x + pull * x**2 / 2 + rate * x**3 / 6
        rows[1, inside] = speed + pull * x + rate * x**2 / 2
        rows[2, inside] = pull + rate * x
        rows[3, inside] = rate
        d = duration
        place += speed * d + pull * d**2 / 2 + rate * d**3 / 6
        speed += pull * d + rate * d**2 / 2
        pull += rate * d
        begin += d
    s, s1, s2, s3 = (row[:, None] for row in rows)
    return np.clip(s, 0.0, length), s1, s2, s3


def _to_top_speed_s(v: float, a: float, j: float) -> float:
    """Time from rest to the speed limit [s]."""
    return a / j + v / a if v * j >= a * a else 2 * math.sqrt(v / j)
