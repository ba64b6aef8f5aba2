"""Two maps of one kind: before, after, and the change with its significance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from reachmap._typing import BoolArray, FloatArray
from reachmap.maps.summary.statistics import level_means
from reachmap.plots.overview import sheet_columns
from reachmap.plots.parts.levels import level_names
from reachmap.plots.parts.outlines import Outline, draw_outline, legend_lines
from reachmap.plots.parts.squares import (
    MINUS,
    PERCENT_SCALE,
    axis_titles,
    cell_edges,
    closed_path,
    colour_bar,
    draw_squares,
    number_size,
    signed_text,
    whole_percent,
)
from reachmap.plots.parts.style import (
    CHANGE_MAP,
    INK,
    MUTED,
    PALE,
    RULE,
    PercentMap,
    axes_at,
    colour_map,
    drawing,
    new_figure,
    put_title,
)

# Lengths on paper [in]: choices of layout.
LEFT, RIGHT, TOP, BOTTOM = 0.80, 0.95, 1.05, 0.98
WIDEST, TALLEST = 4.4, 5.6
# A choice: few scales, so that several comparisons can be laid side by side.
CHANGE_LIMITS = (10.0, 25.0, 50.0, 100.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class MapChange:
    """Two maps on one lattice, level by level.

    Attributes
    ----------
    x, y, z : array, shape (nx,), (ny,), (nz,)
        Points that both maps have [m]; for a bin map, ``z`` is the layer.
    before, after : array, shape (nz, ny, nx)
        Percent, NaN where a map has no attempt.
    significant : bool array, same shape
        Squares whose change is significant.
    names : (str, str)
        What the two maps are called.
    headline : str
        The result in a sentence; the title.
    details : str
        The line under it.
    frame : str
        Frame that ``x`` and ``y`` are in.
    outlines : tuple of Outline
        Things of the cell to draw over the squares.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    before: FloatArray
    after: FloatArray
    significant: BoolArray
    names: tuple[str, str]
    headline: str
    details: str = ""
    frame: str = "robot_base"
    outlines: tuple[Outline, ...] = ()

    @property
    def change(self) -> FloatArray:
        """After minus before [percentage points], shape (nz, ny, nx)."""
        return np.asarray(self.after - self.before)

    def scale(self) -> Normalize:
        """Symmetric scale that holds every change: ±10, 25, 50 or 100 points."""
        largest = float(np.nanmax(np.abs(self.change), initial=0.0))
        limit = next((v for v in CHANGE_LIMITS if largest <= v), CHANGE_LIMITS[-1])
        return Normalize(-limit, limit)

    def shown(self, level: int) -> tuple[Outline, ...]:
        """Outlines to draw on a level: the robot base and what crosses or is near.

        What lies beside the squares altogether is left out.
        """
        z = float(self.z[level])
        near = (o for o in self.outlines if o.kind == "base" or o.near(z, 0.05))
        x, y = cell_edges(self.x), cell_edges(self.y)
        low, high = np.array([x[0], y[0]]), np.array([x[-1], y[-1]])
        return tuple(
            o
            for o in near
            if (o.polygon.max(axis=0) > low).all()
            and (o.polygon.min(axis=0) < high).all()
        )

    def most_changed(self) -> int:
        """Level with the largest mean change, either way."""
        means = np.abs(level_means(self.change))
        return 0 if np.isnan(means).all() else int(np.nanargmax(means))


@drawing()
def draw_comparison(
    maps: MapChange, level: int | None = None, *, percent_map: PercentMap = "RdYlGn"
) -> Figure:
    """Draw one level before, after, and the change; significant squares are framed.

    Parameters
    ----------
    maps : MapChange
    level : int, optional
        Index of the level; by default the one that changed most.
    percent_map : str
    """
    level = maps.most_changed() if level is None else level
    low_x, high_x = cell_edges(maps.x)[[0, -1]]
    low_y, high_y = cell_edges(maps.y)[[0, -1]]
    scale_in = min(WIDEST / (high_x - low_x), TALLEST / (high_y - low_y))
    width, height = (high_x - low_x) * scale_in, (high_y - low_y) * scale_in
    # Panels before and after share a bar; the change has its own.
    lefts = [LEFT, LEFT + width + 0.30, LEFT + 2 * width + 0.30 + 1.15]
    figure = new_figure(lefts[2] + width + RIGHT, BOTTOM + height + TOP)
    panels = [axes_at(figure, left, BOTTOM, width, height) for left in lefts]
    values = (maps.before[level], maps.after[level])
    for axes, name, value in zip(panels, maps.names, values, strict=False):
        percent = draw_squares(
            axes,
            maps.x,
            maps.y,
            value,
            colours=colour_map(percent_map),
            scale=PERCENT_SCALE,
            text=whole_percent,
            font_size=number_size(maps.x, maps.y, scale_in),
            scale_in=scale_in,
            lines=[closed_path(outline.polygon) for outline in maps.shown(level)],
        )
        axes.set_title(f"{name} · {_mean_text(value)}", loc="left", pad=6)
    changed = _draw_change(panels[2], maps, level, scale_in)
    change = _mean_text(maps.change[level], signed=True)
    panels[2].set_title(f"change · {change}", loc="left", pad=6)
    for index, axes in enumerate(panels):
        axis_titles(axes, maps.frame)
        for outline in maps.shown(level):
            draw_outline(axes, outline)
        if index:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)
    bars = ((lefts[1] + width + 0.12, percent, "%", 20.0),
            (lefts[2] + width + 0.12, changed, "points", None))  # fmt: skip
    for left, mesh, unit, step in bars:
        bar = colour_bar(figure, mesh, (left, BOTTOM, 0.14, height), "", step=step)
        bar.ax.set_title(unit, fontsize=8.5, pad=6)
    _put_legend(figure, maps, level)
    where = f"z = {level_names(maps.z)[level].replace('-', MINUS)} m"
    put_title(figure, LEFT, maps.headline, f"{where} · {maps.details}".rstrip(" ·"))
    return figure


