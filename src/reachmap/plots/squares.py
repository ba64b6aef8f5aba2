"""Coloured squares with a number in each: the body of every map."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import QuadMesh
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator

from reachmap._typing import FloatArray
from reachmap.plots.style import (
    LARGEST_NUMBER,
    RULE,
    SMALLEST_NUMBER,
    axes_at,
    ink_on,
)

MINUS = "\N{MINUS SIGN}"
MISSING = "\N{EN DASH}"
PERCENT_SCALE = Normalize(0.0, 100.0)
# Width of a digit and height of a line, in units of the font size (DejaVu Sans).
DIGIT_WIDTH, LINE_HEIGHT = 0.64, 1.2
POINTS_PER_INCH = 72.0


def percent_text(value: float) -> str:
    """Whole percent; 0 and 100 are kept for exactly none and exactly all.

    Examples
    --------
    >>> [percent_text(v) for v in (0.0, 0.2, 53.53, 99.7, 100.0)]
    ['0', '1', '54', '99', '100']
    """
    if np.isnan(value):
        return MISSING
    if 0.0 < value < 100.0:
        return str(min(99, max(1, round(value))))
    return str(round(value)).replace("-", MINUS)


def signed_text(value: float) -> str:
    """Whole number with its sign; 0 has none."""
    if np.isnan(value):
        return MISSING
    whole = round(value)
    return f"{whole:+d}".replace("-", MINUS) if whole else "0"


def cell_edges(centres: FloatArray) -> FloatArray:
    """Edges of the squares around rising centres, (n,) to (n + 1,) [m].

    Edges lie midway between neighbours; a single centre gets a square of 0.1 m.
    """
    centres = np.asarray(centres, float)
    if centres.size == 1:
        return np.array([centres[0] - 0.05, centres[0] + 0.05])
    middle = (centres[1:] + centres[:-1]) / 2.0
    first, last = 2 * centres[0] - middle[0], 2 * centres[-1] - middle[-1]
    return np.concatenate([[first], middle, [last]])


def number_size(
    x: FloatArray, y: FloatArray, scale_in: float, characters: int = 3
) -> float:
    """Font size at which ``characters`` digits fit the smallest square [pt].

    ``scale_in`` is inches per metre; 0 says that numbers would be too small to read.
    """
    width, height = (
        float(np.diff(cell_edges(c)).min()) * scale_in * POINTS_PER_INCH for c in (x, y)
    )
    size = min(
        0.86 * width / (DIGIT_WIDTH * characters),
        0.80 * height / LINE_HEIGHT,
        LARGEST_NUMBER,
    )
    return size if size >= SMALLEST_NUMBER else 0.0


def draw_squares(
    axes: Axes,
    x: FloatArray,
    y: FloatArray,
    values: FloatArray,
    *,
    colours: Colormap,
    scale: Normalize,
    text: Callable[[float], str] = percent_text,
    font_size: float = 8.0,
    halo: bool = True,
) -> QuadMesh:
    """Draw values as coloured squares, seen from above, y upwards.

    Parameters
    ----------
    axes : Axes
    x, y : array, shape (nx,), (ny,)
        Centres of the squares [m].
    values : array, shape (ny, nx)
        NaN is drawn grey with a dash.
    colours, scale : Colormap, Normalize
        Values beyond the scale take its end colours; the number tells them.
    text : callable
        Number to what is written in the square.
    font_size : float
        Of the numbers [pt]; 0 leaves them out.
    halo : bool
        Whether outlines that cross a number are interrupted round it.
    """
    x_edges, y_edges = cell_edges(x), cell_edges(y)
    mesh = axes.pcolormesh(
        x_edges,
        y_edges,
        np.ma.masked_invalid(values),
        cmap=colours,
        norm=scale,
        edgecolors="white",
        linewidth=0.5,
        zorder=1,
    )
    axes.set_xlim(x_edges[0], x_edges[-1])
    axes.set_ylim(y_edges[0], y_edges[-1])
    axes.set_aspect("equal")
    axes.tick_params(length=2.5)
    if font_size:
        for (row, column), value in np.ndenumerate(values):
            centre = (float(x[column]), float(y[row]))
            rgb = np.asarray(colours(np.ma.masked_invalid(scale([value])))[0])
            axes.text(
                *centre,
                text(float(value)),
                ha="center",
                va="center_baseline",
                fontsize=font_size,
                color=ink_on(rgb),
                zorder=6,
                path_effects=[withStroke(linewidth=2.0, foreground=rgb)]
                if halo
                else [],
            )
    return mesh


def axis_titles(axes: Axes, frame: str = "robot_base") -> None:
    """Name both axes, with unit and frame."""
    axes.set_xlabel(f"x in {frame} [m]")
    axes.set_ylabel(f"y in {frame} [m]")


def colour_bar(
    figure: Figure,
    mesh: ScalarMappable,
    box_in: tuple[float, float, float, float],
    label: str,
    *,
    step: float | None = 20.0,
) -> Colorbar:
    """Draw a vertical colour bar in a box (left, bottom, width, height) [in]."""
    bar = figure.colorbar(mesh, cax=axes_at(figure, *box_in))
    bar.set_label(label)
    bar.outline.set_edgecolor(RULE)
    bar.outline.set_linewidth(0.5)
    bar.ax.tick_params(length=2.5)
    if step:
        bar.ax.yaxis.set_major_locator(MultipleLocator(step))
    return bar
