"""One quantity on all levels, with the words and outlines that go with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.colors import Colormap

from reachmap._typing import FloatArray
from reachmap.maps.records import WorkspaceMap
from reachmap.maps.summary.statistics import best_level, level_means
from reachmap.maps.summary.upright import name_of_frame
from reachmap.plots.parts.context import context_of, levels_of, patch_shape
from reachmap.plots.parts.levels import (
    QUANTITY_NAMES,
    Quantity,
    level_names,
    quantity_values,
)
from reachmap.plots.parts.outlines import Outline
from reachmap.plots.parts.squares import MINUS, cell_edges
from reachmap.plots.parts.style import (
    DIFFERENCE_MAP,
    PercentMap,
    colour_map,
    subtitle_of,
)

# Bodies larger than this are cut at the edge of the picture instead of widening it.
LARGE_BODY = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelStack:
    """One quantity on all levels, with what is drawn over it.

    Attributes
    ----------
    x, y, z : array, shape (nx,), (ny,), (nz,)
        Stitched lattice [m].
    values : array, shape (nz, ny, nx)
        Percent, NaN where nothing was attempted.
    quantity : str
    outlines : tuple of Outline
        Base, bodies and bin; each level shows those near it.
    patch : (int, int)
        Rows and columns of the patch to mark on the best level.
    cell_name : str
    frame : str
        Frame that ``x``, ``y`` and ``z`` are in.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    values: FloatArray
    quantity: Quantity
    outlines: tuple[Outline, ...] = ()
    patch: tuple[int, int] = (3, 3)
    cell_name: str = ""
    frame: str = "robot_base"

    def colours(self, percent_map: PercentMap) -> Colormap:
        """Colour map of the quantity; the difference has one of its own."""
        name = DIFFERENCE_MAP if self.quantity == "difference" else percent_map
        return colour_map(name)

    def view(self) -> FloatArray:
        """Lower and upper corner of the picture [m], shape (2, 2).

        All squares, the robot base and the bin, and the smaller bodies among them.
        """
        x, y = cell_edges(self.x), cell_edges(self.y)
        low, high = np.array([x[0], y[0]]), np.array([x[-1], y[-1]])
        squares = np.stack([low, high])
        for outline in self.outlines:
            corners = np.stack(
                [outline.polygon.min(axis=0), outline.polygon.max(axis=0)]
            )
            if outline.kind == "body" and (
                np.ptp(corners, axis=0).max() > LARGE_BODY
                or not _overlap(corners, squares)
            ):
                continue
            low = np.where(corners[0] < low, corners[0] - 0.02, low)
            high = np.where(corners[1] > high, corners[1] + 0.02, high)
        return np.stack([low, high])

    def shown(self, level: int) -> tuple[Outline, ...]:
        """Outlines to draw on a level: the base, and what is near and in view.

        Near means within half a level step.
        """
        step = float(np.diff(self.z).min()) if self.z.size > 1 else 0.1
        view, z = self.view(), float(self.z[level])
        return tuple(
            outline
            for outline in self.outlines
            if outline.kind == "base"
            or (outline.near(z, step / 2.0) and _crosses(view, outline.polygon))
        )


def stack_of(workspace: WorkspaceMap, quantity: Quantity) -> LevelStack:
    """Levels of a quantity, with the outlines of the cell the map was made for."""
    workspace = levels_of(workspace)
    context = context_of(workspace.provenance)
    return LevelStack(
        x=workspace.x,
        y=workspace.y,
        z=workspace.z,
        values=quantity_values(workspace, quantity),
        quantity=quantity,
        outlines=(*context.standing, *context.bin),
        patch=patch_shape(context.bin, workspace.x, workspace.y),
        cell_name=context.name,
        frame=name_of_frame(workspace.T_base_grid, workspace.T_world_base),
    )


def height_text(stack: LevelStack, level: int) -> str:
    """Height of a level, as ``z = +0.00 m``."""
    return f"z = {level_names(stack.z)[level].replace('-', MINUS)} m"


def mean_text(stack: LevelStack, level: int) -> str:
    """Mean of a level with its unit, or that nothing was attempted."""
    mean = float(level_means(stack.values)[level])
    if np.isnan(mean):
        return "not attempted"
    return f"{mean:.1f} {'points' if stack.quantity == 'difference' else '%'}"


def level_title(stack: LevelStack, level: int) -> str:
    """Title of a level, as ``z = +0.00 m · path reachability · mean 53.5 %``."""
    mean = mean_text(stack, level)
    said = mean if mean == "not attempted" else f"mean {mean}"
    return f"{height_text(stack, level)} · {QUANTITY_NAMES[stack.quantity]} · {said}"


def best_text(stack: LevelStack) -> str:
    """Which level is the best one, as ``best level: z = +0.00 m, 53.5 %``."""
    best = best_level(stack.values)
    if best is None:
        return "nothing attempted"
    word = "largest gap" if stack.quantity == "difference" else "best level"
    return f"{word}: {height_text(stack, best)}, {mean_text(stack, best)}"


def level_subtitle(stack: LevelStack, level: int) -> str:
    """Where the level stands among all, and the name of the cell."""
    word = "largest gap" if stack.quantity == "difference" else "best level"
    is_best = level == best_level(stack.values)
    said = f"this is the {word} of {stack.z.size}" if is_best else best_text(stack)
    return subtitle_of((said, stack.cell_name))


def _overlap(a: FloatArray, b: FloatArray) -> bool:
    return bool((a[0] < b[1]).all() and (b[0] < a[1]).all())


def _crosses(view: FloatArray, polygon: FloatArray) -> bool:
    """Whether the boundary of a convex polygon comes into view."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    along = np.linspace(0.0, 1.0, 65)[:, None, None]
    points = (start + along * (end - start)).reshape(-1, 2)
    return bool(((points > view[0]) & (points < view[1])).all(axis=1).any())
