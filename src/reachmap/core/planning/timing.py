"""Length and execution time of joint paths.

The time of a planned path is the exact optimum of the exact polyline: along a straight
joint segment the velocity and acceleration limits are constant, so the best profile is
a trapezoid; at a corner the tangent jumps and the arm must stop. Blends and splines
would be a few percent faster and leave the verified path. The straight approach is a
smooth curve in the joints, and has the time optimum of that curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from reachmap._typing import FloatArray

# Points nearer than this to the previous one, or to the straight line, are left out.
SAME_RAD: Final = 1e-9


def path_length_rad(path: FloatArray) -> float:
    """Euclidean joint-space length of a polyline (n, dof) [rad]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def polyline_length_m(points: FloatArray) -> float:
    """Length of a polyline of points (n, 3) [m]."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def merge_straight(path: FloatArray) -> FloatArray:
    """Leave out repeated points and points on a straight line between neighbours.

    Parameters
    ----------
    path : array, shape (n, dof)

    Returns
    -------
    array, shape (m, dof), m <= n
        The ends are kept.

    Examples
    --------
    >>> merge_straight(np.array([[0.0], [1.0], [1.0], [2.0], [1.0]])).ravel()
    array([0., 2., 1.])
    """
    kept = [path[0]]
    for point, following in zip(path[1:-1], path[2:], strict=True):
        before, after = point - kept[-1], following - point
        length = np.linalg.norm(before)
        if length <= SAME_RAD:
            continue
        direction = before / length
        along = float(after @ direction)
        aside = np.linalg.norm(after - along * direction)
        if along >= 0 and aside <= SAME_RAD:
            continue
        kept.append(point)
    if len(path) > 1 and np.linalg.norm(path[-1] - kept[-1]) > SAME_RAD:
        kept.append(path[-1])
    return np.array(kept)


def segment_times_s(
    path: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Shortest time of each straight segment, at rest at both ends.

    With d = |Δq|, V = min v/d and A = min a/d the time is 2/√A where the top speed
    is not reached (V² ≥ A), and 1/V + V/A where it is.

    Parameters
    ----------
    path : array, shape (n, dof)
        [rad].
    velocity, acceleration : array, shape (dof,)
        Limits [rad/s], [rad/s²].

    Returns
    -------
    array, shape (n - 1,)
        [s].
    """
    return _motion_times_s(np.diff(path, axis=0), velocity, acceleration)


