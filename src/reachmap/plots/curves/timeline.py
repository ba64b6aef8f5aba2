"""The timeline of a pick: its stages and their durations."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.figure import Figure

from reachmap.maps.cycle.seconds import WAITS, cycle_parts
from reachmap.maps.cycle.summary import CycleSummary
from reachmap.maps.records import BinMap
from reachmap.plots.parts.bin_view import view_of
from reachmap.plots.parts.style import (
    INK,
    MUTED,
    axes_at,
    drawing,
    grid_lines,
    new_figure,
    put_title,
    subtitle_of,
)
from reachmap.plots.ranking import part_colours, term_label

# A choice of layout.
ROW_IN: Final = 0.36
WAIT_LABEL: Final = "waits (image, grip, release)"


@drawing()
def draw_timeline(bin_map: BinMap, cycle: CycleSummary) -> Figure:
    """One bar for each part of the mean cycle, where the one before ends.

    The line at the end of a bar spans the middle 80 % of the part's times. Waits stand
    at the end, whenever they are.

    Parameters
    ----------
    bin_map : BinMap
    cycle : CycleSummary
        Of the same map, with at least one whole cycle.
    """
    names, seconds = cycle_parts(bin_map)
    known = seconds[np.isfinite(seconds[..., 0])]
    shown = np.flatnonzero(known.mean(axis=0) > 0.0)
    height = ROW_IN * len(shown)
    figure = new_figure(7.2, height + 1.75)
    axes = axes_at(figure, 1.95, 0.62, 4.9, height)
    begin, colours = 0.0, part_colours(names)
    for row, k in enumerate(shown.tolist()):
        mean = float(known[:, k].mean())
        low, high = np.quantile(known[:, k], (0.1, 0.9))
        axes.barh(row, mean, left=begin, height=0.62, color=colours[k], zorder=2)
        end = begin + max(mean, float(high))
        axes.plot([begin + low, begin + high], [row, row], color=INK, lw=1.0, zorder=3)
        text = f"{mean:.2f} s"
        axes.text(end + 0.06, row, text, va="center", fontsize=8.0, color=INK)
        begin += mean
    labels = [WAIT_LABEL if names[k] == WAITS else term_label(names[k]) for k in shown]
    axes.set_yticks(range(len(shown)), labels, fontsize=8.5)
    axes.set_ylim(len(shown) - 0.4, -0.6)
    axes.set_xlim(0.0, 1.14 * begin)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("time from the scan configuration [s]")
    grid_lines(axes, "x")
    axes.set_axisbelow(True)
    axes.axvline(begin, color=MUTED, linewidth=1.0, linestyle=":")
    for spine in ("top", "right", "left"):
        axes.spines[spine].set_visible(False)
    made = cycle.throughput
    rate = "" if made is None else f"{made.picks_per_hour:.0f} picks per hour"
    said = (f"mean of {cycle.whole} whole cycles", rate, view_of(bin_map).cell_name)
    title = cycle.sentence
    put_title(
        figure,
        0.75,
        title[0].upper() + title[1:],
        subtitle_of(said),
    )
    return figure