def _draw_change(
    axes: Axes, maps: MapChange, level: int, scale_in: float, *, line: float = 1.6
) -> QuadMesh:
    """Draw the signed change; frame the significant squares."""
    mesh = draw_squares(
        axes,
        maps.x,
        maps.y,
        maps.change[level],
        colours=colour_map(CHANGE_MAP),
        scale=maps.scale(),
        text=signed_text,
        font_size=number_size(maps.x, maps.y, scale_in, 4),
        separator=PALE,
        halo=False,
        scale_in=scale_in,
        lines=[closed_path(outline.polygon) for outline in maps.shown(level)],
    )
    x, y = cell_edges(maps.x), cell_edges(maps.y)
    inset = 0.04 * min(float(np.diff(x).min()), float(np.diff(y).min()))
    for row, column in np.argwhere(maps.significant[level]):
        left, low = float(x[column]) + inset, float(y[row]) + inset
        axes.add_patch(
            Rectangle(
                (left, low),
                float(x[column + 1]) - inset - left,
                float(y[row + 1]) - inset - low,
                fill=False,
                edgecolor=INK,
                linewidth=line,
                zorder=3,
            )
        )
    return mesh


def _mean_text(values: FloatArray, *, signed: bool = False) -> str:
    mean = float(level_means(values[None])[0])
    if np.isnan(mean):
        return "not attempted"
    if signed:
        return f"{mean:+.1f} points".replace("-", MINUS)
    return f"mean {mean:.1f} %"


def _put_legend(figure: Figure, maps: MapChange, level: int | None) -> None:
    handles = []
    if maps.significant.any():
        mark = Line2D(
            [],
            [],
            color=INK,
            marker="s",
            fillstyle="none",
            markersize=9,
            markeredgewidth=1.6,
            linestyle="none",
            label="significant",
        )
        handles.append(mark)
    if level is not None:
        handles += legend_lines(maps.shown(level))
    figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=((LEFT - 0.08) / figure.get_figwidth(), 0.01),
        ncols=6,
        columnspacing=1.6,
    )


