"""How many test grasps are reached after one, two, … attempts, with intervals."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reachmap.maps.records import BinMap
from reachmap.maps.summary.statistics import Saturation, saturation_of
from reachmap.plots.parts.bin_view import view_of
from reachmap.plots.parts.style import (
    INK,
    INTERVAL_LOOK,
    MUTED,
    axes_at,
    drawing,
    grid_lines,
    new_figure,
    put_title,
    subtitle_of,
)

# Points with their number written beside them; more would run into each other.
MOST_NAMED = 8


@drawing()
def draw_saturation(bin_map: BinMap) -> Figure:
    """Share of test grasps reached over the number of attempts.

    Bars are Wilson 95 % intervals. Where the roadmap proves more test grasps
    reachable than the attempts found, a line shows its share.
    """
    data = saturation_of(bin_map)
    figure = new_figure(6.4, 4.6)
    axes = axes_at(figure, 0.85, 0.62, 5.2, 3.15)
    _draw_curve(axes, data)
    if data.proved > data.share[-1]:
        _draw_proved(axes, data.proved)
    _set_limits(axes, data)
    last = int(data.attempts[-1])
    title = f"{data.share[-1]:.2f} % after {last} attempt{'s' * (last > 1)}"
    if last > 1:
        title = f"{data.share[0]:.2f} % after 1 attempt, {title}"
    cell_name = view_of(bin_map).cell_name
    said = (f"{data.total} test grasps", "bars: Wilson 95 % intervals", cell_name)
    put_title(figure, 0.85, title, subtitle_of(said))
    return figure


def _draw_curve(axes: Axes, data: Saturation) -> None:
    axes.errorbar(
        data.attempts,
        data.share,
        yerr=[data.share - data.low, data.high - data.share],
        fmt="-o",
        **INTERVAL_LOOK,
    )
    # The curve never falls, so there is room to the lower right of every point.
    named = np.arange(len(data.attempts))[:: -(-len(data.attempts) // MOST_NAMED)]
    for k, value in zip(data.attempts[named], data.share[named], strict=True):
        axes.annotate(
            f"{value:.2f}",
            (k, value),
            xytext=(6, -4),
            textcoords="offset points",
            ha="left",
            va="top",
            fontsize=8.5,
            color=INK,
        )


def _draw_proved(axes: Axes, proved: float) -> None:
    axes.axhline(proved, color=MUTED, linewidth=1.2, linestyle=(0, (5, 3)))
    axes.annotate(
        f"proved reachable by the roadmap: {proved:.2f} %",
        (0.6, proved),
        xytext=(4, 4),
        textcoords="offset points",
        fontsize=8.5,
        color=MUTED,
    )


def _set_limits(axes: Axes, data: Saturation) -> None:
    top, bottom = max(float(data.high.max()), data.proved), float(data.low.min())
    span = max(top - bottom, 4.0)
    axes.set_ylim(max(0.0, bottom - 0.25 * span), min(102.0, top + 0.22 * span))
    axes.set_xlim(0.6, int(data.attempts[-1]) + 0.6)
    axes.set_xticks(data.attempts)
    axes.set_xlabel("attempts per test grasp")
    axes.set_ylabel("test grasps reached [%]")
    grid_lines(axes)
    axes.set_axisbelow(True)
    for spine in ("top", "right"):
        axes.spines[spine].set_visible(False)
