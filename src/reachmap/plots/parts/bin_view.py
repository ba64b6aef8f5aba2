"""A bin seen from above, in its own frame: squares, walls, and where the robot is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Rectangle

from reachmap._typing import FloatArray
from reachmap.geometry import inverse_transform
from reachmap.maps.records import BinMap
from reachmap.maps.summary.statistics import attempted, found_after
from reachmap.plots.parts.context import context_of
from reachmap.plots.parts.squares import cell_edges
from reachmap.plots.parts.style import BIN_COLOUR, INK

# Thickness of a wall when the artefact's cell cannot be read [m].
NOMINAL_WALL = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class BinView:
    """What the pictures of one bin map share.

    Attributes
    ----------
    bin_map : BinMap
    outer_m : array, shape (2,)
        Outer x and y of the bin, rim included [m].
    cell_name : str
    """

    bin_map: BinMap
    outer_m: FloatArray
    cell_name: str

    @property
    def margin_m(self) -> float:
        """Room between the inner bottom and the edge of the picture [m]."""
        inner = self.bin_map.bin_inner[:2]
        return float((self.outer_m - inner).max()) / 2.0 + 0.09 * float(inner.min())

    def view(self) -> FloatArray:
        """Lower and upper corner of the picture in the bin frame [m], shape (2, 2)."""
        half = np.asarray(self.bin_map.bin_inner[:2]) / 2.0
        x, y = cell_edges(self.bin_map.x), cell_edges(self.bin_map.y)
        low = np.minimum(-half, [x[0], y[0]]) - self.margin_m
        high = np.maximum(half, [x[-1], y[-1]]) + self.margin_m
        return np.stack([low, high])

    def layer_text(self, layer: int) -> str:
        """Height of a layer, as ``0.05 m above the bottom``."""
        height = float(self.bin_map.layer[layer])
        digits = 2 if abs(height - round(height, 2)) < 5e-4 else 3
        return f"{height:.{digits}f} m above the bottom"


def view_of(bin_map: BinMap) -> BinView:
    """Combine a bin map with the bin of its cell."""
    context = context_of(bin_map.provenance)
    outer = bin_map.bin_inner[:2] + 2.0 * NOMINAL_WALL
    if context.cell is not None:
        outer = np.array(context.cell.bin.outer[:2])
    return BinView(bin_map=bin_map, outer_m=outer, cell_name=context.bin_name)


def percent_after(bin_map: BinMap, attempts: int) -> FloatArray:
    """Share of test grasps reached after some attempts [percent], (nl, ny, nx)."""
    tried = attempted(bin_map)
    hit = (found_after(bin_map, attempts) & tried).sum(axis=-1)
    with np.errstate(invalid="ignore"):
        return np.asarray(100.0 * hit / tried.sum(axis=-1))


def frame_bin(axes: Axes, view: BinView) -> None:
    """Draw the walls to scale and an arrow towards the robot; set the limits."""
    inner = np.asarray(view.bin_map.bin_inner[:2])
    for sides, width in ((inner, 0.9), (view.outer_m, 1.8)):
        axes.add_patch(
            Rectangle(
                (-sides[0] / 2.0, -sides[1] / 2.0),
                *sides,
                fill=False,
                edgecolor=BIN_COLOUR,
                linewidth=width,
                joinstyle="miter",
                zorder=4,
            )
        )
    low, high = view.view()
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    _point_to_robot(axes, view)


def _point_to_robot(axes: Axes, view: BinView) -> None:
    robot = inverse_transform(view.bin_map.bin_pose)[:2, 3]
    distance = float(np.linalg.norm(robot))
    half = view.outer_m / 2.0
    if (np.abs(robot) < half).all():
        return
    towards = robot / distance
    # From the wall outwards, where the ray to the robot leaves the bin.
    with np.errstate(divide="ignore"):
        exits = half / np.abs(towards)
    exit_at = float(exits.min())
    room = (
        view.margin_m - float((view.outer_m - view.bin_map.bin_inner[:2]).max()) / 2.0
    )
    start, end = (towards * (exit_at + part * room) for part in (0.12, 0.92))
    axes.add_patch(
        FancyArrowPatch(
            tuple(start),
            tuple(end),
            arrowstyle="-|>",
            mutation_scale=11,
            shrinkA=0,
            shrinkB=0,
            color=INK,
            linewidth=1.4,
            zorder=5,
        )
    )
    # Beside the arrow, along the wall that the ray leaves through.
    upright = bool(exits[0] <= exits[1])
    axes.annotate(
        "robot",
        tuple((start + end) / 2.0),
        xytext=(0, 9) if upright else (9, 0),
        textcoords="offset points",
        fontsize=8,
        rotation=90.0 if upright else 0.0,
        ha="center" if upright else "left",
        va="bottom" if upright else "center",
        color=INK,
    )
