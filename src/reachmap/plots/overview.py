"""All levels of a workspace map on one sheet, with their means over the height."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reachmap._typing import FloatArray
from reachmap.maps.summary.statistics import best_level, level_means
from reachmap.plots.heatmap import draw_level_on, is_marked
from reachmap.plots.parts.levels import QUANTITY_NAMES
from reachmap.plots.parts.outlines import legend_lines
from reachmap.plots.parts.squares import colour_bar
from reachmap.plots.parts.stack import LevelStack, best_text, height_text, mean_text
from reachmap.plots.parts.style import (
    INK,
    MUTED,
    RULE,
    PercentMap,
    axes_at,
    drawing,
    fit_scale,
    new_figure,
    put_title,
    subtitle_of,
)

# Lengths on paper [in]: choices of layout.
LEFT, RIGHT, TOP, BOTTOM = 0.75, 0.75, 0.48, 0.85
GAP_X, GAP_Y = 0.25, 0.44
WIDEST, TALLEST = 3.2, 3.6


@drawing()
def draw_overview(stack: LevelStack, *, percent_map: PercentMap = "RdYlGn") -> Figure:
    """Draw all levels small; the best one is framed, the last panel shows the means."""
    low, high = stack.view()
    scale_in = fit_scale(low, high, WIDEST, TALLEST)
    width, height = (high - low) * scale_in
    panels = stack.z.size + 1
    columns = sheet_columns(panels, width / height)
    rows = -(-panels // columns)
    across, down = width + GAP_X, height + GAP_Y
    figure = new_figure(
        max(LEFT + columns * across + RIGHT, 5.6), BOTTOM + rows * down + TOP
    )

    def panel(index: int) -> tuple[float, float]:
        row, column = divmod(index, columns)
        return LEFT + column * across, BOTTOM + (rows - 1 - row) * down

    mesh = None
    for level in range(stack.z.size):
        axes = axes_at(figure, *panel(level), width, height)
        mesh = draw_level_on(axes, stack, level, scale_in, percent_map, small=True)
        _label_panel(axes, stack, level)
        below_is_free = level + columns >= stack.z.size
        axes.tick_params(
            labelbottom=below_is_free, labelleft=level % columns == 0, labelsize=7
        )
    assert mesh is not None
    bar = (
        LEFT + columns * across,
        BOTTOM + rows * down - GAP_Y - height,
        0.14,
        height,
    )
    unit = "points" if stack.quantity == "difference" else "%"
    colour_bar(figure, mesh, bar, "").ax.set_title(unit, fontsize=8.5, pad=5)
    left, bottom = panel(panels - 1)
    _draw_means(axes_at(figure, left + 0.55, bottom, width - 0.55, height), stack)
    name = QUANTITY_NAMES[stack.quantity]
    said = subtitle_of((best_text(stack), stack.cell_name))
    put_title(figure, LEFT, f"{name[0].upper()}{name[1:]} on all levels", said)
    _draw_legend(figure, stack, columns * across)
    return figure


def sheet_columns(panels: int, aspect: float) -> int:
    """Columns that bring the sheet close to 5:4 and leave few empty places."""

    def cost(columns: int) -> float:
        rows = -(-panels // columns)
        empty = columns * rows - panels
        return float(abs(np.log(columns * aspect / rows / 1.25)) + 0.12 * empty)

    return min(range(1, min(panels, 6) + 1), key=cost)


def _label_panel(axes: Axes, stack: LevelStack, level: int) -> None:
    best = is_marked(stack, level)
    axes.set_title(
        f"{height_text(stack, level)} · {mean_text(stack, level)}"
        + (" · best" if best else ""),
        fontsize=8.5,
        fontweight="bold" if best else "normal",
        loc="left",
        pad=4,
    )
    for spine in axes.spines.values():
        spine.set_linewidth(2.2 if best else 0.7)
        spine.set_edgecolor("black" if best else RULE)


def _draw_means(axes: Axes, stack: LevelStack) -> None:
    """Mean of each level over its height, drawn upright as the levels lie."""
    means: FloatArray = level_means(stack.values)
    axes.plot(means, stack.z, "-o", color=INK, linewidth=1.2, markersize=3.5)
    best = best_level(stack.values)
    if best is not None and stack.quantity != "difference":
        axes.plot(
            means[best], stack.z[best], "o", color=INK, markersize=8, fillstyle="none"
        )
    axes.set_xlim(0.0, 100.0)
    axes.set_xticks([0, 50, 100])
    axes.set_title("mean over z", fontsize=8.5, loc="left", pad=4)
    axes.set_ylabel("z [m]", fontsize=8, labelpad=2)
    axes.tick_params(labelsize=7, length=2.5)
    axes.grid(color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)


def _draw_legend(figure: Figure, stack: LevelStack, width_in: float) -> None:
    shown = {
        outline.name: outline
        for level in range(stack.z.size)
        for outline in stack.shown(level)
    }
    figure.legend(
        handles=legend_lines(shown.values()),
        loc="lower left",
        bbox_to_anchor=(LEFT / figure.get_figwidth() - 0.005, 0.004),
        ncols=max(1, int(width_in / 1.5)),
        columnspacing=1.6,
        title=f"x and y in {stack.frame} [m]; outlines to scale:",
        title_fontproperties={"size": 8},
        alignment="left",
        labelcolor=MUTED,
    )
