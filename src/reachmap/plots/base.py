"""A robot placement from above: the bound at each place, and the chosen one."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from reachmap._typing import FloatArray
from reachmap.geometry import inverse_transform
from reachmap.maps.base.record import BasePlacement
from reachmap.maps.summary.base import base_sentences
from reachmap.plots.parts.context import context_of
from reachmap.plots.parts.outlines import (
    Outline,
    base_outline,
    bin_outlines,
    body_outlines,
    draw_outline,
    legend_lines,
)
from reachmap.plots.parts.squares import PERCENT_SCALE, colour_bar
from reachmap.plots.parts.style import (
    BIN_COLOUR,
    INK,
    MUTED,
    PercentMap,
    axes_at,
    colour_map,
    drawing,
    fit_scale,
    fit_width,
    grid_lines,
    new_figure,
    put_text,
    put_title,
)

# Lengths on paper [in], and the room around the bin [m]: choices of layout.
LEFT, RIGHT, TOP, BOTTOM = 0.80, 1.05, 1.05, 2.0
WIDEST, TALLEST, ROOM_M = 5.6, 5.6, 0.15
LINE = 0.19


@drawing()
def draw_base(placement: BasePlacement, percent_map: PercentMap = "RdYlGn") -> Figure:
    """Draw the bound at every place, and the chosen base pose.

    Parameters
    ----------
    placement : BasePlacement
    percent_map : str
    """
    return (
        _draw_rail(placement)
        if placement.rail
        else _draw_places(placement, percent_map)
    )


def _draw_places(placement: BasePlacement, percent_map: PercentMap) -> Figure:
    outlines = _outlines(placement)
    near = [
        placement.candidate_position[:, :2],
        *(o.polygon for o in outlines if o.kind in ("bin", "base")),
    ]
    points = np.concatenate(near)
    low, high = points.min(axis=0) - ROOM_M, points.max(axis=0) + ROOM_M
    scale = fit_scale(low, high, WIDEST, TALLEST)
    width, height = (high - low) * scale
    figure = new_figure(LEFT + max(width, 3.6) + RIGHT, BOTTOM + height + TOP)
    axes = axes_at(figure, LEFT, BOTTOM, width, height)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xlabel("x of the world [m]")
    axes.set_ylabel("y of the world [m]")
    marks = _draw_squares(axes, placement, percent_map)
    for outline in outlines:
        draw_outline(axes, outline)
    # Bodies look alike; one entry stands for them all.
    named = {o.kind: o for o in reversed(outlines) if o.name}
    legend = [
        dataclasses.replace(o, name="bodies") if kind == "body" else o
        for kind, o in reversed(named.items())
    ]
    handles = [*legend_lines(legend), *_draw_arrows(axes, placement)]
    if marks is not None:
        bar = (LEFT + width + 0.2, BOTTOM, 0.14, height)
        colour_bar(figure, marks, bar, "bound of path reachability [%]")
    _write_text(figure, placement, handles)
    return figure


def _outlines(placement: BasePlacement) -> list[Outline]:
    """Bodies, the base and the bin, in the world."""
    context = context_of(placement.provenance)
    if context.cell is None:
        return []
    scan = context.cell.workspace_scan.model_copy(update={"frame": "world"})
    cell = context.cell.model_copy(update={"workspace_scan": scan})
    # Outlines are in the level frame, which is the world's but for its lean.
    T = inverse_transform(cell.T_base_level()) @ cell.T_base_world()
    base = base_outline(cell, placement.provenance.urdf)
    return [
        *body_outlines(cell),
        base,
        *bin_outlines(cell.bin, T @ placement.bin_pose),
    ]


def _draw_squares(
    axes: Axes, placement: BasePlacement, percent_map: PercentMap
) -> ScalarMappable | None:
    """Fill each place with the best bound over heights, arms and mountings."""
    rows = np.flatnonzero(placement.exact == 0)
    R = placement.T_world_level[:2, :2]
    places = np.round(placement.candidate_position[rows, :2] @ R, 6)
    if not len(rows):
        return None
    xy, which = np.unique(places, axis=0, return_inverse=True)
    best = np.full(len(xy), -1.0)
    np.maximum.at(best, which.ravel(), np.nan_to_num(placement.score[rows], nan=-1.0))
    half = np.array([_spacing(xy[:, 0]), _spacing(xy[:, 1])]) / 2
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    squares = (xy[:, None, :] + corners) @ R.T
    free = best >= 0
    marks = PolyCollection(
        list(squares[free]),
        array=best[free],
        cmap=colour_map(percent_map),
        norm=PERCENT_SCALE,
        edgecolor="white",
        linewidth=0.4,
    )
    axes.add_collection(marks)
    axes.add_collection(
        PolyCollection(
            list(squares[~free]), facecolor="#ececec", edgecolor="white", linewidth=0.4
        )
    )
    return marks


def _spacing(values: FloatArray) -> float:
    apart = np.diff(np.unique(values))
    return float(apart.min()) if len(apart) else 0.1


def _draw_arrows(axes: Axes, placement: BasePlacement) -> list[Line2D]:
    """Where base x points, for the chosen place, the runner-up and the present one."""
    handles = []
    for row, name, colour, style in (
        (placement.present, "as the cell is", MUTED, (0, (1, 1))),
        (placement.runner_up, "runner-up", INK, (0, (4, 2))),
        (placement.chosen, "chosen place (arrow: base x)", BIN_COLOUR, (0, ())),
    ):
        if row < 0 or (row == placement.chosen and colour != BIN_COLOUR):
            continue
        x, y = placement.candidate_position[row, :2].tolist()
        yaw = float(placement.candidate_yaw[row])
        axes.annotate(
            "",
            xy=(x + 0.16 * np.cos(yaw), y + 0.16 * np.sin(yaw)),
            xytext=(x, y),
            arrowprops={
                "arrowstyle": "-|>",
                "color": colour,
                "linewidth": 1.8,
                "linestyle": style,
                "shrinkA": 0,
                "shrinkB": 0,
            },
            zorder=6,
        )
        axes.plot(
            [x], [y], marker="o", color=colour, markersize=5, markeredgecolor="white",
            zorder=7,
        )  # fmt: skip
        handles.append(Line2D([], [], color=colour, linestyle=style, label=name))
    return handles


def _draw_rail(placement: BasePlacement) -> Figure:
    """Score over the position on the rail."""
    figure = new_figure(LEFT + 5.0 + 0.3, BOTTOM + 2.8 + TOP)
    axes = axes_at(figure, LEFT, BOTTOM, 5.0, 2.8)
    at, exact = placement.candidate_position[:, 0], placement.exact > 0
    known = ~np.isnan(placement.score)
    rows = np.flatnonzero(known & ~exact)
    rows = rows[np.argsort(at[rows], kind="stable")]
    axes.plot(
        at[rows],
        placement.score[rows],
        color=MUTED,
        label="bound (inverse kinematics, collisions)",
    )
    rows = np.flatnonzero(known & exact)
    axes.errorbar(
        at[rows],
        placement.score[rows],
        yerr=1.96 * placement.score_error[rows],
        fmt="o",
        color=INK,
        markersize=4,
        capsize=3,
        label="with paths (bars: 95 % intervals)",
    )
    k = placement.chosen
    axes.plot([at[k]], [placement.score[k]], "o", color=BIN_COLOUR, label="chosen")
    axes.set_xlabel(f"{placement.rail} [m]")
    axes.set_ylabel("path reachability [%]")
    axes.set_ylim(0.0, 104.0)
    grid_lines(axes)
    handles, _ = axes.get_legend_handles_labels()
    _write_text(figure, placement, handles)
    return figure


def _write_text(
    figure: Figure, placement: BasePlacement, handles: Sequence[Artist]
) -> None:
    words = base_sentences(placement)
    put_title(figure, LEFT, "Where the robot goes", words[0])
    for number, text in enumerate(words[1:]):
        line = put_text(figure, LEFT, BOTTOM - 0.68 - number * LINE, text)
        fit_width(figure, LEFT, line)
    figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(LEFT / figure.get_figwidth(), 0.06 / figure.get_figheight()),
        ncols=3,
        frameon=False,
        fontsize=7.5,
    )
