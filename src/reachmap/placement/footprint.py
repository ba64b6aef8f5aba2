"""What is picked from a bin: points, tool orientations, and what its walls deny."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.model import BinScanSpec, Cell
from reachmap.sampling.frames import bin_test_frames

COARSE_GRID = (5, 4)
MAX_LAYERS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprint:
    """Test frames of a bin in its own frame.

    Attributes
    ----------
    points : array, shape (np, 3)
        [m].
    R : array, shape (no, 3, 3)
        R_bin_tcp.
    open : bool array, shape (np, no)
        Frames at which the tool itself is clear of the bin; the others are lost
        wherever the bin stands.
    """

    points: FloatArray
    R: FloatArray
    open: BoolArray

    def transforms(self) -> FloatArray:
        """T_bin_tcp of every frame, shape (np * no, 4, 4)."""
        T = np.zeros((len(self.points), len(self.R), 4, 4))
        T[..., :3, :3] = self.R
        T[..., :3, 3] = self.points[:, None]
        T[..., 3, 3] = 1.0
        return T.reshape(-1, 4, 4)


def coarse_spec(spec: BinScanSpec, inner: tuple[float, float, float]) -> BinScanSpec:
    """Bin scan with few points: the cell's orientations, layers and approach.

    The longer side gets the larger count; of many layers the lowest, the middle and
    the highest are kept.
    """
    wanted = COARSE_GRID if inner[0] >= inner[1] else COARSE_GRID[::-1]
    layers = spec.layers
    if len(layers) > MAX_LAYERS:
        layers = (layers[0], layers[len(layers) // 2], layers[-1])
    grid = (min(wanted[0], spec.grid[0]), min(wanted[1], spec.grid[1]))
    return spec.model_copy(update={"grid": grid, "layers": layers})


def footprint_of(cell: Cell) -> Footprint:
    """Coarse test frames of a cell's bin, all of them open."""
    spec = coarse_spec(cell.bin_scan, cell.bin.inner)
    axis = cell.robot.tcp.approach_axis
    frames = bin_test_frames(spec, cell.bin, axis, np.eye(4)).frames
    points = frames.points.reshape(-1, 3)
    return Footprint(
        points=points,
        R=frames.orientations,
        open=np.ones((len(points), len(frames.orientations)), bool),
    )