@drawing()
def draw_change_sheet(maps: MapChange) -> Figure:
    """Draw the change on all levels, and the mean of both maps over the height."""
    low_x, high_x = cell_edges(maps.x)[[0, -1]]
    low_y, high_y = cell_edges(maps.y)[[0, -1]]
    scale_in = min(3.2 / (high_x - low_x), 3.6 / (high_y - low_y))
    width, height = (high_x - low_x) * scale_in, (high_y - low_y) * scale_in
    count = maps.z.size + 1
    columns = sheet_columns(count, width / height)
    rows = -(-count // columns)
    across, down = width + 0.25, height + 0.44
    left, bottom = 0.75, 0.85
    figure = new_figure(left + columns * across + 0.85, bottom + rows * down + 0.48)
    places = [
        (left + column * across, bottom + (rows - 1 - row) * down)
        for row, column in (divmod(index, columns) for index in range(count))
    ]
    mesh = None
    for level, place in enumerate(places[:-1]):
        axes = axes_at(figure, *place, width, height)
        mesh = _draw_change(axes, maps, level, scale_in, line=1.0)
        name = level_names(maps.z)[level].replace("-", MINUS)
        change = _mean_text(maps.change[level], signed=True)
        axes.set_title(f"z = {name} m · {change}", fontsize=8.5, loc="left", pad=4)
        below_is_free = level + columns >= maps.z.size
        first = level % columns == 0
        axes.tick_params(labelbottom=below_is_free, labelleft=first, labelsize=7)
    assert mesh is not None
    top = bottom + rows * down - 0.44 - height
    bar = colour_bar(
        figure, mesh, (left + columns * across, top, 0.14, height), "", step=None
    )
    bar.ax.set_title("points", fontsize=8.5, pad=5)
    place = places[-1]
    means = axes_at(figure, place[0] + 0.55, place[1], width - 0.55, height)
    _draw_means(means, maps)
    _put_legend(figure, maps, None)
    put_title(figure, left, maps.headline, maps.details)
    return figure


def _draw_means(axes: Axes, maps: MapChange) -> None:
    looks = (("--", MUTED, maps.before), ("-", INK, maps.after))
    for (line, colour, values), name in zip(looks, maps.names, strict=True):
        axes.plot(
            level_means(values),
            maps.z,
            line,
            marker="o",
            color=colour,
            linewidth=1.2,
            markersize=3.5,
            label=name,
        )
    axes.set_xlim(0.0, 100.0)
    axes.set_xticks([0, 50, 100])
    axes.set_title("means [%]", fontsize=8.5, loc="left", pad=4)
    axes.set_ylabel("z [m]", fontsize=8, labelpad=2)
    axes.tick_params(labelsize=7, length=2.5)
    axes.grid(color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.legend(fontsize=7, loc="best", handlelength=1.8)
    for spine in axes.spines.values():
        spine.set_edgecolor(RULE)


# Choices of layout: lengths on paper [in].
MULTIPLES_PER_ROW, MULTIPLE_IN, MULTIPLE_GAP = 4, 2.4, 0.55


@drawing()
def draw_small_multiples(
    changes: Sequence[MapChange],
    significant: Sequence[bool],
    percent_map: PercentMap = "RdYlGn",
) -> Figure:
    """Draw one map and several others at one level, in one scale of colours.

    Parameters
    ----------
    changes : sequence of MapChange
        Of the first map to each of the others.
    significant : sequence of bool
        Which changes are significant.
    percent_map : str
    """
    most = max(changes, key=lambda c: float(np.nanmax(np.abs(c.change), initial=0.0)))
    z = float(most.z[most.most_changed()])
    first = changes[0]
    panels = [(first, first.before, first.names[0], "")]
    for change, named in zip(changes, significant, strict=True):
        said = _mean_text(change.change[_level_at(change, z)], signed=True)
        said += "" if named else ", chance"
        panels.append((change, change.after, change.names[1], said))
    columns = min(len(panels), MULTIPLES_PER_ROW)
    rows = -(-len(panels) // columns)
    heights = [_height_in(change) for change, *_ in panels]
    height = max(heights) + 0.75
    width = LEFT + columns * (MULTIPLE_IN + MULTIPLE_GAP) + RIGHT
    figure = new_figure(width, BOTTOM + rows * height + TOP - 0.3)
    for k, (change, values, name, said) in enumerate(panels):
        row, column = divmod(k, columns)
        left = LEFT + column * (MULTIPLE_IN + MULTIPLE_GAP)
        bottom = BOTTOM + (rows - 1 - row) * height
        axes = axes_at(figure, left, bottom, MULTIPLE_IN, heights[k])
        level = _level_at(change, z)
        span = float(np.ptp(cell_edges(change.x)))
        mesh = draw_squares(
            axes,
            change.x,
            change.y,
            values[level],
            colours=colour_map(percent_map),
            scale=PERCENT_SCALE,
            font_size=number_size(change.x, change.y, MULTIPLE_IN / span),
            scale_in=MULTIPLE_IN / span,
        )
        mean = _mean_text(values[level])
        axes.set_title(f"{name}\n{mean}{said and ' · ' + said}", loc="left", fontsize=8)
        if row == rows - 1:
            axes.set_xlabel(f"x in {change.frame} [m]")
    left = LEFT + columns * (MULTIPLE_IN + MULTIPLE_GAP) - 0.3
    box = (left, BOTTOM, 0.14, heights[0])
    colour_bar(figure, mesh, box, "path reachability [%]")
    where = f"z = {level_names(np.array([z]))[0].replace('-', MINUS)} m"
    said = f"{where} · over the test frames shared with {first.names[0]}"
    put_title(figure, LEFT, f"{len(panels)} maps compared", said)
    return figure


def _level_at(change: MapChange, z: float) -> int:
    return int(np.abs(change.z - z).argmin())


def _height_in(change: MapChange) -> float:
    x, y = (float(np.ptp(cell_edges(axis))) for axis in (change.x, change.y))
    return float(np.clip(MULTIPLE_IN * y / x, 0.6, 2.0 * MULTIPLE_IN))
