"""The emptying curve: what is reached over the height of the parts in a bin."""

from __future__ import annotations

from matplotlib.figure import Figure

from reachmap.maps.records import BinMap
from reachmap.maps.summary.emptying import Emptying
from reachmap.plots.parts.bin_view import view_of
from reachmap.plots.parts.style import (
    BIN_COLOUR,
    INK,
    MUTED,
    axes_at,
    drawing,
    grid_lines,
    new_figure,
    put_title,
    subtitle_of,
)

LINES = (
    ("points", "points, from at least one direction", BIN_COLOUR, "o", "-"),
    ("directions", "directions, with at least one roll", "#7b1fa2", "s", "--"),
    ("frames", "test grasps", INK, "^", ":"),
    ("cycle", "test grasps with a whole cycle", "#b35900", "D", "-."),
)


@drawing()
def draw_emptying(bin_map: BinMap, emptying: Emptying) -> Figure:
    """Reachability of points, directions, test grasps and cycles by height.

    Parameters
    ----------
    bin_map : BinMap
    emptying : Emptying
        Of the same map.
    """
    figure = new_figure(6.8, 4.6)
    axes = axes_at(figure, 0.85, 0.62, 5.6, 3.15)
    heights = [1000.0 * level.height_m for level in emptying.levels]
    for name, words, colour, marker, style in LINES:
        values = [getattr(level, name) for level in emptying.levels]
        if values[0] is None:
            continue
        axes.plot(
            heights,
            values,
            color=colour,
            marker=marker,
            linestyle=style,
            linewidth=1.6,
            markersize=5,
            label=words,
        )
    if emptying.empties_to_m is not None and emptying.left:
        axes.axvline(1000.0 * emptying.empties_to_m, color=MUTED, linewidth=1.0)
    # A bin is emptied from left to right.
    axes.set_xlim(1.04 * heights[-1], 0.0)
    axes.set_ylim(0.0, 104.0)
    axes.set_xlabel("height of the parts above the bottom [mm]")
    axes.set_ylabel("reached [%]")
    grid_lines(axes)
    axes.set_axisbelow(True)
    axes.legend(loc="lower left", fontsize=8.5, frameon=False)
    for spine in ("top", "right"):
        axes.spines[spine].set_visible(False)
    obstacle = "parts below each level are an obstacle"
    if not emptying.filled:
        obstacle = "parts below each level are no obstacle"
    cell_name = view_of(bin_map).cell_name
    said = (obstacle, cell_name)
    title = emptying.sentence
    put_title(
        figure,
        0.85,
        title[0].upper() + title[1:],
        subtitle_of(said),
    )
    return figure
