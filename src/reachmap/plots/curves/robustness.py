"""Robustness curve: certified and remaining reachability over the size of errors."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reachmap.maps.robustness.record import Robustness
from reachmap.maps.robustness.summary import (
    RobustnessSummary,
    errors_text,
    summarise_robustness,
)
from reachmap.plots.parts.context import context_of
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


@drawing()
def draw_robustness(record: Robustness) -> Figure:
    """Test grasps that stay reachable over multiples of the errors."""
    summary = summarise_robustness(record)
    figure = new_figure(6.8, 5.1)
    axes = axes_at(figure, 0.85, 1.12, 5.6, 3.15)
    _draw_curves(axes, summary)
    axes.axvline(1.0, color=MUTED, linewidth=1.0)
    axes.set_xlim(0.0, summary.steps[-1].scale)
    axes.set_ylim(0.0, 104.0)
    axes.set_xlabel(f"size of the errors; 1 is {errors_text(summary.errors)}")
    axes.set_ylabel("test grasps [%]")
    grid_lines(axes)
    axes.set_axisbelow(True)
    # Below the axes: curves fall anywhere between them.
    figure.legend(loc="lower left", bbox_to_anchor=(0.115, 0.02), ncols=2)
    for spine in ("top", "right"):
        axes.spines[spine].set_visible(False)
    given = summary.given
    said = (
        f"{errors_text(summary.errors)} off; of {summary.steps[0].reachability:.1f} % "
        "without errors",
        context_of(record.provenance).bin_name,
    )
    put_title(
        figure,
        0.85,
        f"{given.reachability:.1f} % of the test grasps survive, "
        f"{given.certified:.1f} % for certain",
        subtitle_of(said),
    )
    return figure


def _draw_curves(axes: Axes, summary: RobustnessSummary) -> None:
    """What is certified, free in every cell, and free on average with its range."""
    scale = [step.scale for step in summary.steps]
    axes.fill_between(
        scale,
        [step.lowest for step in summary.steps],
        [step.highest for step in summary.steps],
        color=BIN_COLOUR,
        alpha=0.18,
        linewidth=0,
        label=f"minimum to maximum of {summary.samples} cells",
    )
    lines = (
        ("reachability", "stay reachable, mean", BIN_COLOUR, "o", "-"),
        ("always", "stay reachable in every cell", "#7b1fa2", "s", "--"),
        ("certified", "certified: no such error causes a collision", INK, "^", ":"),
    )
    for name, words, colour, marker, style in lines:
        axes.plot(
            scale,
            [getattr(step, name) for step in summary.steps],
            color=colour,
            marker=marker,
            linestyle=style,
            linewidth=1.6,
            markersize=5,
            clip_on=False,
            label=words,
        )
