"""Length and execution time of joint paths.

The execution time is the exact optimum of the exact polyline: along a straight joint
segment the velocity and acceleration limits are constant, so the best profile is a
trapezoid; at a corner the tangent jumps and the arm must stop. Blends and splines
would be a few percent faster and leave the verified path.
"""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray


def path_length_rad(path: FloatArray) -> float:
    """Euclidean joint-space length of a polyline (n, dof) [rad]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def polyline_length_m(points: FloatArray) -> float:
    """Length of a polyline of points (n, 3) [m]."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def merge_straight(path: FloatArray, tolerance_rad: float = 1e-9) -> FloatArray:
    """Leave out repeated points and points on a straight line between neighbours.

    Parameters
    ----------
    path : array, shape (n, dof)
    tolerance_rad : float
        Points nearer than this to the previous one, or to the straight line, go.

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
        if length <= tolerance_rad:
            continue
        direction = before / length
        along = float(after @ direction)
        aside = np.linalg.norm(after - along * direction)
        if along >= 0 and aside <= tolerance_rad:
            continue
        kept.append(point)
    if len(path) > 1 and np.linalg.norm(path[-1] - kept[-1]) > tolerance_rad:
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
    change = np.abs(np.diff(path, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        v = (velocity / change).min(axis=1)
        a = (acceleration / change).min(axis=1)
        time = np.where(v * v >= a, 2 / np.sqrt(a), 1 / v + v / a)
    return np.asarray(np.where(change.max(axis=1) == 0, 0.0, time))


def execution_time_s(
    path: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> float:
    """Shortest time of a polyline that is followed exactly [s]."""
    if len(path) < 2:
        return 0.0
    return float(segment_times_s(merge_straight(path), velocity, acceleration).sum())


def straight_way_time_s(
    way: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> float:
    """Time along a smooth way given by closely spaced points, at rest at its ends.

    The points stand for a smooth curve, so nothing stops at them. The profile is a
    trapezoid over the curve parameter s, with constant bounds that hold everywhere on
    it: ``|q'| ṡ ≤ v`` and ``|q'| s̈ + |q''| ṡ² ≤ a``; half of each acceleration
    limit is kept for the second term, so the time is never too short.

    Parameters
    ----------
    way : array, shape (n, dof)
        Evenly spaced along the straight line of the tool [rad].
    velocity, acceleration : array, shape (dof,)
        Limits [rad/s], [rad/s²].
    """
    if len(way) < 2:
        return 0.0
    first = np.diff(way, axis=0) * (len(way) - 1)
    slope = np.maximum(np.abs(first).max(axis=0), 1e-12)
    second = np.diff(first, axis=0) * (len(way) - 1)
    bend = np.abs(second).max(axis=0, initial=0.0)
    share = np.where(bend > 1e-9, 0.5, 1.0)
    speed_sq = np.where(
        bend > 1e-9, share * acceleration / np.maximum(bend, 1e-9), np.inf
    )
    v = min(float((velocity / slope).min()), float(np.sqrt(speed_sq.min())))
    a = float((share * acceleration / slope).min())
    return float(2 / np.sqrt(a) if v * v >= a else 1 / v + v / a)
