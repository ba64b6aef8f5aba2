"""Lattices of points over cubes, and the stitching of cubes into one lattice.

Index order is (z, y, x) everywhere. Coordinates are rounded to a picometre, so that
the level called z = 0 holds exactly 0 and cubes that share a row agree on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray, IntArray

if TYPE_CHECKING:
    from reachmap.cell.model.cell import CubeSpec

MATCH_TOLERANCE_M = 1e-6
"""Points closer than this along every axis are the same point [m]."""

# A choice: picometres, so that 0.1 + 0.2 is stored as 0.3.
_DECIMALS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Lattice:
    """Points of a cube: the product of three rising coordinate arrays [m].

    Attributes
    ----------
    x, y, z : array, shape (nx,), (ny,), (nz,)
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray

    def __post_init__(self) -> None:
        for values in (self.x, self.y, self.z):
            values.setflags(write=False)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of points along (z, y, x)."""
        return (len(self.z), len(self.y), len(self.x))

    def points(self) -> FloatArray:
        """All points [m], shape (nz, ny, nx, 3)."""
        z, y, x = np.meshgrid(self.z, self.y, self.x, indexing="ij")
        return np.stack([x, y, z], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stitching:
    """Where the points of several lattices lie in the one that joins them.

    Attributes
    ----------
    lattice : Lattice
        The union of all coordinates.
    index : tuple of (iz, iy, ix)
        Per lattice, the place of its coordinates in the union.
    """

    lattice: Lattice
    index: tuple[tuple[IntArray, IntArray, IntArray], ...]

    def pool(self, counts: Sequence[FloatArray]) -> FloatArray:
        """Add up counts of the lattices where they share points.

        Parameters
        ----------
        counts : sequence of array, shape (nz, ny, nx)
            One array per lattice.

        Returns
        -------
        array, shape of the union (nz, ny, nx)
        """
        total = np.zeros(self.lattice.shape)
        for index, count in zip(self.index, counts, strict=True):
            total[np.ix_(*index)] += count
        return total


def axis_coordinates(low: float, high: float, count: int) -> FloatArray:
    """Evenly spaced coordinates, ends included; a single one lies in the middle.

    Examples
    --------
    >>> axis_coordinates(-0.75, 0.0, 6).tolist()
    [-0.75, -0.6, -0.45, -0.3, -0.15, 0.0]
    >>> axis_coordinates(0.2, 0.8, 1).tolist()
    [0.5]
    """
    if count == 1:
        return np.round(np.array([(low + high) / 2.0]), _DECIMALS)
    # Adding 0.0 turns the -0.0 that rounding may leave into 0.0.
    return np.round(np.linspace(low, high, count), _DECIMALS) + 0.0


def level_heights(low_m: float, high_m: float, step_m: float) -> FloatArray:
    """Levels from the lowest up in steps; the last is at most ``high_m``.

    A top level that rounding alone puts above ``high_m`` is kept.

    Examples
    --------
    >>> level_heights(-0.1, 0.2, 0.1).tolist()
    [-0.1, 0.0, 0.1, 0.2]
    """
    count = int(np.floor((high_m - low_m) / step_m + 1e-6)) + 1
    return np.round(low_m + step_m * np.arange(count), _DECIMALS) + 0.0


def cube_lattice(cube: CubeSpec, z_step_m: float) -> Lattice:
    """Points of one cube of the workspace scan, in robot_base.

    Parameters
    ----------
    cube : CubeSpec
        Corners, and the number of points along x and y.
    z_step_m : float
        Distance between levels [m].
    """
    return Lattice(
        x=axis_coordinates(cube.min[0], cube.max[0], cube.grid[0]),
        y=axis_coordinates(cube.min[1], cube.max[1], cube.grid[1]),
        z=level_heights(cube.min[2], cube.max[2], z_step_m),
    )


def merge_coordinates(axes: Sequence[FloatArray]) -> FloatArray:
    """Union of coordinates along one axis, rising; near-equal ones count once."""
    values = np.sort(np.concatenate([np.asarray(a, float) for a in axes]))
    first = np.ones(len(values), bool)
    first[1:] = np.diff(values) > MATCH_TOLERANCE_M
    return np.asarray(values[first])


def stitch(lattices: Sequence[Lattice]) -> Stitching:
    """Join lattices into one; points are matched by position, never by index."""
    union = Lattice(
        x=merge_coordinates([item.x for item in lattices]),
        y=merge_coordinates([item.y for item in lattices]),
        z=merge_coordinates([item.z for item in lattices]),
    )
    index = tuple(
        (
            _places(union.z, item.z),
            _places(union.y, item.y),
            _places(union.x, item.x),
        )
        for item in lattices
    )
    return Stitching(lattice=union, index=index)


def _places(union: FloatArray, values: FloatArray) -> IntArray:
    """Index of the nearest union coordinate for each value."""
    return np.asarray(np.abs(union[None, :] - values[:, None]).argmin(axis=1))


def pooled_percent(
    stitching: Stitching, hits: Sequence[FloatArray], attempts: Sequence[FloatArray]
) -> FloatArray:
    """Eq. (1) of the paper, n_ij = 100 r_ij / N_ij, over pooled frames.

    Parameters
    ----------
    stitching : Stitching
    hits, attempts : sequence of array, shape (nz, ny, nx)
        Per lattice, how many frames of each point succeeded and were attempted.

    Returns
    -------
    array, shape (nz, ny, nx)
        Percent; NaN where nothing was attempted.
    """
    tried = stitching.pool(attempts)
    found = stitching.pool(hits)
    percent = np.full(tried.shape, np.nan)
    np.divide(100.0 * found, tried, out=percent, where=tried > 0)
    return percent
