"""What is picked from a bin: few test frames that stand for all of the cell's.

Reachability falls off at the walls, so the few points include those of the cell's grid
that are nearest to them; each counts as many times as it stands for points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.cell.model import Cell
from reachmap.sampling.frames import FrameGrid, bin_test_frames

Grid = tuple[int, int]
THIN: Grid = (4, 3)
COARSE: Grid = (5, 4)
MAX_LAYERS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """Some of the test frames of a bin.

    Attributes
    ----------
    frames : FrameGrid
        In robot_base, shape (layers, y, x, orientations).
    weights : array, shape (points,)
        Share of the pick volume that each point stands for; they add up to 1.
    """

    frames: FrameGrid
    weights: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprint:
    """A sample in the bin's own frame.

    Attributes
    ----------
    points : array, shape (np, 3)
        [m].
    weights : array, shape (np,)
    R : array, shape (no, 3, 3)
        R_bin_tcp.
    open : bool array, shape (np, no)
        Frames at which the tool itself is clear of the bin; the others are lost
        wherever the bin stands.
    """

    points: FloatArray
    weights: FloatArray
    R: FloatArray
    open: BoolArray


def sample_of(cell: Cell, grid: Grid, T_base_bin: FloatArray) -> Sample:
    """Test frames at few points, with the cell's own orientations.

    Of many layers the lowest, the middle and the highest are kept.

    Parameters
    ----------
    cell : Cell
    grid : (int, int)
        Points along the longer and the shorter side, if the cell has as many.
    T_base_bin : array, shape (4, 4)
    """
    spec, inner = cell.bin_scan, cell.bin.inner
    axis = cell.robot.tcp.approach_axis
    every = bin_test_frames(spec, cell.bin, axis, T_base_bin).frames
    wanted = grid if inner[0] >= inner[1] else grid[::-1]
    x, x_weights = spread_indices(spec.grid[0], wanted[0])
    y, y_weights = spread_indices(spec.grid[1], wanted[1])
    count = len(spec.layers)
    layers = np.arange(count)
    if count > MAX_LAYERS:
        layers = np.array([0, count // 2, count - 1])
    weights = np.broadcast_to(
        np.outer(y_weights, x_weights) / len(layers), (len(layers), len(y), len(x))
    )
    return Sample(
        frames=FrameGrid(
            points=every.points[np.ix_(layers, y, x)], orientations=every.orientations
        ),
        weights=weights.ravel(),
    )


def spread_indices(count: int, wanted: int) -> tuple[IntArray, FloatArray]:
    """Few of the indices 0 … ``count`` − 1, with the share each stands for.

    The first and the last stand for themselves, the others for equal parts of the
    rest, in the middle of which they lie.

    Examples
    --------
    >>> index, weight = spread_indices(20, 5)
    >>> index.tolist(), weight.round(2).tolist()
    ([0, 3, 9, 16, 19], [0.05, 0.3, 0.3, 0.3, 0.05])
    """
    if count <= max(wanted, 2):
        return np.arange(count), np.full(count, 1.0 / count)
    inner = np.array_split(np.arange(1, count - 1), max(wanted - 2, 1))
    middle = (count - 1) / 2
    index = [
        # Between two, the one nearer to the wall.
        int(np.floor(part.mean()) if part.mean() <= middle else np.ceil(part.mean()))
        for part in inner
    ]
    sizes = [1, *(len(part) for part in inner), 1]
    return np.array([0, *index, count - 1]), np.array(sizes) / count


def footprint_of(cell: Cell) -> Footprint:
    """Coarse sample of a cell's bin, all of it open."""
    sample = sample_of(cell, COARSE, np.eye(4))
    points = sample.frames.points.reshape(-1, 3)
    return Footprint(
        points=points,
        weights=sample.weights,
        R=sample.frames.orientations,
        open=np.ones((len(points), len(sample.frames.orientations)), bool),
    )
