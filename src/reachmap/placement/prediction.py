"""Scores of very many bin poses from the map alone, by interpolation.

The bin is not in the map. Two things stand in for it: the frames at which its walls
would touch the tool, wherever the bin stands, count as lost; and every frame is looked
up under the orientation of the map nearest to its own. What the walls do to the rest
of the arm shows only when the best poses are mapped again with the bin in the scene.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.placement.field import ReachField, linear_weights
from reachmap.placement.footprint import Footprint


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseGrid:
    """Poses of the bin on a grid: x, y, z of the inner bottom [m], yaw [rad]."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    yaw: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Scores on a grid of poses.

    Attributes
    ----------
    grid : PoseGrid
    score, worst_point, reachable_share : array, shape (nyaw, nz, ny, nx)
        Percent, see :class:`~reachmap.placement.exact.PoseScore`.
    """

    grid: PoseGrid
    score: FloatArray
    worst_point: FloatArray
    reachable_share: FloatArray


def orientation_shares(
    field: ReachField, footprint: Footprint, yaw_rad: float
) -> tuple[FloatArray, FloatArray]:
    """How much each orientation of the map stands for at each point of the bin.

    Returns
    -------
    open_shares, all_shares : array, shape (np, no)
        Share of a point's frames that are looked up under each orientation, of those
        that the tool can take and of all.
    """
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    # The trace of R_aᵀ R_b falls with the angle between a and b.
    likeness = np.einsum("aij,bij->ab", turn @ footprint.R, field.R)
    # Rounded, so that equal angles do not depend on the last digit.
    nearest = np.round(likeness, 9).argmax(axis=1)
    shares = np.zeros((len(footprint.R), len(field.R)))
    shares[np.arange(len(nearest)), nearest] = 1.0 / len(nearest)
    every = np.broadcast_to(shares.sum(axis=0), (len(footprint.points), len(field.R)))
    return footprint.open @ shares, every


def predict(field: ReachField, footprint: Footprint, grid: PoseGrid) -> Prediction:
    """Score every pose of a grid."""
    shape = (len(grid.yaw), len(grid.z), len(grid.y), len(grid.x))
    score, worst, ik = (np.zeros(shape) for _ in range(3))
    worst.fill(np.inf)
    for k, yaw in enumerate(grid.yaw):
        open_shares, all_shares = orientation_shares(field, footprint, float(yaw))
        c, s = np.cos(yaw), np.sin(yaw)
        for p, (u, v, w) in enumerate(footprint.points):
            weights = (
                linear_weights(field.z, grid.z + w),
                linear_weights(field.y, grid.y + s * u + c * v),
                linear_weights(field.x, grid.x + c * u - s * v),
            )
            percent = 100.0 * _sampled(field.path, open_shares[p], weights)
            score[k] += footprint.weights[p] * percent
            np.minimum(worst[k], percent, out=worst[k])
            share = _sampled(field.ik, all_shares[p], weights)
            ik[k] += 100.0 * footprint.weights[p] * share
    return Prediction(grid=grid, score=score, worst_point=worst, reachable_share=ik)


def _sampled(
    values: FloatArray,
    shares: FloatArray,
    weights: tuple[FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    """Weighted orientations (no, nz, ny, nx), interpolated on a grid (kz, ky, kx)."""
    by_z, by_y, by_x = weights
    mixed = np.tensordot(shares, values, axes=1)
    along_z = np.tensordot(by_z, mixed, axes=1)
    return np.asarray(by_y @ (along_z @ by_x.T))
