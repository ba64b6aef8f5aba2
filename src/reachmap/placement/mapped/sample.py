"""A sample of the test frames of a bin that represents all of them.

Two things make a few hundred frames as good as all. What the tool itself loses to the
bin's walls is the same wherever the bin stands, so it is counted once, over all frames
(:func:`open_frames`); the sample only has to estimate the reachability of the rest. And
neighbouring points fare alike, so each point of the sample has a part of the
orientations only, and its neighbours have the others. What remains are points close to
each other in place of orientations of the same point, which fail together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.robot import LISTED
from reachmap.core.collision.bin_fit import ToolFit
from reachmap.geometry import axis_turns
from reachmap.sampling.frames import FrameGrid, bin_test_frames
from reachmap.scans.rolls import RollGroups

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.core.robot.model import RobotModel

# Points along the longer and the shorter side; of the orientations every n-th.
Grid = tuple[int, int, int]
COARSE: Grid = (8, 6, 3)
DENSE: Grid = (8, 6, 1)
THIN: Grid = (6, 5, 3)
QUICK: Grid = (4, 3, 3)
MAX_LAYERS = 3
# Rolls that are tried where any will do: a scan may try more of them.
MOST_ROLLS = 8
LEAST_ORIENTATIONS = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """Some of the test frames of a bin, point by point.

    Attributes
    ----------
    T_bin_tcp : array, shape (n, 4, 4)
    point : int array, shape (n,)
        Point of each frame, rising from 0.
    share : array, shape (n,)
        Share of all test frames that each stands for; they add up to 1.
    weight : array, shape (n,)
        The same of the frames that the tool can take, 0 for the others; they add up
        to the share of these among all test frames.
    open_share : array, shape (points,)
        Share of a point's frames, all of them, that the tool can take.
    """

    T_bin_tcp: FloatArray
    point: IntArray
    share: FloatArray
    weight: FloatArray
    open_share: FloatArray

    def standard_error(self, found: BoolArray) -> float:
        """Standard error of the weighted share of frames that are reached.

        Of the frames that the tool can take; the others are counted, not sampled. One
        more success and one more failure than were seen keep it above 0 where all are
        reached or none is.
        """
        can = self.weight > 0
        share = (int((found & can).sum()) + 1.0) / (int(can.sum()) + 2.0)
        return float(np.sqrt(share * (1.0 - share) * (self.weight**2).sum()))

    def worst_point(self, found: BoolArray) -> float:
        """Least share of a point's frames that are reached, shape (n,) to a number.

        What the tool loses to the walls is known of all frames of a point; of the
        others those in the sample stand for all.
        """
        can = self.weight > 0
        tried = np.bincount(self.point, can)
        reached = np.bincount(self.point, can & found)
        share = self.open_share * reached / np.maximum(tried, 1.0)
        known = (tried > 0) | (self.open_share == 0)
        return float(share[known].min())


def frames_in_bin(cell: Cell) -> FrameGrid:
    """All test frames of a cell in the bin frame, (layers, y, x, orientations).

    Of many layers the lowest, the middle and the highest are kept; of orientations
    that differ by a roll that does not matter, the first.
    """
    T_base_bin = cell.T_base_level()
    R_base_bin, p_base_bin = T_base_bin[:3, :3], T_base_bin[:3, 3]
    in_base = bin_test_frames(cell, T_base_bin).frames
    frames = FrameGrid(
        points=(in_base.points - p_base_bin) @ R_base_bin,
        orientations=R_base_bin.T @ in_base.orientations,
    )
    points = frames.points[kept_layers(len(frames.points))]
    orientations = frames.orientations
    if cell.tool.roll != LISTED:
        one_point = FrameGrid(points=points[:1, :1, :1], orientations=orientations)
        axis = cell.robot.tcp.approach_axis
        groups = RollGroups.of(one_point, axis, cell.tool).group
        orientations = orientations[np.unique(groups, return_index=True)[1]]
    return FrameGrid(points=points, orientations=orientations)


def rolls_of(cell: Cell) -> FloatArray:
    """Equivalent rolls about the approach axis, shape (n,) [rad].

    0 alone where rolls are as listed; of many that are free, a few.
    """
    count = min(cell.tool.count(), MOST_ROLLS)
    return 2.0 * np.pi * np.arange(count) / count


def rolled(cell: Cell, T: FloatArray) -> FloatArray:
    """Poses T_base_tcp at all equivalent rolls, (n, 4, 4) to (n, rolls, 4, 4)."""
    turns = axis_turns(cell.robot.tcp.approach_axis, rolls_of(cell))
    return np.asarray(T[..., None, :, :] @ turns)


def kept_layers(count: int) -> list[int]:
    """Layers used by placement: of many the lowest, middle and highest."""
    return list(range(count)) if count <= MAX_LAYERS else [0, count // 2, count - 1]


def open_frames(robot: RobotModel, loaded: LoadedCell) -> BoolArray:
    """Which of :func:`frames_in_bin` the tool can take without touching the bin.

    The others are lost wherever the bin stands and whatever the arm does. Parts that
    fill the bin are in the way of the tool as its walls are.
    """
    frames, cell = frames_in_bin(loaded.cell), loaded.cell
    T = rolled(cell, frames.transforms())
    layers = kept_layers(len(cell.bin_scan.layers))
    if not cell.bin_scan.is_filled:
        blocked = ToolFit(robot, loaded).blocked(T.reshape(-1, 4, 4))
    else:
        blocked = np.concatenate(
            [
                ToolFit(robot, loaded.filled_to(layer)).blocked(rows.reshape(-1, 4, 4))
                for layer, rows in zip(layers, T, strict=True)
            ]
        )
    return np.asarray(~blocked.reshape(T.shape[:-2]).all(axis=-1))


def sample_of(cell: Cell, grid: Grid, is_open: BoolArray) -> Sample:
    """Choose frames on a grid of points, as far as the cell has as many.

    Parameters
    ----------
    cell : Cell
    grid : (int, int, int)
        Points along the longer and the shorter side of the bin, and n: every n-th
        orientation, other ones at each point; 1 for all.
    is_open : bool array, shape (layers, y, x, orientations)
        See :func:`open_frames`.
    """
    frames = frames_in_bin(cell)
    layers, y, x, orientations = frames.shape
    inner, (longer, shorter, part) = cell.bin.inner, grid
    along_x, along_y = (longer, shorter) if inner[0] >= inner[1] else (shorter, longer)
    ix, x_share = spread_indices(x, along_x)
    iy, y_share = spread_indices(y, along_y)
    chosen = np.zeros(frames.shape, bool)
    part = max(min(part, orientations // LEAST_ORIENTATIONS), 1)
    k = np.arange(orientations)
    for layer in range(layers):
        for row, j in enumerate(iy):
            for column, i in enumerate(ix):
                turn = layer + 2 * row + column
                chosen[layer, j, i] = (k + k // part + turn) % part == 0
    index = np.flatnonzero(chosen)
    point = np.unique(index // orientations, return_inverse=True)[1]
    point_share = np.outer(y_share, x_share).ravel() / layers
    point_share = np.tile(point_share, layers) / np.bincount(point)
    share = point_share[point]
    weight = share * is_open.ravel()[index]
    weight *= is_open.mean() / max(float(weight.sum()), 1e-12)
    return Sample(
        T_bin_tcp=frames.transforms_at(index),
        point=point,
        share=share,
        weight=weight,
        open_share=is_open[np.ix_(np.arange(layers), iy, ix)].mean(axis=-1).ravel(),
    )


def spread_indices(count: int, wanted: int) -> tuple[IntArray, FloatArray]:
    """A few of the indices 0 … ``count`` − 1, with the share each represents.

    Reachability falls off at the walls: the first and the last stand for themselves,
    the others for equal parts of the rest, in the middle of which they lie.

    Examples
    --------
    >>> index, share = spread_indices(20, 5)
    >>> index.tolist(), share.round(2).tolist()
    ([0, 3, 9, 16, 19], [0.05, 0.3, 0.3, 0.3, 0.05])
    """
    if count <= max(wanted, 2):
        return np.arange(count), np.full(count, 1.0 / count)
    inner, parts = count - 2, max(wanted - 2, 1)
    cuts = inner * np.arange(parts + 1) / parts
    # Rounded the same way from both walls.
    rounded = np.floor(np.minimum(cuts, inner - cuts) + 0.5)
    ends = np.where(cuts <= inner / 2, rounded, inner - rounded).astype(int)
    middle = 1 + (ends[:-1] + ends[1:] - 1) / 2
    index = np.where(
        # Between two, the one nearer to the wall.
        middle <= (count - 1) / 2,
        np.floor(middle),
        np.ceil(middle),
    ).astype(int)
    sizes = [1, *np.diff(ends), 1]
    return np.array([0, *index, count - 1]), np.array(sizes) / count
