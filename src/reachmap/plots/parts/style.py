"""How every picture looks: type, colours, ink on colour, and reproducible files.

Figures are :class:`matplotlib.figure.Figure` objects with an Agg canvas, made and
saved under matplotlib's own defaults plus :data:`STYLE`; a user's ``matplotlibrc``
and the display play no part, so the same map gives the same bytes.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Literal, TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap
from matplotlib.figure import Figure
from matplotlib.text import Text

from reachmap._typing import FloatArray

PercentMap: TypeAlias = Literal["RdYlGn", "viridis", "cividis"]
Format: TypeAlias = Literal["png", "svg"]

DIFFERENCE_MAP = "Purples"
CHANGE_MAP = "PRGn"
COST_MAP = "YlGnBu"
NOT_ATTEMPTED = "#d3d3d3"
INK, MUTED, RULE = "#1c1c1c", "#5f5f5f", "#9a9a9a"
# Lines between squares that may be white themselves.
PALE = "#dcdcdc"
BIN_COLOUR = "#10389c"

# Choices: sizes of type [pt], readable on paper and on a screen.
TITLE_SIZE, SUBTITLE_SIZE, LABEL_SIZE, TICK_SIZE = 12.5, 9.5, 9.5, 8.5
SMALLEST_NUMBER, LARGEST_NUMBER = 4.8, 10.0
# A choice: sharp on paper, in files of a moderate size.
DPI = 200

STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": LABEL_SIZE,
    "text.color": INK,
    "axes.edgecolor": RULE,
    "axes.labelcolor": INK,
    "axes.labelsize": LABEL_SIZE,
    "axes.linewidth": 0.7,
    "axes.titlesize": SUBTITLE_SIZE,
    "xtick.color": RULE,
    "ytick.color": RULE,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": TICK_SIZE,
    "ytick.labelsize": TICK_SIZE,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": TICK_SIZE,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.hashsalt": "reachmap",
    "svg.fonttype": "path",
}


@contextmanager
def drawing() -> Iterator[None]:
    """Draw and save under the house style; what the user had set comes back."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def new_figure(width_in: float, height_in: float) -> Figure:
    """Make an empty figure of a size in inches, on an Agg canvas."""
    figure = Figure(figsize=(width_in, height_in), dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


def axes_at(
    figure: Figure, left: float, bottom: float, width: float, height: float
) -> Axes:
    """Add axes to a figure at a place given in inches from its lower left."""
    whole_width, whole_height = figure.get_size_inches()
    return figure.add_axes(
        (
            left / whole_width,
            bottom / whole_height,
            width / whole_width,
            height / whole_height,
        )
    )


def put_text(figure: Figure, left: float, bottom: float, text: str, **how: Any) -> Text:
    """Write text on a figure at a place given in inches from its lower left."""
    width, height = figure.get_size_inches()
    return figure.text(left / width, bottom / height, text, **how)


def subtitle_of(parts: Iterable[str]) -> str:
    """What a subtitle says, part by part; empty parts are left out."""
    return " · ".join(part for part in parts if part)


INTERVAL_LOOK: dict[str, Any] = {
    "color": BIN_COLOUR, "linewidth": 1.6, "markersize": 5, "capsize": 4,
    "elinewidth": 1.2,
}  # fmt: skip
"""Points of a curve with their intervals, for ``errorbar``."""


def grid_lines(axes: Axes, axis: Literal["both", "x", "y"] = "y") -> None:
    """Draw pale lines across a curve's axes."""
    axes.grid(axis=axis, color="#e4e4e4", linewidth=0.7)


def fit_scale(
    low: FloatArray, high: FloatArray, widest: float, tallest: float
) -> float:
    """Greatest scale at which a view from low to high, (2,) each, fits a size [in]."""
    return float(min(widest / (high[0] - low[0]), tallest / (high[1] - low[1])))


def put_title(figure: Figure, left: float, title: str, subtitle: str = "") -> None:
    """Write title and subtitle into the top 0.75 inch of a figure, from ``left`` [in].

    A line that is too long for the figure is set smaller.
    """
    height = float(figure.get_size_inches()[1])
    lines = (
        (height - 0.36, title, {"fontsize": TITLE_SIZE, "fontweight": "bold"}),
        (height - 0.60, subtitle, {"fontsize": SUBTITLE_SIZE, "color": MUTED}),
    )
    for bottom, text, how in lines:
        fit_width(figure, left, put_text(figure, left, bottom, text, **how))


def fit_width(figure: Figure, left: float, text: Text) -> None:
    """Set a text smaller if it runs out of the figure; it starts at ``left`` [in]."""
    room = float(figure.get_size_inches()[0]) - left - 0.15
    # Glyphs are hinted, so the width is not quite proportional to the size.
    while (taken := text.get_window_extent().width / figure.dpi) > room:
        size = float(text.get_fontsize())
        if size < SMALLEST_NUMBER:
            return
        text.set_fontsize(size * min(0.98, room / taken))


def colour_map(name: str) -> Colormap:
    """Named colour map in which a value that was not attempted is grey."""
    return mpl.colormaps[name].with_extremes(bad=NOT_ATTEMPTED)


def relative_luminance(rgb: FloatArray) -> FloatArray:
    """Relative luminance of sRGB colours as WCAG 2 defines it, (..., 3) to (...)."""
    rgb = np.asarray(rgb, float)[..., :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return np.asarray(linear @ np.array([0.2126, 0.7152, 0.0722]))


def contrast_ratio(a: FloatArray, b: FloatArray) -> FloatArray:
    """Contrast of two sRGB colours as WCAG 2 defines it, from 1 to 21."""
    luminance = np.stack([relative_luminance(a), relative_luminance(b)])
    return np.asarray((luminance.max(axis=0) + 0.05) / (luminance.min(axis=0) + 0.05))


def ink_on(rgb: FloatArray) -> str:
    """Black or white, whichever stands out more on a colour.

    The better of the two never has a contrast below √21 = 4.58.
    """
    white = contrast_ratio(np.ones(3), rgb)
    return "white" if white > contrast_ratio(np.zeros(3), rgb) else "black"


def figure_bytes(
    figure: Figure, kind: Format, *, title: str, config_sha256: str
) -> bytes:
    """Render a figure as PNG or SVG, the same bytes for the same figure.

    Parameters
    ----------
    figure : Figure
    kind : {"png", "svg"}
    title, config_sha256 : str
        Kept in the file: text chunks of a PNG, the metadata of an SVG.
    """
    metadata: dict[str, Any]
    if kind == "svg":
        metadata = {
            "Creator": "reachmap",
            "Date": None,
            "Title": title,
            "Identifier": f"config_sha256:{config_sha256}",
        }
    else:
        # matplotlib would write its version, which makes equal pictures differ.
        metadata = {
            "Software": None,
            "Title": title,
            "config_sha256": config_sha256,
        }
    stream = io.BytesIO()
    with drawing():
        figure.savefig(stream, format=kind, dpi=DPI, metadata=metadata)
    return stream.getvalue()
