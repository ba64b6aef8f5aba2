"""The bin placement from above: the bin on its level, and every place considered."""

from __future__ import annotations

import dataclasses
from collections import Counter

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from reachmap._typing import BoolArray, FloatArray
from reachmap.maps.records import BinPlacement, WorkspaceMap
from reachmap.maps.summary.upright import name_of_frame
from reachmap.plots.parts.context import CellContext, context_of, levels_of
from reachmap.plots.parts.outlines import (
    Kind,
    Outline,
    bin_outlines,
    draw_outline,
    legend_lines,
    margin_envelope,
)
from reachmap.plots.parts.squares import (
    MINUS,
    PERCENT_SCALE,
    axis_titles,
    colour_bar,
    draw_squares,
)
from reachmap.plots.parts.stack import LevelStack, height_text
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
    new_figure,
    put_text,
    put_title,
)

# Choices of layout: lengths on paper [in], and lines of text.
LEFT, RIGHT, TOP, GAP = 0.80, 0.95, 1.05, 0.75
BOTTOM = 2.25
WIDEST, TALLEST = 5.6, 6.2
LINE = 0.19
REASONS_SHOWN = 4


@drawing()
def draw_placement(
    placement: BinPlacement,
    workspace: WorkspaceMap | None = None,
    *,
    camera_view: FloatArray | None = None,
    percent_map: PercentMap = "RdYlGn",
) -> Figure:
    """Draw where the bin goes, on the map it was chosen from, and the alternatives.

    Parameters
    ----------
    placement : BinPlacement
    workspace : WorkspaceMap, optional
        The map it was chosen from; without it the bin stands on an empty level.
    camera_view : array, shape (n, 2), optional
        What the camera sees from the scan configuration on the height of the rim, in
        the level frame [m].
    percent_map : str
    """
    context = context_of(placement.provenance)
    workspace = None if workspace is None else levels_of(workspace)
    stack = _stack(placement, workspace, context)
    low, high = _view(placement, stack)
    scale_in = fit_scale(low, high, WIDEST, TALLEST)
    width, height = (high - low) * scale_in
    count = 1 if workspace is None else 2
    bottom = BOTTOM if count == 2 else BOTTOM + 0.95
    figure = new_figure(
        LEFT + count * (width + GAP) - GAP + RIGHT, bottom + height + TOP
    )
    panels = [
        axes_at(figure, LEFT + column * (width + GAP), bottom, width, height)
        for column in range(count)
    ]
    level = int(np.abs(stack.z - placement.T_level_bin()[2, 3]).argmin())
    if workspace is not None:
        # Without numbers, which would vanish under the outlines of the bins.
        draw_squares(
            panels[0],
            stack.x,
            stack.y,
            stack.values[level],
            colours=stack.colours(percent_map),
            scale=PERCENT_SCALE,
            font_size=0.0,
        )
        said = f"on the map of path reachability, level {height_text(stack, level)}"
        panels[0].set_title(said, loc="left")
    marks = _draw_candidates(panels[-1], placement, percent_map)
    panels[-1].set_title(
        "best score at each place over z and yaw; dots: with the bin", loc="left"
    )
    standing = _standing(stack, level, placement.support)
    for axes in panels:
        for outline in standing:
            draw_outline(axes, outline)
    handles = _draw_bins(panels[0], placement, context, camera_view)
    for axes in panels:
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        axes.tick_params(length=2.5)
        axis_titles(axes, name_of_frame(placement.T_base_level, placement.T_world_base))
    left = LEFT + (count - 1) * (width + GAP)
    bar = (left + width + 0.15, bottom, 0.16, height)
    colour_bar(figure, marks, bar, "Path reachability, score [%]")
    _put_legend(figure, [*handles, *legend_lines(standing)], bottom - 0.55)
    _write_text(figure, placement, left, bottom - (0.75 if count == 2 else 1.70))
    title, subtitle = placement_titles(placement)
    put_title(figure, LEFT, title, f"{subtitle} · {context.bin_name}".rstrip(" ·"))
    return figure