def _motion_times_s(
    change: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Shortest times of straight motions by changes (..., dof), shape (...)."""
    change = np.abs(change)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = (velocity / change).min(axis=-1)
        a = (acceleration / change).min(axis=-1)
        time = np.where(v * v >= a, 2 / np.sqrt(a), 1 / v + v / a)
    return np.asarray(np.where(change.max(axis=-1) == 0, 0.0, time))


def execution_time_s(
    path: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> float:
    """Shortest time of a polyline that is followed exactly [s]."""
    if len(path) < 2:
        return 0.0
    return float(segment_times_s(merge_straight(path), velocity, acceleration).sum())


SECONDS_PER_RAD: Final = 0.5
"""What a radian of a path costs beside its time. Paths of 3.5 rad take 2 s, so that
length and time weigh about the same in a pace, as they do in J."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pace:
    """What paths are compared by: execution time, stops included, and length.

    Attributes
    ----------
    velocity, acceleration : array, shape (dof,)
        Limits [rad/s], [rad/s²].
    """

    velocity: FloatArray
    acceleration: FloatArray

    def of_motions(self, change: FloatArray) -> FloatArray:
        """Cost of straight motions by changes (..., dof), shape (...) [s]."""
        time = _motion_times_s(change, self.velocity, self.acceleration)
        return np.asarray(time + SECONDS_PER_RAD * np.linalg.norm(change, axis=-1))

    def of_path(self, path: FloatArray) -> float:
        """Cost of a polyline (n, dof) [s]."""
        return float(self.of_motions(np.diff(merge_straight(path), axis=0)).sum())


GRID = 100
"""Steps along a smooth way; twenty times as many change its time by 1.4 % at most."""


def with_knots(way: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points of a way (n, dof), each once, and the chord length up to each [rad]."""
    chords = np.linalg.norm(np.diff(way, axis=0), axis=1)
    moves = chords > 1e-12
    knots = np.concatenate([[0.0], np.cumsum(chords[moves])])
    return way[np.concatenate([[True], moves])], knots


def smooth_way_time_s(
    way: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> float:
    """Shortest time along a smooth way given by closely spaced points [s].

    The points stand for a smooth curve, the cubic spline through them, so nothing stops
    at them; at its ends the arm is at rest. The time is the optimum in the phase plane
    of path parameter s and squared speed x = ṡ² (Bobrow et al. 1985): x stays below
    what the limits allow at each point, a sweep from the end finds the speeds from
    which the arm can still stop, one from the start the fastest that keep below them.
    The way back takes as long, as the limits are the same both ways.

    Parameters
    ----------
    way : array, shape (n, dof)
        Along the straight line of the tool [rad].
    velocity, acceleration : array, shape (dof,)
        Limits [rad/s], [rad/s²].
    """
    way, knots = with_knots(way)
    if len(way) < 3:
        return execution_time_s(way, velocity, acceleration)
    # Imported here: splines take long to import, and few commands time a way.
    from scipy.interpolate import CubicSpline

    s = np.linspace(0.0, knots[-1], GRID + 1)
    spline = CubicSpline(knots, way)
    limit, bends, reach = _phase_plane(
        spline(s, 1), spline(s, 2), velocity, acceleration
    )
    x = _fastest_profile(limit, bends, reach, float(s[1]))
    speed = np.sqrt(x)
    return float((2.0 * s[1] / (speed[1:] + speed[:-1])).sum())


def _phase_plane(
    slope: FloatArray,
    bend: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
) -> tuple[list[float], list[list[float]], list[list[float]]]:
    """Limits along a curve q(s) with derivatives q', q'', each of shape (n, dof).

    ``|q'| ṡ ≤ v`` and ``-a ≤ q' s̈ + q'' ṡ² ≤ a`` give a greatest x = ṡ² at each point,
    and for each joint ``-reach - bends·x ≤ s̈ ≤ reach - bends·x``.
    """
    steep = np.maximum(np.abs(slope), 1e-12)
    reach = acceleration / steep
    bends = bend * np.sign(slope) / steep
    limit = ((velocity / steep) ** 2).min(axis=1)
    # Where no s̈ satisfies two joints at once, x is too large.
    apart = bends[:, None, :] - bends[:, :, None]
    both = reach[:, None, :] + reach[:, :, None]
    most = np.where(apart > 1e-12, both / np.maximum(apart, 1e-12), np.inf)
    limit = np.minimum(limit, most.min(axis=(1, 2)))
    return limit.tolist(), bends.tolist(), reach.tolist()


def _fastest_profile(
    limit: list[float], bends: list[list[float]], reach: list[list[float]], step: float
) -> FloatArray:
    """Squared speeds from rest to rest, as fast as the limits allow; shape (n,)."""
    # Plain numbers in lists: NumPy and generators take longer for six of them.
    last = len(limit) - 1
    x = [0.0] * (last + 1)
    for k in range(last, 0, -1):
        slowest = max([-r - b * x[k] for r, b in zip(reach[k], bends[k], strict=True)])
        x[k - 1] = min(limit[k - 1], max(x[k] - 2.0 * step * slowest, 0.0))
    x[0] = 0.0
    for k in range(last):
        quickest = min([r - b * x[k] for r, b in zip(reach[k], bends[k], strict=True)])
        x[k + 1] = min(x[k + 1], max(x[k] + 2.0 * step * quickest, 0.0))
    return np.array(x)
