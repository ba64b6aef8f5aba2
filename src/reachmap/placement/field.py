"""A workspace map as fields over space, one for each tool orientation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.errors import MapFileError
from reachmap.geometry import rotation_from_quaternion_wxyz
from reachmap.maps.records import Status, WorkspaceMap
from reachmap.maps.stitching import stitch_cubes

_EDGE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachField:
    """Shares of frames that are reached, on the stitched lattice.

    Attributes
    ----------
    x, y, z : array, shape (nx,), (ny,), (nz,)
        robot_base [m].
    R : array, shape (no, 3, 3)
        R_base_tcp of each orientation.
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
        R=rotation_from_quaternion_wxyz(quaternion),
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