def placement_titles(placement: BinPlacement) -> tuple[str, str]:
    """Title and subtitle: where the bin goes, and its score."""
    x, y, z = placement.T_level_bin()[:3, 3]
    yaw = np.degrees(placement.candidate_pose[placement.chosen, 3])
    title = (
        f"Bin at x = {_length(x)}, y = {_length(y)}, z = {_length(z)} m, "
        f"yaw {round(float(yaw)) + 0:d}°"
    )
    parts = [
        f"score {placement.score[placement.chosen]:.1f} %",
        f"worst point {placement.worst_point[placement.chosen]:.0f} %",
    ]
    if placement.runner_up >= 0:
        parts.append(f"runner-up {placement.score[placement.runner_up]:.1f} %")
    if placement.paper_choice >= 0:
        score = placement.score[placement.paper_choice]
        said = "excluded" if np.isnan(score) else f"{score:.1f} %"
        parts.append(f"the paper's rule {said}")
    return title.replace("-", MINUS), " · ".join(parts)


def _length(value: float) -> str:
    return f"{round(float(value), 3) + 0.0:+.3f}"


def _stack(
    placement: BinPlacement, workspace: WorkspaceMap | None, context: CellContext
) -> LevelStack:
    if workspace is None:
        return LevelStack(
            x=_ends(placement.candidate_pose[:, 0]),
            y=_ends(placement.candidate_pose[:, 1]),
            z=placement.T_level_bin()[2:3, 3],
            values=np.full((1, 2, 2), np.nan),
            quantity="path",
            outlines=context.standing,
        )
    return LevelStack(
        x=workspace.x,
        y=workspace.y,
        z=workspace.z,
        values=workspace.path_reachability,
        quantity="path",
        outlines=context.standing,
    )


def _ends(values: FloatArray) -> FloatArray:
    """Two rising numbers that span the values."""
    low, high = float(values.min()), float(values.max())
    return np.array([low, max(high, low + 0.1)])


def _view(placement: BinPlacement, stack: LevelStack) -> tuple[FloatArray, FloatArray]:
    """Corners that hold the map, what stands there, and every place considered."""
    places = placement.candidate_pose[:, :2]
    points = [places - 0.1, places + 0.1]
    for outline in stack.outlines:
        if outline.kind == "base":
            points += [outline.polygon - 0.07, outline.polygon + 0.07]
    if not np.isnan(stack.values).all():
        points.append(stack.view())
    everything = np.concatenate(points)
    return everything.min(axis=0), everything.max(axis=0)


def _standing(stack: LevelStack, level: int, support: str | None) -> list[Outline]:
    """What is near the level, and what the bin stands on, which is called that."""
    near = stack.shown(level)
    return [
        dataclasses.replace(outline, name=f"{outline.name} (support)")
        if support and outline.name == support
        else outline
        for outline in stack.outlines
        if (support and outline.name == support) or any(o is outline for o in near)
    ]


def _draw_bins(
    axes: Axes,
    placement: BinPlacement,
    context: CellContext,
    camera_view: FloatArray | None,
) -> list[Line2D]:
    """Draw the bins and what the camera sees; return their legend."""
    outlines = _bins(placement, context)
    if camera_view is not None:
        z = float(placement.T_level_bin()[2, 3])
        outlines.append(
            Outline(
                name="camera view",
                kind="camera",
                polygon=camera_view,
                z_low_m=z,
                z_high_m=z,
            )
        )
    for outline in outlines:
        draw_outline(axes, outline)
    _draw_bin_axis(axes, placement)
    return legend_lines(outlines)


def _bins(placement: BinPlacement, context: CellContext) -> list[Outline]:
    """Outlines of the paper's choice, the runner-up and the chosen bin, in order."""
    if context.cell is None:
        return []
    spec = context.cell.bin
    outlines: list[Outline] = []
    others: tuple[tuple[int, str, Kind], ...] = (
        (placement.paper_choice, "the paper's rule", "paper"),
        (placement.runner_up, "runner-up", "runner-up"),
    )
    for index, name, kind in others:
        if index < 0 or index == placement.chosen:
            continue
        T = placement.T_level_bin(index)
        outlines.append(bin_outlines(spec, T, name=name, kind=kind)[0])
    outlines += bin_outlines(
        spec,
        placement.T_level_bin(),
        name="chosen bin (arrow: its x axis)",
    )
    pose = placement.candidate_pose[placement.chosen]
    return [*margin_envelope(spec, pose, placement.margin), *outlines]


def _draw_bin_axis(axes: Axes, placement: BinPlacement) -> None:
    """Arrow along the bin's x axis from its centre."""
    centre = placement.T_level_bin()[:2, 3]
    tip = centre + 0.10 * placement.T_level_bin()[:2, 0]
    axes.annotate(
        "",
        xy=(float(tip[0]), float(tip[1])),
        xytext=(float(centre[0]), float(centre[1])),
        arrowprops={
            "arrowstyle": "-|>",
            "color": BIN_COLOUR,
            "linewidth": 1.6,
            "shrinkA": 0,
            "shrinkB": 0,
            "path_effects": [withStroke(linewidth=3.4, foreground="white")],
        },
        zorder=5,
    )


