"""What a bin map predicted, and what planning found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from reachmap.plots.parts.style import (
    INK,
    MUTED,
    NOT_ATTEMPTED,
    RULE,
    axes_at,
    drawing,
    new_figure,
    put_title,
)
from reachmap.plots.ranking import TERM_COLOURS, term_label
from reachmap.ranking.lookup.table import TERMS
from reachmap.text import printable
from reachmap.validation.calibration import ReliabilityDiagram
from reachmap.validation.judgement import ORDERS, JudgedList
from reachmap.validation.statistics import Share
from reachmap.validation.summary import GroupSummary, OrderFigures, Validation

LIST_COLOURS: Final = ("#2f6db3", "#3d9970", "#9467bd", "#b8860b", "#4f4f4f")
MISS_COLOUR: Final = "#c0392b"
# Choices of layout: letters, and bars in units of the distance of two groups.
MAX_GROUPS: Final = 24
LABEL_WIDTH: Final = 18
BAR_WIDTH: Final = 0.26
PLACES: Final = (-0.28, 0.0, 0.28)
SHORT: Final = ("supplied", "re-ranked", "IK only")
LEFT, BOTTOM, SIDE, GAP, DIAGRAM = 0.75, 1.0, 3.3, 0.85, 2.4


@drawing()
def validation_chart(validation: Validation) -> Figure:
    """Draw predicted against measured J, the reliability of probabilities, and orders.

    Returns
    -------
    Figure
        Of many groups it shows the first 24, and says so.
    """
    groups = validation.groups[:MAX_GROUPS]
    width = max(2.6, 1.15 * len(groups))
    place = LEFT + SIDE + GAP + DIAGRAM + GAP
    figure = new_figure(place + width + 0.25, BOTTOM + SIDE + 0.95)
    put_title(figure, LEFT, _title(validation), _subtitle(validation))
    _draw_costs(axes_at(figure, LEFT, BOTTOM, SIDE, SIDE), validation.lists)
    bars = axes_at(figure, place, BOTTOM, width, SIDE)
    _draw_groups(bars, groups, validation.top)
    diagram = axes_at(figure, LEFT + SIDE + GAP, BOTTOM, DIAGRAM, SIDE)
    _draw_diagram(diagram, validation.diagram)
    if len(validation.groups) > MAX_GROUPS:
        said = f"first {MAX_GROUPS} of {len(validation.groups)} groups"
        bars.set_title(said, loc="right", fontsize=7.4, color=MUTED)
    return figure


def _title(validation: Validation) -> str:
    precision = validation.overall.confusion.precision
    return f"{_share_text(precision)} of the grasps called reachable were reached"


def _share_text(share: Share) -> str:
    if share.total == 0:
        return "None"
    return (
        f"{100 * share.share:.1f} % ({100 * share.low:.1f} to {100 * share.high:.1f} %)"
    )


def _subtitle(validation: Validation) -> str:
    c = validation.overall.confusion
    outside = c.outside_reached + c.outside_missed
    parts = [
        f"{validation.overall.grasps} grasps",
        f"{c.true_positive} rightly and {c.false_positive} wrongly called reachable",
        f"{c.true_negative} rightly and {c.false_negative} wrongly called unreachable",
    ]
    return " · ".join([*parts, *([f"{outside} outside the map"] if outside else [])])


def _plain(label: str) -> str:
    """A file's name, short, and with no formula in it."""
    return printable(label, LABEL_WIDTH).replace("$", r"\$")


def _draw_costs(axes: Axes, lists: Sequence[JudgedList]) -> None:
    """Predicted against measured J; misses stand along the upper edge."""
    seen = [np.r_[one.predicted_cost, one.cost] for one in lists]
    finite = np.concatenate(seen)
    finite = finite[np.isfinite(finite)]
    top = 1.08 * float(finite.max(initial=1e-3))
    axes.plot([0.0, top], [0.0, top], color=RULE, linewidth=0.8, zorder=1)
    for number, one in enumerate(lists):
        colour = LIST_COLOURS[number % len(LIST_COLOURS)]
        both = one.predicted & one.reached
        axes.scatter(
            one.predicted_cost[both], one.cost[both], s=9.0, color=colour, alpha=0.55,
            linewidths=0.0, zorder=2,
        )  # fmt: skip
        missed = one.predicted_cost[one.predicted & ~one.reached]
        axes.scatter(
            missed, np.full(len(missed), top), s=26.0, marker="x", color=MISS_COLOUR,
            linewidths=1.2, zorder=3, clip_on=False,
        )  # fmt: skip
    axes.set_xlim(0.0, top)
    axes.set_ylim(0.0, top)
    axes.set_xlabel("J predicted by the map")
    axes.set_ylabel("J measured, mean over successful attempts")
    axes.spines[["top", "right"]].set_visible(False)
    _cost_legend(axes, lists)


