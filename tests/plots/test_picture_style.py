"""Ink, colours, reproducible bytes, and no display."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from typing import Literal, get_args

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngImageFile

from reachmap.plots.parts.style import (
    CHANGE_MAP,
    COST_MAP,
    DIFFERENCE_MAP,
    PercentMap,
    axes_at,
    colour_map,
    contrast_ratio,
    drawing,
    figure_bytes,
    ink_on,
    new_figure,
    put_title,
)

PERCENT_MAPS = get_args(PercentMap)

HASH = "5" * 64


@drawing()
def small_figure() -> Figure:
    """A figure with everything that tends to differ: text, lines, a clip path."""
    figure = new_figure(2.0, 1.8)
    axes = axes_at(figure, 0.5, 0.4, 1.2, 0.6)
    axes.plot([0, 1], [0, 1])
    axes.set_xlabel("x [m]")
    put_title(figure, 0.2, "a title", "a subtitle")
    return figure


@pytest.mark.parametrize("name", [*PERCENT_MAPS, DIFFERENCE_MAP, COST_MAP, CHANGE_MAP])
def test_numbers_stand_out_on_every_colour(name: str) -> None:
    """WCAG AA asks for 4.5; the formula here is the standard's, written again."""
    rgb = colour_map(name)(np.linspace(0.0, 1.0, 1001))[:, :3]
    for colour in [*rgb, colour_map(name)(np.ma.masked)[:3]]:
        linear = [
            c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour
        ]
        luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
        bright, dark = (
            (1.05, luminance + 0.05)
            if ink_on(np.asarray(colour)) == "white"
            else (luminance + 0.05, 0.05)
        )
        assert bright / dark >= 4.5


def test_contrast_of_black_and_white_is_21() -> None:
    """The two ends of the scale."""
    assert contrast_ratio(np.zeros(3), np.ones(3)) == pytest.approx(21.0)
    assert contrast_ratio(np.ones(3), np.ones(3)) == pytest.approx(1.0)


def test_not_attempted_is_grey() -> None:
    """The colour of missing values is neutral, and of none of the maps."""
    for name in PERCENT_MAPS:
        red, green, blue, _ = colour_map(name)(np.ma.masked)
        assert red == green == blue


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_equal_figures_have_equal_bytes(kind: Literal["png", "svg"]) -> None:
    """Also when the user's own matplotlib settings differ in between."""
    first = figure_bytes(small_figure(), kind, title="t", config_sha256=HASH)
    with mpl.rc_context(
        {"font.size": 23, "axes.facecolor": "red", "svg.hashsalt": "other"}
    ):
        second = figure_bytes(small_figure(), kind, title="t", config_sha256=HASH)
        assert mpl.rcParams["font.size"] == 23
    assert first == second


def test_png_names_its_settings_and_no_software() -> None:
    """A picture can be traced to the artefact, whatever matplotlib drew it."""
    data = figure_bytes(small_figure(), "png", title="Ä title", config_sha256=HASH)
    picture = Image.open(io.BytesIO(data))
    assert isinstance(picture, PngImageFile)
    assert picture.text["config_sha256"] == HASH
    assert picture.text["Title"] == "Ä title"
    assert "Software" not in picture.text


def test_svg_names_its_settings_and_no_date() -> None:
    """The same for the other format."""
    data = figure_bytes(small_figure(), "svg", title="t", config_sha256=HASH).decode()
    assert f"config_sha256:{HASH}" in data
    assert "<dc:date>" not in data


def test_long_titles_stay_inside_the_figure() -> None:
    """A line that is too long is set smaller instead of being cut."""
    with drawing():
        figure = new_figure(4.0, 2.0)
        put_title(figure, 0.5, "a title of many words " * 3, "short")
        box = figure.texts[0].get_window_extent()
    assert box.x1 <= 4.0 * figure.dpi
    title, subtitle = (float(text.get_fontsize()) for text in figure.texts)
    assert title < subtitle * 1.2


def test_drawing_needs_neither_pyplot_nor_a_display() -> None:
    """Even where the user's backend is one that needs a display."""
    code = """
        import sys
        import numpy as np
        from tests.support.synthetic_maps import synthetic_bin_map
        from tests.support.synthetic_maps import synthetic_workspace_map
        from reachmap.plots.albums import bin_album, workspace_album
        from reachmap.plots.parts.style import figure_bytes
        items = workspace_album(synthetic_workspace_map(np.eye(3)[None]), ["path"])
        items += bin_album(synthetic_bin_map(shape=(1, 2, 2, 4, 2)))
        for item in items:
            item.draw()
        assert figure_bytes(items[0].draw(), "png", title="", config_sha256="")
        assert "matplotlib.pyplot" not in sys.modules
        """
    environment = {
        key: value
        for key, value in os.environ.items()
        if key not in ("DISPLAY", "WAYLAND_DISPLAY")
    }
    environment |= {"MPLBACKEND": "TkAgg", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_every_picture_of_the_house_is_restored_afterwards() -> None:
    """Drawing leaves no trace in the settings of the program that calls it."""
    before = dict(mpl.rcParams)
    draw: Callable[[], Figure] = small_figure
    draw()
    assert dict(mpl.rcParams) == before
