"""Time optima along smooth paths by toppra, for comparison.

toppra (Pham and Pham, "A new approach to time-optimal path parameterization based on
reachability analysis", 2018) finds the fastest speeds along a given curve under limits
on joint speeds and accelerations.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from reachmap._typing import FloatArray
from reachmap.core.planning.time_laws.corners import BlendedPath
from reachmap.core.planning.timing import with_knots
from reachmap.errors import SettingsError

GRID = 80
"""Steps in each piece of a path; four times as many change its time by 0.05 %."""
# Denser at the ends of each piece, where speeds change fastest along the path.
_SHARES = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, GRID + 1))


def optimal_time_s(
    path: BlendedPath, velocity: FloatArray, acceleration: FloatArray
) -> float:
    """Shortest time along a blended path, at rest at unblended corners [s].

    Parameters
    ----------
    path : BlendedPath
    velocity, acceleration : array, shape (dof,)
        Limits [rad/s], [rad/s²].
    """
    stops = np.flatnonzero(path.blend == 0.0)
    return sum(
        _parametrised_s(_curve(path, begin, end), velocity, acceleration)
        for begin, end in zip(stops[:-1].tolist(), stops[1:].tolist(), strict=True)
    )


def optimal_way_time_s(
    way: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> float:
    """Shortest time along the smooth curve through a way's points (n, dof) [s]."""
    way, knots = with_knots(way)
    if len(way) < 2:
        return 0.0
    return _parametrised_s(CubicSpline(knots, way), velocity, acceleration)


def _curve(path: BlendedPath, begin: int, end: int) -> PPoly:
    """Straight pieces and parabolas between two stops, over their length s."""
    corners, d = path.corners, path.blend
    breaks, rows = [0.0], []
    for k in range(begin, end):
        change = corners[k + 1] - corners[k]
        length = float(np.linalg.norm(change))
        unit = change / length
        straight = length - d[k] - d[k + 1]
        if straight > 1e-12:
            rows.append((np.zeros_like(unit), unit, corners[k] + d[k] * unit))
            breaks.append(breaks[-1] + straight)
        if k + 1 < end:
            into, corner, out = path.parabola(k + 1)
            width = 2 * d[k + 1]
            bend = (into - 2 * corner + out) / width**2
            rows.append((bend, 2 * (corner - into) / width, into))
            breaks.append(breaks[-1] + width)
    return PPoly(np.array(rows).transpose(1, 0, 2), np.array(breaks))


def _parametrised_s(
    curve: PPoly, velocity: FloatArray, acceleration: FloatArray
) -> float:
    toppra = _toppra()
    pieces = zip(curve.x[:-1], curve.x[1:], strict=True)
    grid = np.concatenate(
        [a + (b - a) * _SHARES[:-1] for a, b in pieces] + [curve.x[-1:]]
    )
    limits = [
        toppra.constraint.JointVelocityConstraint(np.stack([-velocity, velocity], 1)),
        toppra.constraint.JointAccelerationConstraint(
            np.stack([-acceleration, acceleration], 1)
        ),
    ]
    solver = toppra.algorithm.TOPPRA(limits, _path_of(toppra, curve), gridpoints=grid)
    _, speed, _ = solver.compute_parameterization(0.0, 0.0)
    if speed is None or not np.isfinite(speed).all():
        raise SettingsError("planner.time_law: toppra finds no speeds along a path")
    step = np.diff(grid)
    return float((2.0 * step / (speed[1:] + speed[:-1])).sum())


def _path_of(toppra: Any, curve: PPoly) -> Any:
    """A piecewise polynomial as toppra wants paths."""

    class Path(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc]
        dof = curve.c.shape[2]
        path_interval = np.array([curve.x[0], curve.x[-1]])

        def __call__(self, path_positions: FloatArray, order: int = 0) -> FloatArray:
            return np.asarray(curve(path_positions, order))

    return Path()


def _toppra() -> Any:
    try:
        import toppra
        import toppra.algorithm
        import toppra.constraint
        import toppra.interpolator
    except ImportError:
        raise SettingsError(
            "planner.time_law: toppra needs the package toppra; "
            "pip install 'reachmap-cells[toppra]', or take another law"
        ) from None
    toppra.setup_logging("ERROR")
    return toppra
