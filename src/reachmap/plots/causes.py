"""Why test frames are not reached: their states, and which bodies are in the way."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reachmap.maps.records import BinMap, Status, WorkspaceMap
from reachmap.maps.summary.statistics import STATUS_NAMES, causes_of
from reachmap.plots.approach import STATUS_COLOURS
from reachmap.plots.parts.context import context_of
from reachmap.plots.parts.style import (
    INK,
    TICK_SIZE,
    axes_at,
    drawing,
    new_figure,
    put_title,
)

PAIRS_SHOWN = 10
LETTERS = 40
LEFT, RIGHT, WIDTH, ROW = 2.9, 0.9, 4.6, 0.27


@drawing()
def draw_causes(record: WorkspaceMap | BinMap) -> Figure:
    """Draw the states of all test frames, and the pairs of bodies that block most."""
    causes = causes_of(record)
    shown = causes.pairs[:PAIRS_SHOWN]
    lower = ROW * max(len(shown), 1)
    upper = ROW * max(len(causes.states), 1)
    height = 0.55 + lower + 0.75 + upper + 1.15
    figure = new_figure(LEFT + WIDTH + RIGHT, height)
    first = axes_at(figure, LEFT, 0.55 + lower + 0.75, WIDTH, upper)
    total = max(sum(causes.states.values()), 1)
    _draw_bars(
        first,
        [STATUS_NAMES[code] for code in causes.states],
        [100.0 * count / total for count in causes.states.values()],
        [STATUS_COLOURS[code] for code in causes.states],
    )
    kind = "test grasps" if isinstance(record, BinMap) else "test frames"
    first.set_title(f"{kind} [%]", loc="left", pad=5)
    second = axes_at(figure, LEFT, 0.55, WIDTH, lower)
    _draw_bars(
        second,
        [_short(pair) for pair, _ in shown] or ["nothing is blocked"],
        [100.0 * count / total for _, count in shown] or [0.0],
        [STATUS_COLOURS[Status.IK_IN_COLLISION]] * max(len(shown), 1),
    )
    second.set_title(f"bodies in collision [% of the {kind}]", loc="left", pad=5)
    reached = 100.0 * causes.states.get(Status.PATH_FOUND, 0) / total
    more = len(causes.pairs) - len(shown)
    name = context_of(record.provenance).name
    said = (
        f"{causes.total} {kind} attempted",
        f"{more} more pairs of bodies" if more > 0 else "",
        name,
    )
    put_title(
        figure,
        0.35,
        f"{reached:.1f} % reached, and why the rest is not",
        " · ".join(part for part in said if part),
    )
    return figure


def _short(pair: str) -> str:
    """Name a pair in as many letters as fit beside its bar."""
    name = pair.replace(" | ", " – ")
    return name if len(name) <= LETTERS else f"{name[: LETTERS - 1]}…"


def _draw_bars(
    axes: Axes, names: list[str], values: list[float], colours: list[str]
) -> None:
    """Draw horizontal bars from the top, each with its value behind it."""
    place = np.arange(len(names))
    axes.barh(place, values, height=0.72, color=colours)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlim(0.0, max(*values, 1.0) * 1.02)
    axes.set_yticks(place, names)
    axes.tick_params(axis="y", length=0, labelsize=TICK_SIZE)
    axes.tick_params(axis="x", length=2.5)
    for spine in ("top", "right", "left"):
        axes.spines[spine].set_visible(False)
    for index, value in enumerate(values):
        axes.annotate(
            f"{value:.1f}",
            (value, index),
            xytext=(4, 0),
            textcoords="offset points",
            va="center_baseline",
            fontsize=TICK_SIZE,
            color=INK,
            annotation_clip=False,
        )
