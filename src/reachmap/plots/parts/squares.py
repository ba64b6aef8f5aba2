"""Coloured squares with a number in each: the body of every map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import QuadMesh
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator
from matplotlib.transforms import Bbox

from reachmap._typing import FloatArray
from reachmap.plots.parts.style import (
    LARGEST_NUMBER,
    RULE,
    SMALLEST_NUMBER,
    axes_at,
    ink_on,
)

POINTS_PER_INCH = 72.0
# Size of a digit in units of the font size (DejaVu Sans), without room around it.
DIGIT_WIDTH, DIGIT_HEIGHT = 0.64, 0.76
# Room between a number and a line, and on both axes to the edge of its square [pt].
LINE_ROOM, EDGE_ROOM = 2.2, np.array([1.0, 3.2])


def _effort(step: tuple[float, ...]) -> tuple[float, int]:
    """How far a step goes, and the number of axes it goes along."""
    return max(abs(part) for part in step), sum(part != 0.0 for part in step)


# Places to try, in parts of the room on either side of the middle.
STEPS = sorted(product((0.0, 0.4, -0.4, 0.7, -0.7, 1.0, -1.0), repeat=2), key=_effort)


def closed_path(polygon: FloatArray) -> Path:
    """Path of a polygon, shape (n, 2), not closed."""
    corners = np.vstack([polygon, polygon[:1]])
    return Path(corners)


def number_place(
    square: FloatArray,
    characters: int,
    *,
    font_size: float,
    scale_in: float,
    lines: Sequence[Path],
) -> tuple[float, float]:
    """Middle of a number in its square: clear of the lines, where that is possible.

    Parameters
    ----------
    square : array, shape (2, 2)
        Lower and upper corner [m].
    characters : int
    font_size : float
        [pt].
    scale_in : float
        Inches per metre of the picture.
    lines : sequence of Path
        Lines to keep clear of [m].

    Returns
    -------
    (float, float)
        The square's own middle if no line crosses the number there, or if every
        other place is crossed, too.
    """
    middle = square.mean(axis=0)
    metre = scale_in * POINTS_PER_INCH
    half = np.array([DIGIT_WIDTH * characters, DIGIT_HEIGHT]) * font_size / 2.0
    reach = (square[1] - square[0]) / 2.0 - (half + EDGE_ROOM) / metre
    room, half = np.maximum(reach, 0.0), (half + LINE_ROOM) / metre
    for step in STEPS:
        place = middle + room * step
        box = Bbox([place - half, place + half])
        if not any(line.intersects_bbox(box, filled=False) for line in lines):
            return float(place[0]), float(place[1])
    return float(middle[0]), float(middle[1])


MINUS = "\N{MINUS SIGN}"
MISSING = "\N{EN DASH}"
PERCENT_SCALE = Normalize(0.0, 100.0)
# Height of a line of text in units of the font size.
LINE_HEIGHT = 1.2


def whole_percent(value: float) -> str:
    """Whole percent; 0 and 100 are kept for exactly none and exactly all.

    Examples
    --------
    >>> [whole_percent(v) for v in (0.0, 0.2, 53.53, 99.7, 100.0)]
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
        0.82 * width / (DIGIT_WIDTH * characters),
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
    text: Callable[[float], str] = whole_percent,
    font_size: float = 8.0,
    separator: str = "white",
    halo: bool = True,
    scale_in: float = 0.0,
    lines: Sequence[Path] = (),
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
    separator : str
        Colour of the lines between the squares.
    halo : bool
        Whether lines that cross a number are interrupted round it.
    scale_in : float
        Inches per metre of the picture; needed with ``lines``.
    lines : sequence of Path
        Outlines that will be drawn over the squares; the numbers keep clear of them.
    """
    x_edges, y_edges = cell_edges(x), cell_edges(y)
    mesh = axes.pcolormesh(
        x_edges,
        y_edges,
        np.ma.masked_invalid(values),
        cmap=colours,
        norm=scale,
        edgecolors=separator,
        linewidth=0.5,
        zorder=1,
    )
    axes.set_xlim(x_edges[0], x_edges[-1])
    axes.set_ylim(y_edges[0], y_edges[-1])
    axes.set_aspect("equal")
    axes.tick_params(length=2.5)
    if font_size:
        rgbs = np.asarray(colours(np.ma.masked_invalid(scale(values))))
        for (row, column), value in np.ndenumerate(values):
            rgb = rgbs[row, column]
            words = text(float(value))
            place = (float(x[column]), float(y[row]))
            if lines:
                place = number_place(
                    np.array([x_edges[column : column + 2], y_edges[row : row + 2]]).T,
                    len(words),
                    font_size=font_size,
                    scale_in=scale_in,
                    lines=lines,
                )
            axes.text(
                *place,
                words,
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


def axis_titles(axes: Axes, frame: str) -> None:
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
