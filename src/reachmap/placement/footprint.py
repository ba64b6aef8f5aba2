"""What is looked up on the map for a bin: few points, and the tools at each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.model import Cell
from reachmap.placement.sample import frames_in_bin, spread_indices

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
    """Few points of a cell's bin, all orientations.

    Parameters
    ----------
    cell : Cell
    is_open : bool array, shape (layers, y, x, orientations)
        See :func:`reachmap.placement.sample.open_frames`.
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
