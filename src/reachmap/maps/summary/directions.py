"""Reachability of directions and of points: a part needs one roll, not all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.geometry import approach_directions, rotation_from_quaternion_wxyz
from reachmap.maps.records import BinMap, Status

# Axes of one direction differ by rounding alone; families keep degrees apart.
_SAME_DIRECTION = 1e-6


def same_direction(quaternion_wxyz: FloatArray, approach_axis: str) -> IntArray:
    """Number the approach directions of the orientations at a point.

    Parameters
    ----------
    quaternion_wxyz : array, shape (no, 4)
    approach_axis : str
        TCP axis that points into the object, as in "+z".

    Returns
    -------
    int array, shape (no,)
        0, 1, …; equal for rolls about one axis.
    """
    R = rotation_from_quaternion_wxyz(quaternion_wxyz)
    axes = approach_directions(R, approach_axis)
    apart = np.linalg.norm(axes[:, None] - axes[None], axis=-1)
    first = (apart < _SAME_DIRECTION).argmax(axis=1)
    return np.unique(first, return_inverse=True)[1].astype(np.int64)


def direction_percent(
    found: BoolArray,
    attempted: BoolArray,
    quaternion_wxyz: FloatArray,
    approach_axis: str,
) -> tuple[FloatArray, FloatArray]:
    """Share of directions with at least one roll, and of points with one direction.

    Parameters
    ----------
    found, attempted : bool array, shape (..., no)
        Test grasps with a path, and those that were tried.
    quaternion_wxyz : array, shape (..., no, 4)
        Or (no, 4), where every point has the same orientations.
    approach_axis : str

    Returns
    -------
    directions, points : array, shape (...)
        Percent; points are 100 or 0. NaN where nothing was tried.
    """
    shape, no = found.shape[:-1], found.shape[-1]
    hit, tried = (found & attempted).reshape(-1, no), attempted.reshape(-1, no)
    quaternions = quaternion_wxyz.reshape(-1, no, 4)
    # As a rule every point has the same orientations.
    if len(quaternions) and (quaternions == quaternions[0]).all():
        quaternions = quaternions[:1]
    hits, total = np.zeros(len(hit), np.int64), np.zeros(len(hit), np.int64)
    for k, orientations in enumerate(quaternions):
        rows = slice(None) if len(quaternions) == 1 else slice(k, k + 1)
        direction = same_direction(orientations, approach_axis)
        member = direction[:, None] == np.arange(direction.max(initial=-1) + 1)
        hits[rows] = (hit[rows].astype(np.int64) @ member > 0).sum(axis=1)
        total[rows] = (tried[rows].astype(np.int64) @ member > 0).sum(axis=1)
    directions = np.full(len(hit), np.nan)
    np.divide(100.0 * hits, total, out=directions, where=total > 0)
    points = np.where(total > 0, 100.0 * (hits > 0), np.nan)
    return directions.reshape(shape), points.reshape(shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachedShares:
    """Reached shares of frames, directions and points [percent], NaN if there are none.

    Attributes
    ----------
    frames : float
        Test grasps with a path, as in the paper.
    directions : float
        Approach directions with a path for at least one roll.
    points : float
        Points with at least one such direction.
    """

    frames: float
    directions: float
    points: float


def reached_shares(record: BinMap) -> ReachedShares:
    """Reachability of frames, directions and points of a bin map, over all points."""
    directions, points = reachability_of_directions(record)
    tried = record.status != Status.NOT_ATTEMPTED
    found = record.status == Status.PATH_FOUND
    return ReachedShares(
        frames=mean_of_known(np.where(tried, 100.0 * found, np.nan)),
        directions=mean_of_known(directions),
        points=mean_of_known(points),
    )


def mean_of_known(values: FloatArray) -> float:
    """Mean without NaN; NaN if there is no value."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else float("nan")


def reachability_of_directions(record: BinMap) -> tuple[FloatArray, FloatArray]:
    """Reachability of directions and of points of a bin map, as it stores them.

    See :func:`direction_percent`; maps of version 1.0 do not store it.
    """
    return direction_percent(
        record.status == Status.PATH_FOUND,
        record.status != Status.NOT_ATTEMPTED,
        record.quaternion_wxyz,
        record.approach_axis,
    )
