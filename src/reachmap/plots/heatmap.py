"""Heat map of one level of a workspace map, to scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke

from reachmap.maps.summary.statistics import best_level
from reachmap.plots.parts.levels import QUANTITY_NAMES, best_patch, best_square
from reachmap.plots.parts.outlines import draw_outline, legend_lines
from reachmap.plots.parts.squares import (
    PERCENT_SCALE,
    axis_titles,
    cell_edges,
    closed_path,
    colour_bar,
    draw_squares,
    number_size,
)
from reachmap.plots.parts.stack import LevelStack, level_subtitle, level_title
from reachmap.plots.parts.style import (
    NOT_ATTEMPTED,
    PALE,
    PercentMap,
    axes_at,
    drawing,
    fit_scale,
    new_figure,
    put_title,
)

# Room around the axes and their largest size [in].
LEFT, RIGHT, TOP, BOTTOM = 0.80, 1.05, 0.85, 0.62
WIDEST, TALLEST = 7.6, 7.0
LEGEND_ROW = 0.22


@drawing()
def draw_level(
    stack: LevelStack, level: int, *, percent_map: PercentMap = "RdYlGn"
) -> Figure:
    """Draw one level with its numbers, the cell's outlines, legend and colour bar."""
    low, high = stack.view()
    scale_in = fit_scale(low, high, WIDEST, TALLEST)
    width, height = (high - low) * scale_in
    handles = _legend_handles(stack, level)
    columns = max(2, int((width + RIGHT) / 1.75))
    bottom = BOTTOM + LEGEND_ROW * -(-len(handles) // columns)
    figure = new_figure(max(LEFT + width + RIGHT, 5.6), bottom + height + TOP)
    figure_width = figure.get_figwidth()
    left = LEFT + (figure_width - LEFT - width - RIGHT) / 2.0
    axes = axes_at(figure, left, bottom, width, height)
    mesh = draw_level_on(axes, stack, level, scale_in, percent_map)
    if is_marked(stack, level):
        mark_best(axes, stack, level)
    axis_titles(axes, stack.frame)
    name = QUANTITY_NAMES[stack.quantity]
    unit = "percentage points" if stack.quantity == "difference" else "%"
    label = f"{name[0].upper()}{name[1:]} [{unit}]"
    colour_bar(figure, mesh, (left + width + 0.15, bottom, 0.16, height), label)
    put_title(figure, left, level_title(stack, level), level_subtitle(stack, level))
    figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(left / figure_width - 0.01, 0.005),
        ncols=columns,
        columnspacing=1.6,
        handlelength=2.2,
    )
    return figure


def draw_level_on(
    axes: Axes,
    stack: LevelStack,
    level: int,
    scale_in: float,
    percent_map: PercentMap,
    *,
    small: bool = False,
) -> QuadMesh:
    """Draw squares and outlines of a level on axes of ``scale_in`` inches per metre.

    ``small`` is for one of many panels: thinner outlines, plain numbers.
    """
    mesh = draw_squares(
        axes,
        stack.x,
        stack.y,
        stack.values[level],
        colours=stack.colours(percent_map),
        scale=PERCENT_SCALE,
        font_size=number_size(stack.x, stack.y, scale_in),
        halo=not small,
        scale_in=scale_in,
        lines=[closed_path(outline.polygon) for outline in stack.shown(level)],
        separator=PALE if stack.quantity == "difference" else "white",
    )
    low, high = stack.view()
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    for outline in stack.shown(level):
        draw_outline(axes, outline, weight=0.7 if small else 1.0)
    return mesh


def is_marked(stack: LevelStack, level: int) -> bool:
    """Whether the best square and patch are marked: on the best level only."""
    return stack.quantity != "difference" and level == best_level(stack.values)


def _legend_handles(stack: LevelStack, level: int) -> list[Artist]:
    handles: list[Artist] = [*legend_lines(stack.shown(level))]
    if is_marked(stack, level):
        handles += [frame.handle() for frame in best_frames(stack, level)]
    if np.isnan(stack.values[level]).any():
        handles.append(Patch(color=NOT_ATTEMPTED, label="– not attempted"))
    return handles


@dataclass(frozen=True, slots=True, kw_only=True)
class BestFrame:
    """A frame round squares, with its label.

    ``row`` and ``column`` are those of the lower left square.
    """

    row: int
    column: int
    rows: int
    columns: int
    label: str
    width: float
    dashes: tuple[float, tuple[float, ...]]

    def handle(self) -> Line2D:
        """Line in the style of the frame, for a legend."""
        return Line2D(
            [],
            [],
            color="black",
            linewidth=self.width,
            linestyle=self.dashes if self.dashes[1] else "-",
            label=self.label,
        )


def best_frames(stack: LevelStack, level: int) -> tuple[BestFrame, BestFrame]:
    """Frames of the best square and of the best patch of a level."""
    values = stack.values[level]
    rows, columns = (
        min(n, size) for n, size in zip(stack.patch, values.shape, strict=True)
    )
    square_row, square_column = best_square(values)
    row, column = best_patch(values, (rows, columns))
    mean = values[row : row + rows, column : column + columns].mean()
    square = BestFrame(
        row=square_row,
        column=square_column,
        rows=1,
        columns=1,
        label=f"best square, {values[square_row, square_column]:.0f} %",
        width=2.4,
        dashes=(0.0, ()),
    )
    patch = BestFrame(
        row=row,
        column=column,
        rows=rows,
        columns=columns,
        label=f"best {columns}×{rows} patch, {mean:.1f} %",
        width=2.0,
        dashes=(0.0, (3.0, 1.2)),
    )
    return square, patch


def mark_best(axes: Axes, stack: LevelStack, level: int) -> None:
    """Frame the best square and the best patch of a level."""
    x, y = cell_edges(stack.x), cell_edges(stack.y)
    for frame in best_frames(stack, level):
        left, right = x[[frame.column, frame.column + frame.columns]]
        low, high = y[[frame.row, frame.row + frame.rows]]
        axes.add_patch(
            Rectangle(
                (float(left), float(low)),
                float(right - left),
                float(high - low),
                fill=False,
                edgecolor="black",
                linewidth=frame.width,
                linestyle=frame.dashes if frame.dashes[1] else "-",
                zorder=5,
                path_effects=[
                    withStroke(linewidth=frame.width + 1.6, foreground="white")
                ],
            )
        )
