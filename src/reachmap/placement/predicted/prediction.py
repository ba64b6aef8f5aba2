"""Scores of very many bin poses from the map alone, by interpolation.

The bin is not in the map. Two things replace it: the frames at which its walls
would touch the tool, wherever the bin stands, count as lost; and every frame is looked
up under the orientation of the map nearest to its own. What the walls do to the rest
of the arm shows only when the best poses are mapped again with the bin in the scene.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.model.cell import Cell
from reachmap.errors import MapFileError
from reachmap.geometry import rotation_from_quaternion_wxyz
from reachmap.maps.records import Status, WorkspaceMap, stitch_cubes
from reachmap.placement.mapped.sample import frames_in_bin, spread_indices

# Along the longer and the shorter side, 20 as in a coarse bin scan.
POINTS = (5, 4)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Footprint:
    """Points of a bin and the orientations of its tools, in the bin frame.

    Attributes
    ----------
    points : array, shape (np, 3)
        [m].
    weights : array, shape (np,)
        Share of the pick volume that each point stands for; they add up to 1.
    R : array, shape (no, 3, 3)
        R_bin_tcp.
    open : array, shape (np, no)
        Share of the frames around each point that the tool can take; the others are
        lost wherever the bin stands.
    """

    points: FloatArray
    weights: FloatArray
    R: FloatArray
    open: FloatArray


def footprint_of(cell: Cell, is_open: BoolArray) -> Footprint:
    """A few points of a cell's bin, with all orientations.

    Parameters
    ----------
    cell : Cell
    is_open : bool array, shape (layers, y, x, orientations)
        See :func:`reachmap.placement.mapped.sample.open_frames`.
    """
    frames, inner = frames_in_bin(cell), cell.bin.inner
    layers, y, x, _ = frames.shape
    wanted = POINTS if inner[0] >= inner[1] else POINTS[::-1]
    ix, x_share = spread_indices(x, wanted[0])
    iy, y_share = spread_indices(y, wanted[1])
    here = np.ix_(np.arange(layers), iy, ix)
    by_y = np.add.reduceat(is_open, _begins(y_share), axis=1, dtype=float)
    by_both = np.add.reduceat(by_y, _begins(x_share), axis=2)
    points = len(iy) * len(ix)
    weights = np.outer(y_share, x_share).ravel() / layers
    counts = np.tile(weights * layers * x * y, layers)[:, None]
    return Footprint(
        points=frames.points[here].reshape(-1, 3),
        weights=np.tile(weights, layers),
        R=frames.orientations,
        open=by_both.reshape(layers * points, -1) / counts,
    )


def _begins(share: FloatArray) -> list[int]:
    """First index of each part that was spread, see :func:`spread_indices`."""
    ends = np.rint(np.cumsum(share) / share[0]).astype(int)
    return [0, *ends[:-1].tolist()]


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
        Percent, see :class:`~reachmap.placement.mapped.exact.PoseScore`.
    """

    grid: PoseGrid
    score: FloatArray
    worst_point: FloatArray
    reachable_share: FloatArray


def orientation_shares(
    field: ReachField, footprint: Footprint, yaw_rad: float
) -> tuple[FloatArray, FloatArray]:
    """Weight of each orientation of the map at each point of the bin.

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


# Rounding of a lattice's last coordinate.
_EDGE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachField:
    """Shares of frames that are reached, on the stitched lattice.

    Attributes
    ----------
    x, y, z : array, shape (nx,), (ny,), (nz,)
        Level frame of the cell [m].
    R : array, shape (no, 3, 3)
        R_level_tcp of each orientation.
    path, ik : array, shape (no, nz, ny, nx)
        Share of frames with a path, and with an IK solution, from 0 to 1; 0 where
        nothing was attempted.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    R: FloatArray
    path: FloatArray
    ik: FloatArray


def field_of(workspace: WorkspaceMap) -> ReachField:
    """Pool the frames of all cubes, orientation by orientation.

    Parameters
    ----------
    workspace : WorkspaceMap
        With its lattice in the cell's level frame.

    Raises
    ------
    MapFileError
        The cubes were scanned with different orientations.
    """
    cubes = list(workspace.cubes.values())
    quaternion = cubes[0].quaternion_wxyz
    for cube in cubes[1:]:
        if not np.array_equal(cube.quaternion_wxyz, quaternion):
            raise MapFileError("the cubes of this map have different orientations")
    stitching = stitch_cubes(workspace.cubes)
    attempted = [cube.status != Status.NOT_ATTEMPTED for cube in cubes]
    hits = {
        "path": [cube.status == Status.PATH_FOUND for cube in cubes],
        "ik": [(cube.n_ik > 0) & a for cube, a in zip(cubes, attempted, strict=True)],
    }
    shares: dict[str, list[FloatArray]] = {name: [] for name in hits}
    for k in range(len(quaternion)):
        tried = stitching.pool([a[..., k].astype(float) for a in attempted])
        for name, found in hits.items():
            count = stitching.pool([f[..., k].astype(float) for f in found])
            shares[name].append(count / np.maximum(tried, 1.0))
    lattice = stitching.lattice
    return ReachField(
        x=lattice.x,
        y=lattice.y,
        z=lattice.z,
        R=workspace.T_base_grid[:3, :3].T @ rotation_from_quaternion_wxyz(quaternion),
        path=np.array(shares["path"]),
        ik=np.array(shares["ik"]),
    )


def linear_weights(grid: FloatArray, at: FloatArray) -> FloatArray:
    """Weights of linear interpolation, rows of zeros outside the grid.

    Parameters
    ----------
    grid : array, shape (n,)
        Rising coordinates; between them values change linearly.
    at : array, shape (k,)

    Returns
    -------
    array, shape (k, n)

    Examples
    --------
    >>> linear_weights(np.array([0.0, 1.0]), np.array([0.25, 2.0])).tolist()
    [[0.75, 0.25], [0.0, 0.0]]
    """
    inside = (at >= grid[0] - _EDGE) & (at <= grid[-1] + _EDGE)
    place = np.interp(at, grid, np.arange(len(grid)))
    low = np.minimum(place.astype(int), max(len(grid) - 2, 0))
    share = place - low
    weights = np.zeros((len(at), len(grid)))
    rows = np.arange(len(at))
    weights[rows, low] = 1.0 - share
    if len(grid) > 1:
        weights[rows, low + 1] += share
    return np.asarray(weights * inside[:, None])