def _draw_candidates(
    axes: Axes, placement: BinPlacement, percent_map: PercentMap
) -> PolyCollection:
    """Fill each place (x, y) with the best score over the rest of its poses.

    Places that were mapped with the bin in the scene are dots on top.
    """
    mapped = placement.exact > 0
    places, best = _best_at_places(placement, ~mapped if (~mapped).any() else mapped)
    out = best < 0.0
    colours = colour_map(percent_map)
    marks = PolyCollection(
        list(_rectangles(places[~out], _spacing(places))),
        array=best[~out],
        cmap=colours,
        norm=PERCENT_SCALE,
        edgecolors="face",
        linewidths=0.4,
        zorder=2,
    )
    axes.add_collection(marks)
    axes.plot(*places[out].T, "x", color="#8c8c8c", markersize=3.5, zorder=2)
    places, best = _best_at_places(placement, mapped & ~np.isnan(placement.score))
    axes.scatter(
        places[:, 0],
        places[:, 1],
        c=best,
        s=26,
        cmap=colours,
        norm=PERCENT_SCALE,
        edgecolors="white",
        linewidths=0.9,
        zorder=4,
    )
    x, y = placement.T_level_bin()[:2, 3]
    for colour, line in (("white", 4.5), (BIN_COLOUR, 2.2)):
        axes.plot(
            [x],
            [y],
            "o",
            color=colour,
            markeredgewidth=line,
            fillstyle="none",
            markersize=10,
            zorder=5,
        )
    return marks


def _best_at_places(
    placement: BinPlacement, rows: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Places (n, 2) of some candidates and the best score at each, -1 for none."""
    places, group = np.unique(
        placement.candidate_pose[rows, :2].round(4), axis=0, return_inverse=True
    )
    best = np.full(len(places), -1.0)
    np.maximum.at(best, group.ravel(), np.nan_to_num(placement.score[rows], nan=-1.0))
    return places, best


def _spacing(places: FloatArray) -> FloatArray:
    """Steps in x and y between places, shape (2,) [m]."""
    steps = [np.diff(np.unique(places[:, axis])) for axis in (0, 1)]
    usual = [float(np.median(step)) if step.size else 0.05 for step in steps]
    return np.clip(usual, 0.01, 0.10)


def _rectangles(centres: FloatArray, size: FloatArray) -> FloatArray:
    """Corners of rectangles around centres (n, 2), shape (n, 4, 2) [m]."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    return np.asarray(centres[:, None] + size * corners)


def _put_legend(figure: Figure, handles: list[Line2D], top: float) -> None:
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(
            (LEFT - 0.08) / figure.get_figwidth(),
            top / figure.get_figheight(),
        ),
        ncols=2,
        columnspacing=1.6,
        handlelength=2.2,
    )


def _write_text(
    figure: Figure, placement: BinPlacement, left: float, top: float
) -> None:
    """Write the margins, and why places are excluded, from (left, top)."""
    excluded = Counter(reason for reason in placement.reason if reason)
    tested = int(np.sum(placement.exact > 0))
    margins = _margins(placement)
    lines = [
        "The score stays within 5 points while the bin moves by",
        *(f"    {line}" for line in margins),
        f"{len(placement.reason)} poses considered, {tested} with the bin in the scene",
    ]
    if excluded:
        lines[-1] += f"; {excluded.total()} excluded (×):"
    lines += [
        f"    {count} {reason}" for reason, count in excluded.most_common(REASONS_SHOWN)
    ]
    for index, line in enumerate(lines):
        bottom = top - LINE * index
        colour = INK if index <= len(margins) else MUTED
        text = put_text(figure, left, bottom, line, fontsize=8.5, color=colour)
        fit_width(figure, left, text)


def _margins(placement: BinPlacement) -> list[str]:
    """Margins in words, four to a line, as ``+x 40 mm, −yaw 12°``."""
    words = []
    for direction, value in placement.margin.items():
        turned = "yaw" in direction
        size = f"{np.degrees(value):.0f}°" if turned else f"{1000.0 * value:.0f} mm"
        words.append(f"{direction} {size}".replace("-", MINUS))
    if not words:
        return ["(not measured)"]
    return [", ".join(words[i : i + 4]) for i in range(0, len(words), 4)]
