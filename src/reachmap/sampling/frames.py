"""Test frames: the tool poses that a scan tries to reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.cell import Cell
from reachmap.geometry import (
    approach_directions,
    quaternion_wxyz_from_rotation,
    transform_from_parts,
    transform_points,
)
from reachmap.sampling.lattice import Lattice, cube_lattice
from reachmap.sampling.orientations import orientation_set, reference_rotation


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameGrid:
    """Points times orientations, in robot_base.

    The poses are the product of the two arrays; they are built for the frames that
    are asked for, since ten million matrices would not fit beside the work on them.

    Attributes
    ----------
    points : array, shape (..., 3)
        Index order (z, y, x) or (layer, y, x) [m].
    orientations : array, shape (no, 3, 3)
        R_base_tcp.
    """

    points: FloatArray
    orientations: FloatArray

    def __post_init__(self) -> None:
        self.points.setflags(write=False)
        self.orientations.setflags(write=False)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array of frames: the points', then the orientations."""
        return (*self.points.shape[:-1], len(self.orientations))

    @property
    def size(self) -> int:
        """Number of frames."""
        return int(np.prod(self.shape))

    @property
    def quaternion_wxyz(self) -> FloatArray:
        """The orientations as unit quaternions, shape (no, 4)."""
        return quaternion_wxyz_from_rotation(self.orientations)

    def transforms(self) -> FloatArray:
        """T_base_tcp of every frame, shape (..., no, 4, 4)."""
        return transform_from_parts(self.orientations, self.points[..., None, :])

    def transforms_at(self, flat: IntArray | slice) -> FloatArray:
        """T_base_tcp of some frames by flat index (orientation fastest), (n, 4, 4)."""
        chosen = np.arange(self.size)[flat] if isinstance(flat, slice) else flat
        point, orientation = np.divmod(chosen, len(self.orientations))
        return transform_from_parts(
            self.orientations[orientation], self.points.reshape(-1, 3)[point]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameList:
    """Frames that are not a product of points and orientations.

    Attributes
    ----------
    T : array, shape (n, 4, 4)
        T_base_tcp.
    """

    T: FloatArray

    @property
    def size(self) -> int:
        """Number of frames."""
        return len(self.T)

    def transforms_at(self, flat: IntArray | slice) -> FloatArray:
        """T_base_tcp of some frames, shape (n, 4, 4)."""
        return self.T[flat]


@dataclass(frozen=True, slots=True, kw_only=True)
class CubeFrames:
    """A cube of the workspace scan and its test frames."""

    name: str
    lattice: Lattice
    frames: FrameGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class BinFrames:
    """The grid inside a bin and its test frames.

    Attributes
    ----------
    layer, y, x : array, shape (nl,), (ny,), (nx,)
        Grid coordinates in the bin frame: origin at the centre of the inner bottom,
        x along the inner x side, z up [m].
    frames : FrameGrid
        In robot_base, shape (nl, ny, nx, no).
    """

    layer: FloatArray
    y: FloatArray
    x: FloatArray
    frames: FrameGrid

    @property
    def T_base_tcp(self) -> FloatArray:  # noqa: N802
        """Every test frame, shape (nl, ny, nx, no, 4, 4)."""
        return self.frames.transforms()


def workspace_frames(cell: Cell) -> tuple[CubeFrames, ...]:
    """Test frames of each cube of a cell's workspace scan."""
    spec, T_base_grid = cell.workspace_scan, cell.T_base_grid()
    R_base_reference = reference_rotation(
        spec.orientations, cell, np.eye(3), cell.T_base_bin()[:3, :3]
    )
    R_reference_tcp = orientation_set(spec.orientations, cell.robot.tcp.approach_axis)
    cubes = []
    for cube in spec.cubes:
        lattice = cube_lattice(cube, spec.z_step)
        frames = FrameGrid(
            points=transform_points(T_base_grid, lattice.points()),
            orientations=R_base_reference @ R_reference_tcp,
        )
        cubes.append(CubeFrames(name=cube.name, lattice=lattice, frames=frames))
    return tuple(cubes)


def bin_test_frames(cell: Cell, T_base_bin: FloatArray) -> BinFrames:
    """Test frames inside a bin; orientations turn with the bin about the vertical.

    Parameters
    ----------
    cell : Cell
        Its own bin pose is not used.
    T_base_bin : array, shape (4, 4)
        Pose of the bin frame in robot_base.
    """
    spec = cell.bin_scan
    x = cell_centres(cell.bin.inner[0], spec.grid[0])
    y = cell_centres(cell.bin.inner[1], spec.grid[1])
    layer = np.array(spec.layers, float)
    p_bin = Lattice(x=x, y=y, z=layer).points()
    R_base_bin = T_base_bin[:3, :3]
    R_base_reference = reference_rotation(
        spec.orientations, cell, R_base_bin, R_base_bin
    )
    R_reference_tcp = orientation_set(spec.orientations, cell.robot.tcp.approach_axis)
    frames = FrameGrid(
        points=p_bin @ R_base_bin.T + T_base_bin[:3, 3],
        orientations=R_base_reference @ R_reference_tcp,
    )
    return BinFrames(layer=layer, y=y, x=x, frames=frames)


# How far above the rim an approach begins where it is to clear it [m].
_ABOVE_RIM_M = 0.01
# Directions this far from the bin's vertical never clear the rim along themselves.
_STEEPEST = np.cos(np.deg2rad(75.0))


def approach_distance_m(cell: Cell) -> float:
    """Length of the straight approaches of a cell's bin scan [m]."""
    distance = cell.bin_scan.approach_distance_m
    if not isinstance(distance, str):
        return float(distance)
    steepness = _steepness(cell)
    steepness = steepness[steepness > _STEEPEST]
    if not len(steepness):
        return 0.0
    depth_m = cell.bin.inner[2] + _ABOVE_RIM_M - min(cell.bin_scan.layers)
    return max(0.0, round(float(depth_m / steepness.min()), 6))


def below_rim_m(cell: Cell) -> float:
    """Deepest start of an approach below the rim [m]; negative: all start above it."""
    begins = min(cell.bin_scan.layers) + approach_distance_m(cell) * _steepness(cell)
    return float(cell.bin.inner[2] - begins.min())


def _steepness(cell: Cell) -> FloatArray:
    """Rise of each orientation's approach, backwards, along the bin's z."""
    T_base_bin = cell.T_base_bin()
    R_base_tcp = bin_test_frames(cell, T_base_bin).frames.orientations
    forwards = approach_directions(R_base_tcp, cell.robot.tcp.approach_axis)
    return np.asarray(-forwards @ T_base_bin[:3, 2])


def cell_centres(side: float, count: int) -> FloatArray:
    """Centres of ``count`` equal cells along a side centred on 0 [m].

    Examples
    --------
    >>> cell_centres(0.3, 3).tolist()
    [-0.1, 0.0, 0.1]
    """
    centres = (np.arange(count) - (count - 1) / 2.0) * (side / count)
    return np.round(centres, 12) + 0.0
