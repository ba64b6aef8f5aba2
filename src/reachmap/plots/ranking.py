"""Cost of the first grasps, as supplied and re-ranked: the paper's Fig. 7."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from reachmap._typing import FloatArray
from reachmap.errors import SettingsError
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
from reachmap.ranking.answers.ranked_list import QUADRANT_ORDER, RankedList

TERM_COLOURS: Final[Mapping[str, str]] = {
    "path_length": "#2f6db3",
    "planning_time": "#e69f00",
    "execution_time": "#3d9970",
    "likeness": "#9467bd",
    "clearance": "#c44e52",
    "joint_margin": "#8c6d4f",
    "singularity": "#5fb0c9",
    "wind_up": "#a8a13b",
    "to_grasp_s": "#2f6db3",
    "lift_s": "#56a36c",
    "transfer_s": "#8cc152",
    "place_s": "#c8b13b",
    "retreat_s": "#7fb8d6",
    "return_s": "#4f81bd",
    "waits_s": "#b0b0b0",
    "planning_s": "#e69f00",
    "failure_s": "#c44e52",
}
OTHER_COLOURS: Final = ("#9467bd", "#8c6d4f", "#5fb0c9", "#a8a13b")
"""Of stages that go by other names."""
# Choices of layout: bars, in units of the distance of two groups.
MAX_GROUPS: Final = 24
BAR_WIDTH: Final = 0.38
PLACES: Final = (-0.21, 0.21)
ORDERS: Final = ("as supplied", "re-ranked")


@dataclass(frozen=True, slots=True, kw_only=True)
class CostGroup:
    """Costs of one list, or of one quadrant of it.

    Attributes
    ----------
    label : str
    supplied, ranked : array, shape (n, t)
        Summands of J in either order; a row of NaN is an unreachable grasp.
    """

    label: str
    supplied: FloatArray
    ranked: FloatArray


def cost_groups(ranked: Sequence[RankedList]) -> list[CostGroup]:
    """Costs of each quadrant, or of each list that names none."""
    groups = []
    for one in ranked:
        terms = np.stack([*one.terms().values()], axis=1)
        for label, rows in _rows(one, several=len(ranked) > 1).items():
            order = one.ranking.order
            best_first = order[np.isin(order, rows)]
            groups.append(
                CostGroup(label=label, supplied=terms[rows], ranked=terms[best_first])
            )
    return groups


def _rows(one: RankedList, *, several: bool) -> dict[str, list[int]]:
    """Rows of each quadrant; of the whole list if it names none."""
    name = Path(one.grasps.source).stem if several else ""
    quadrants = one.grasps.quadrants
    if not any(quadrants):
        return {name or "all": list(range(len(quadrants)))} if quadrants else {}
    return {
        f"{name} {quadrant or 'other'}".strip(): rows
        for quadrant in QUADRANT_ORDER
        if (rows := [row for row, own in enumerate(quadrants) if own == quadrant])
    }


def ranking_chart(
    groups: Sequence[CostGroup],
    names: Sequence[str],
    top: int = 10,
    *,
    subtitle: str = "",
) -> Figure:
    """Draw the mean cost of the first grasps in either order, stacked by term.

    A mean over unreachable grasps would be infinite: the bar is then grey to the top
    of the chart, the coloured part is the mean of the reachable ones, and the number
    of unreachable ones is written on it.

    Parameters
    ----------
    groups : sequence of CostGroup
    names : sequence of str, length t
        Terms in the order of their columns.
    top : int
        How many of the first grasps are averaged.
    subtitle : str
    """
    if not groups or top < 1:
        raise SettingsError("a chart needs grasps, and a top of 1 or more")
    if len(groups) > MAX_GROUPS:
        raise SettingsError(f"{len(groups)} groups; a chart takes {MAX_GROUPS}")
    with drawing():
        width = max(6.4, 1.6 + 1.45 * len(groups))
        figure = new_figure(width, 5.0)
        put_title(figure, 0.75, _title(groups, names, top), subtitle)
        axes = axes_at(figure, 0.75, 0.95, width - 0.95, 3.15)
        limit = 1.22 * max(_tallest(groups, top), 1e-3)
        for place, group in enumerate(groups):
            for shift, terms in zip(
                PLACES, (group.supplied, group.ranked), strict=True
            ):
                _draw_bar(axes, place + shift, terms[:top], names, limit)
        unit = "mean seconds per pick" if in_seconds(names) else "mean J"
        _finish(axes, groups, unit, top, limit)
        _legend(figure, groups, names, top)
    return figure


def _title(groups: Sequence[CostGroup], names: Sequence[str], top: int) -> str:
    most = max(len(group.supplied) for group in groups)
    what = "time per pick" if in_seconds(names) else "cost"
    first = f"the first {min(top, most)} grasps"
    return f"Mean {what} of {first}, as supplied and re-ranked"


def _tallest(groups: Sequence[CostGroup], top: int) -> float:
    means = [
        _means(terms[:top]).sum()
        for group in groups
        for terms in (group.supplied, group.ranked)
    ]
    return float(max(means))


def _means(terms: FloatArray) -> FloatArray:
    """Mean of each term over the reachable grasps, shape (t,); 0 if there are none."""
    reachable = terms[~np.isnan(terms).any(axis=1)]
    return reachable.mean(axis=0) if len(reachable) else np.zeros(terms.shape[1])


def term_label(name: str) -> str:
    """A term in words, without its unit: ``path length`` for ``path_length``."""
    return name.removesuffix("_s").replace("_", " ")


def in_seconds(names: Sequence[str]) -> bool:
    """Whether terms are predicted seconds, not summands of J."""
    return all(name.endswith("_s") for name in names)


def part_colours(names: Sequence[str]) -> list[str]:
    """Colours of terms, the same for a name wherever it is drawn."""
    others = cycle(OTHER_COLOURS)
    return [TERM_COLOURS.get(name) or next(others) for name in names]


def _draw_bar(
    axes: Axes, x: float, terms: FloatArray, names: Sequence[str], limit: float
) -> None:
    unreachable = int(np.isnan(terms).any(axis=1).sum())
    if unreachable:
        axes.bar(x, limit, BAR_WIDTH, color=NOT_ATTEMPTED, zorder=1)
        text = f"{unreachable} of {len(terms)}\nunreachable"
        axes.text(
            x, limit * 0.985, text, ha="center", va="top", fontsize=6.6, color=INK
        )
    bottom = 0.0
    for value, colour in zip(_means(terms), part_colours(names), strict=True):
        axes.bar(x, value, BAR_WIDTH, bottom=bottom, color=colour, zorder=2)
        bottom += float(value)
    if unreachable < len(terms):
        axes.text(
            x, bottom + 0.012 * limit, f"{bottom:.2f}", ha="center", va="bottom",
            fontsize=7.6, color=INK, zorder=3,
            path_effects=[withStroke(linewidth=2.0, foreground="white")]
            if not unreachable
            else [],
        )  # fmt: skip


def _finish(
    axes: Axes, groups: Sequence[CostGroup], unit: str, top: int, limit: float
) -> None:
    axes.set_ylim(0.0, limit)
    axes.set_xlim(-0.6, len(groups) - 0.4)
    axes.set_ylabel(unit)
    places = [place + shift for place in range(len(groups)) for shift in PLACES]
    axes.set_xticks(places, ["supplied", "re-ranked"] * len(groups), fontsize=6.8)
    axes.tick_params(axis="x", length=0)
    for place, group in enumerate(groups):
        count = len(group.supplied)
        label = group.label if count >= top else f"{group.label} (only {count})"
        axes.annotate(
            label, (place, 0.0), xytext=(0, -22), textcoords="offset points",
            ha="center", va="top", fontsize=9.0, fontweight="bold", color=INK,
            annotation_clip=False,
        )  # fmt: skip
    axes.spines[["top", "right"]].set_visible(False)
    axes.yaxis.grid(visible=True, color=RULE, linewidth=0.4, alpha=0.5)
    axes.set_axisbelow(True)


def _legend(
    figure: Figure, groups: Sequence[CostGroup], names: Sequence[str], top: int
) -> None:
    left = 0.75 / float(figure.get_size_inches()[0])
    handles = [
        Patch(color=colour, label=term_label(name))
        for colour, name in zip(part_colours(names), names, strict=True)
    ]
    orders = [terms[:top] for g in groups for terms in (g.supplied, g.ranked)]
    if any(np.isnan(terms).any() for terms in orders):
        # Short where there are many others: two rows of five have to fit.
        label = "unreachable" if len(handles) > 5 else "unreachable grasps"
        handles.append(
            Patch(color=NOT_ATTEMPTED, label=f"{label}: the mean is infinite")
        )
    ncols = len(handles) if len(handles) < 7 else -(-len(handles) // 2)
    figure.legend(
        handles=handles, loc="lower left", ncols=ncols, labelcolor=MUTED,
        bbox_to_anchor=(left, 0.01), borderaxespad=0.0, columnspacing=1.2,
        handlelength=1.1, fontsize=7.4,
    )  # fmt: skip