def _cost_legend(axes: Axes, lists: Sequence[JudgedList]) -> None:
    handles = [
        Line2D(
            [], [], linestyle="", marker="o", markersize=4,
            color=LIST_COLOURS[number % len(LIST_COLOURS)], label=_plain(one.label),
        )
        for number, one in enumerate(lists)
    ]  # fmt: skip
    handles.append(
        Line2D([], [], linestyle="", marker="x", color=MISS_COLOUR, label="not reached")
    )
    axes.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.135), fontsize=7.4,
        ncols=min(len(handles), 3), labelcolor=MUTED, columnspacing=1.0,
        handletextpad=0.2,
    )  # fmt: skip


def _draw_diagram(axes: Axes, diagram: ReliabilityDiagram) -> None:
    """Reliability diagram: frequency with its interval over predicted probability."""
    axes.plot([0.0, 1.0], [0.0, 1.0], color=RULE, linewidth=0.8, zorder=1)
    for one in diagram.bins:
        hit = one.reached
        axes.plot(
            [one.predicted] * 2, [hit.low, hit.high], color=MUTED, linewidth=1.0,
            zorder=2,
        )  # fmt: skip
        axes.scatter(
            one.predicted, hit.share, s=8.0 + 90.0 * hit.total / diagram.grasps,
            color=LIST_COLOURS[0], linewidths=0.0, zorder=3, clip_on=False,
        )  # fmt: skip
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_xlabel("predicted probability")
    axes.set_ylabel("share reached (95 % interval)")
    axes.spines[["top", "right"]].set_visible(False)
    if diagram.grasps:
        said = f"calibration error {diagram.error:.3f}"
        axes.set_title(said, loc="left", fontsize=7.4, color=MUTED)


def _draw_groups(axes: Axes, groups: Sequence[GroupSummary], top: int) -> None:
    costs = [f.cost for group in groups for f in group.orders.values()]
    limit = 1.25 * max([1e-3, *(cost for cost in costs if np.isfinite(cost))])
    for place, group in enumerate(groups):
        for shift, name in zip(PLACES, ORDERS, strict=True):
            _draw_bar(axes, place + shift, group.orders[name], limit)
        axes.annotate(
            _plain(group.label), (place, 0.0), xytext=(0, -40), ha="center", va="top",
            textcoords="offset points", fontsize=8.0, fontweight="bold", color=INK,
            annotation_clip=False,
        )  # fmt: skip
    axes.set_ylim(0.0, limit)
    axes.set_xlim(-0.6, len(groups) - 0.4)
    axes.set_ylabel(f"mean measured J of the first {top}")
    ticks = [place + shift for place in range(len(groups)) for shift in PLACES]
    axes.set_xticks(ticks, SHORT * len(groups), fontsize=6.2, rotation=90)
    axes.tick_params(axis="x", length=0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.yaxis.grid(visible=True, color=RULE, linewidth=0.4, alpha=0.5)
    axes.set_axisbelow(True)
    handles = [Patch(color=TERM_COLOURS[k], label=term_label(k)) for k in TERMS]
    axes.legend(
        handles=[*handles, Patch(color=NOT_ATTEMPTED, label="some not reached")],
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, fontsize=7.0,
        labelcolor=MUTED, columnspacing=0.9, handlelength=1.0, borderaxespad=0.2,
    )  # fmt: skip


def _draw_bar(axes: Axes, x: float, figures: OrderFigures, limit: float) -> None:
    missed = figures.considered - figures.reached
    if missed:
        axes.bar(x, limit, BAR_WIDTH, color=NOT_ATTEMPTED, zorder=1)
        axes.text(
            x, 0.985 * limit, f"{missed} of {figures.considered}", ha="center",
            va="top", fontsize=5.4, color=INK, rotation=90,
        )  # fmt: skip
    bottom = 0.0
    for value, name in zip(np.nan_to_num(figures.terms), TERMS, strict=True):
        colour = TERM_COLOURS[name]
        axes.bar(x, value, BAR_WIDTH, bottom=bottom, color=colour, zorder=2)
        bottom += float(value)
    if figures.reached:
        axes.text(
            x, bottom + 0.01 * limit, f"{bottom:.2f}", ha="center", va="bottom",
            fontsize=5.8, color=INK, zorder=3,
        )  # fmt: skip
