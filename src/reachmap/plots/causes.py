"""Why test frames are not reached: their states, and which bodies are in the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reachmap.maps.cycle.summary import CycleEnd, summarise_cycle
from reachmap.maps.records import BinMap, Status, WorkspaceMap
from reachmap.maps.summary.statistics import STATUS_NAMES, Causes, causes_of
from reachmap.plots.approach import STATUS_COLOURS
from reachmap.plots.parts.context import context_of
from reachmap.plots.parts.style import (
    INK,
    TICK_SIZE,
    axes_at,
    drawing,
    new_figure,
    put_title,
    subtitle_of,
)

# Choices of layout: bars, letters of a name, lengths on paper [in].
PAIRS_SHOWN = 10
LETTERS = 40
LEFT, RIGHT, WIDTH, ROW = 2.9, 0.9, 4.6, 0.27
TOP, GAP, BOTTOM = 1.15, 0.75, 0.55
LOST = STATUS_COLOURS[Status.APPROACH_BLOCKED]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Block:
    """Bars with a title over them: name, percent and colour of each."""

    title: str
    bars: list[tuple[str, float, str]]


@drawing()
def draw_causes(record: WorkspaceMap | BinMap) -> Figure:
    """Draw the states of all test frames, and the pairs of bodies that block most.

    Of a bin map with cycles also where these end before the robot is back.
    """
    causes = causes_of(record)
    total = max(sum(causes.states.values()), 1)
    kind = "test grasps" if isinstance(record, BinMap) else "test frames"
    blocks = _blocks(record, causes, total, kind)
    heights = [ROW * max(len(block.bars), 1) for block in blocks]
    bottom = BOTTOM + sum(heights) + GAP * (len(blocks) - 1)
    figure = new_figure(LEFT + WIDTH + RIGHT, bottom + TOP)
    for block, height in zip(blocks, heights, strict=True):
        bottom -= height
        axes = axes_at(figure, LEFT, bottom, WIDTH, height)
        names, values, colours = zip(*block.bars, strict=True)
        _draw_bars(axes, list(names), list(values), list(colours))
        axes.set_title(block.title, loc="left", pad=5)
        bottom -= GAP
    reached = 100.0 * causes.states.get(Status.PATH_FOUND, 0) / total
    more = len(causes.pairs) - PAIRS_SHOWN
    context = context_of(record.provenance)
    said = (
        f"{causes.total} {kind} attempted",
        f"{more} more pairs of bodies" if more > 0 else "",
        context.bin_name if isinstance(record, BinMap) else context.name,
    )
    put_title(
        figure,
        0.35,
        f"{reached:.1f} % reached; causes of the rest",
        subtitle_of(said),
    )
    return figure


def _blocks(
    record: WorkspaceMap | BinMap, causes: Causes, total: int, kind: str
) -> list[_Block]:
    blocked = STATUS_COLOURS[Status.IK_IN_COLLISION]
    shown = causes.pairs[:PAIRS_SHOWN]
    blocks = [
        _Block(
            title=f"{kind} [%]",
            bars=[
                (STATUS_NAMES[code], 100.0 * count / total, STATUS_COLOURS[code])
                for code, count in causes.states.items()
            ],
        ),
        _Block(
            title=f"bodies in collision [% of the {kind}]",
            bars=[
                (_short(pair), 100.0 * count / total, blocked) for pair, count in shown
            ]
            or [("nothing is blocked", 0.0, blocked)],
        ),
    ]
    cycle = summarise_cycle(record) if isinstance(record, BinMap) else None
    if cycle is not None and cycle.ends:
        blocks.append(
            _Block(
                title=f"reached, but no whole cycle [% of the {kind}]",
                bars=[
                    (_short(_end_name(end)), 100.0 * end.grasps / total, LOST)
                    for end in cycle.ends[:PAIRS_SHOWN]
                ],
            )
        )
    return blocks


def _short(pair: str) -> str:
    """Name a pair in as many letters as fit beside its bar."""
    name = pair.replace(" | ", " – ")
    return name if len(name) <= LETTERS else f"{name[: LETTERS - 1]}…"


def _end_name(end: CycleEnd) -> str:
    """The bodies in the way of a stage, or its outcome."""
    return f"{end.stage}: {end.pair or end.status}"


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
