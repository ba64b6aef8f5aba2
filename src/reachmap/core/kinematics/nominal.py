"""Nominal arms: what a URDF means where it was rounded or the arm calibrated.

EAIK knows an arm only if its axes are parallel, or meet, to 1e-13. A URDF with angles
such as 1.5708 misses that by 1e-5, a calibrated one by 1e-3, and a product of many
rotations by its last place.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.kinematics.least_squares import matrix_difference
from reachmap.core.robot.chain import SerialChain
from reachmap.geometry import nearest_rotation, transform_from_parts

# Largest tilt [rad] and distance [m] that rounding of numbers explains.
_LAST_PLACES = 1e-9

# Largest tilt [rad] and distance [m] that calibration is taken to explain.
_CALIBRATION_RAD = 0.01
_CALIBRATION_M = 0.005

# What five digits leave of a rotation by multiples of 30 or 45 degrees: 3.1416 is off
# by 7e-6, and an origin may have three of them.
_ROUNDED_ANGLE = 2.5e-5
_PLAIN = np.array([0.0, 0.5, np.sqrt(0.5), np.sqrt(0.75), 1.0])

# Fewer cannot correct what rounded angles put beside a pose.
_AXES = 6

# An arm that is further from its nominal one [m and rad] is not merely rounded.
_LARGEST_ROUNDING = 2e-4

# Of the bound that random configurations give, for those that were not tried.
_MARGIN = 1.5


def rounded_arm(chain: SerialChain) -> SerialChain:
    """Arm whose frames are turned by exact multiples of 30 or 45 degrees.

    Angles that are none of these within rounding stay as they are.
    """
    T = chain.T_fixed.copy()
    R = T[:, :3, :3]
    nearest = np.abs(np.abs(R)[..., None] - _PLAIN).argmin(axis=-1)
    plain = np.copysign(_PLAIN[nearest], R)
    R = np.where(np.abs(plain - R) < _ROUNDED_ANGLE, plain, R)
    T = transform_from_parts(nearest_rotation(R), T[:, :3, 3])
    zero = [T[0]]
    for step in T[1:]:
        zero.append(zero[-1] @ step)
    at_zero = np.array(zero)
    return SerialChain.from_axes(
        at_zero[:-1, :3, 2], at_zero[:-1, :3, 3], at_zero[-1], chain.is_revolute
    )


def rounding(chain: SerialChain) -> float:
    """How far rounded angles put poses beside those of the nominal arm [m and rad].

    Zero where they do not, or where the angles are not merely rounded.
    """
    rng = np.random.default_rng(0)
    Q = rng.uniform(-np.pi, np.pi, (200, chain.dof))
    apart = matrix_difference(
        chain.forward_many(Q), rounded_arm(chain).forward_many(Q)
    ).max()
    is_rounded = _LAST_PLACES < apart < _LARGEST_ROUNDING
    return _MARGIN * float(apart) if is_rounded else 0.0


def _of_few_axes(chain: SerialChain) -> SerialChain | None:
    """Arm with exact angles, where the poses asked for are those of that arm."""
    return rounded_arm(chain) if chain.dof < _AXES and rounding(chain) else None


def _as_written(chain: SerialChain) -> SerialChain:
    return chain


def _of_last_places(chain: SerialChain) -> SerialChain:
    return _snapped(chain, _LAST_PLACES, _LAST_PLACES)


def _of_rounded_angles(chain: SerialChain) -> SerialChain:
    return _snapped(rounded_arm(chain), _LAST_PLACES, _LAST_PLACES)


def _of_calibration(chain: SerialChain) -> SerialChain:
    return _snapped(chain, _CALIBRATION_RAD, _CALIBRATION_M)


def _snapped(chain: SerialChain, parallel_rad: float, meeting_m: float) -> SerialChain:
    """Make nearly parallel axes parallel, and nearly meeting neighbours meet."""
    axes, points = chain.axes_base.T.copy(), chain.points_base
    for k in range(1, len(axes)):
        # Any point of an axis describes it; calibration likes far ones.
        along = axes[k] @ (points[k - 1] - points[k])
        points[k] = points[k] + along * axes[k]
        across = np.linalg.norm(np.cross(axes[:k], axes[k]), axis=1)
        parallel = np.flatnonzero(across < parallel_rad)
        if len(parallel):
            reference = axes[parallel[0]]
            axes[k] = reference * np.sign(reference @ axes[k])
        if k - 1 in parallel:
            continue
        meeting = _meeting_point(axes, points, k, meeting_m)
        if meeting is not None:
            points[k] = meeting
    return SerialChain.from_axes(axes, points, chain.tcp_at_zero, chain.is_revolute)


def _meeting_point(
    axes: FloatArray, points: FloatArray, k: int, within_m: float
) -> FloatArray | None:
    """Point where axis k is to meet the one before, None if they pass at a distance."""
    a, b, between = axes[k - 1], axes[k], points[k] - points[k - 1]
    normal = np.cross(a, b)
    if abs(between @ normal) > within_m * np.linalg.norm(normal):
        return None
    # Where the common normal leaves the axis before.
    share = np.linalg.det(np.array([between, b, normal])) / (normal @ normal)
    meeting = points[k - 1] + share * a
    if np.linalg.norm(meeting - points[k - 1]) < within_m:
        # Three axes of a spherical wrist: the last meets where the two before do.
        return np.asarray(points[k - 1])
    return np.asarray(meeting)


# Ways to the nominal arm of a chain of revolute joints, the nearest arm first; None
# where a way is not for the chain.
NOMINAL_ARMS: tuple[Callable[[SerialChain], SerialChain | None], ...] = (
    _of_few_axes,
    _as_written,
    _of_last_places,
    _of_rounded_angles,
    _of_calibration,
)
