"""A study: main effects, the grid of two parameters, and the maps of the best."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reachmap.maps.study.record import LOWER_IS_BETTER, Study
from reachmap.maps.study.words import (
    changes_text,
    digits_of,
    unit_of,
    value_texts,
)
from reachmap.maps.summary.study import MainEffect, main_effect
from reachmap.plots.parts.squares import (
    PERCENT_SCALE,
    cell_edges,
    colour_bar,
    draw_squares,
)
from reachmap.plots.parts.style import (
    INTERVAL_LOOK,
    MUTED,
    NOT_ATTEMPTED,
    PercentMap,
    axes_at,
    colour_map,
    drawing,
    grid_lines,
    ink_on,
    new_figure,
    put_text,
    put_title,
)

# Lengths on paper [in]: choices of layout.
PANEL, GAP, LEFT, BOTTOM, HEIGHT, HEAD = 2.6, 0.35, 0.85, 0.68, 2.6, 1.0
SQUARE = 0.75
# More labels than this would run into each other.
MOST_LABELS = 8
LABEL = 14
# Maps side by side: the inches of one and of a line above it, and how many.
TILE, TILE_LINE, TILES_ACROSS, TILES_DOWN = 1.9, 0.13, 4, 2
TILE_LINES, TILE_LETTERS = 4, 38


@drawing()
def draw_main_effects(study: Study, objective: int) -> Figure:
    """One panel per parameter: the mean over the others, with its 95 % interval.

    Parameters
    ----------
    study : Study
    objective : int
        Which objective.
    """
    name = study.objective_names[objective]
    count = len(study.parameter_names)
    effects = [main_effect(study, k, objective) for k in range(count)]
    width = LEFT + count * PANEL + (count - 1) * GAP + 0.25
    figure = new_figure(max(width, 5.2), BOTTOM + HEIGHT + HEAD)
    first: Axes | None = None
    for k, effect in enumerate(effects):
        axes = axes_at(figure, LEFT + k * (PANEL + GAP), BOTTOM, PANEL, HEIGHT)
        _draw_effect(axes, effect, joined=study.design == "grid")
        if first is None:
            first = axes
            axes.set_ylabel(f"{name} [{unit_of(name)}]")
        else:
            axes.sharey(first)
            axes.tick_params(labelleft=False)
    said = f"{int(study.done.sum())} variants · bin {study.bin_mode}"
    put_title(figure, LEFT, f"Main effects on {name}", f"{said} · bars: 95 % intervals")
    return figure


def _draw_effect(axes: Axes, effect: MainEffect, *, joined: bool) -> None:
    choice = effect.unit == "choice"
    axes.errorbar(
        effect.values,
        effect.mean,
        yerr=np.nan_to_num([effect.mean - effect.low, effect.high - effect.mean]),
        fmt="-o" if joined and not choice else "o",
        **INTERVAL_LOOK,
    )
    if choice or len(effect.values) <= MOST_LABELS:
        axes.set_xticks(effect.values, [text[:LABEL] for text in effect.labels])
        axes.tick_params(axis="x", labelrotation=30 * (len(effect.values) > 4))
    axes.margins(x=0.12, y=0.15)
    axes.set_xlabel(_axis_title(effect))
    grid_lines(axes)
    axes.set_axisbelow(True)
    for spine in ("top", "right"):
        axes.spines[spine].set_visible(False)


@drawing()
def draw_grid(
    study: Study, objective: int, percent_map: PercentMap = "RdYlGn"
) -> Figure:
    """The objective over two parameters, a square for each variant.

    Parameters
    ----------
    study : Study
        A grid of two parameters.
    objective : int
    percent_map : str
        Colours of 0 to 100 %.
    """
    name = study.objective_names[objective]
    effects = [main_effect(study, k, objective) for k in range(2)]
    values = [np.unique(study.parameter[:, k]) for k in range(2)]
    table = np.full((len(values[1]), len(values[0])), np.nan)
    for row, place in enumerate(study.parameter):
        x, y = (int(np.searchsorted(values[k], place[k])) for k in range(2))
        table[y, x] = study.objective[row, objective]
    width, height = SQUARE * len(values[0]), SQUARE * len(values[1])
    figure = new_figure(max(1.2 + width + 1.3, 5.2), 0.75 + height + HEAD)
    axes = axes_at(figure, 1.2, 0.75, width, height)
    unit = unit_of(name)
    mesh = axes.pcolormesh(
        np.ma.masked_invalid(table),
        cmap=colour_map(percent_map if unit == "%" else "viridis"),
        vmin=0.0 if unit == "%" else None,
        vmax=100.0 if unit == "%" else None,
        edgecolors="white",
        linewidth=1.0,
    )
    axes.set_facecolor(NOT_ATTEMPTED)
    for (y, x), value in np.ndenumerate(table):
        if not np.isnan(value):
            axes.text(
                x + 0.5,
                y + 0.5,
                f"{value:.{1 if unit == '%' else 2}f}",
                ha="center",
                va="center",
                fontsize=8.0,
                color=ink_on(np.array(mesh.to_rgba(value))),
            )
    for axis, effect, ticks in zip(
        (axes.xaxis, axes.yaxis), effects, values, strict=True
    ):
        column = study.parameter_names.index(effect.parameter)
        rows = [int((study.parameter[:, column] == v).argmax()) for v in ticks]
        axis.set_ticks(
            np.arange(len(ticks)) + 0.5,
            [value_texts(study, row)[column][:LABEL] for row in rows],
        )
        axis.set_label_text(_axis_title(effect))
    axes.tick_params(length=0)
    put_title(figure, 1.2, f"{name} [{unit}]", "grey: the variant failed")
    return figure


@drawing()
def draw_best_maps(study: Study, percent_map: PercentMap = "RdYlGn") -> Figure:
    """Maps of the bin side by side: the base, and the best by the first objective.

    Parameters
    ----------
    study : Study
        With ``squares``.
    percent_map : str
        Colours of 0 to 100 %.
    """
    assert study.squares is not None
    x, y, maps = (
        study.squares.bin_x,
        study.squares.bin_y,
        study.squares.bin_square,
    )
    rows = best_rows(study)
    told = [_tile_words(study, row) for row in rows]
    head = 0.36 + TILE_LINE * max(len(changes) for _, changes in told)
    span = [float(np.ptp(cell_edges(axis))) for axis in (x, y)]
    width = min(TILE, TILE * span[0] / span[1])
    height = width * span[1] / span[0]
    columns = min(len(rows), TILES_ACROSS)
    lines = -(-len(rows) // columns)
    pitch = max(width, TILE) + GAP
    figure = new_figure(
        LEFT + columns * pitch + 0.95, 0.3 + lines * (height + head) + HEAD - 0.3
    )
    top = float(figure.get_size_inches()[1]) - HEAD + 0.2
    for place, row in enumerate(rows):
        line, column = divmod(place, columns)
        left, bottom = LEFT + column * pitch, top - (line + 1) * (height + head)
        axes = axes_at(figure, left, bottom, width, height)
        mesh = draw_squares(
            axes,
            x,
            y,
            maps[row],
            colours=colour_map(percent_map),
            scale=PERCENT_SCALE,
            font_size=min(8.0, 30.0 * width / len(x)) if len(x) <= MOST_LABELS else 0.0,
        )
        axes.set_xticks([])
        axes.set_yticks([])
        _write_above(figure, left, bottom + height, told[place])
    colour_bar(
        figure,
        mesh,
        (LEFT + columns * pitch, top - height - head, 0.12, height),
        "reached [%]",
    )
    said = "test points of the bin from above, mean over the layers"
    put_title(figure, LEFT, f"Base and best by {study.objective_names[0]}", said)
    return figure


def _write_above(
    figure: Figure, left: float, top: float, words: tuple[str, Sequence[str]]
) -> None:
    """Write a value above a map, and below it what the variant changes, in lines."""
    value, changes = words
    lines = len(changes)
    put_text(
        figure, left, top + 0.07 + TILE_LINE * lines, value, fontsize=8.0,
        fontweight="bold",
    )  # fmt: skip
    for number, text in enumerate(changes):
        bottom = top + 0.06 + TILE_LINE * (lines - 1 - number)
        put_text(figure, left, bottom, text, fontsize=6.5, color=MUTED)


def best_rows(study: Study) -> list[int]:
    """The base, then the best variants by the first objective, as many as are drawn."""
    name, value = study.objective_names[0], study.objective[:, 0]
    sign = 1.0 if name in LOWER_IS_BETTER else -1.0
    known = np.flatnonzero((study.feasible > 0) & ~np.isnan(value))
    # Of equal ones the study itself has decided.
    chosen = [known != row for row in (study.runner_up, study.best)]
    ranked = known[np.lexsort((*chosen, sign * value[known]))].tolist()
    rows = [study.base, *(row for row in ranked if row != study.base)]
    return [row for row in rows if study.done[row]][: TILES_ACROSS * TILES_DOWN]


def _tile_words(study: Study, row: int) -> tuple[str, list[str]]:
    """What a map is of: its value, and line by line what it changes."""
    name = study.objective_names[0]
    marks = [
        word
        for word, marked in (("base", study.base), ("best", study.best))
        if marked == row
    ]
    value = f"{study.objective[row, 0]:.{digits_of(name)}f} {unit_of(name)}"
    if name != "bin_reachability":
        value = f"{name} {value}"
    changes = changes_text(study, row) or study.assignment[row]
    return " · ".join([*marks, value]), _in_lines(changes.split(", "))


def _in_lines(parts: Sequence[str]) -> list[str]:
    """One part a line, the last line cut where there are too many or it is long."""
    kept = list(parts[:TILE_LINES])
    if len(parts) > TILE_LINES:
        kept[-1] += f" and {len(parts) - TILE_LINES} more"
    return [
        text if len(text) <= TILE_LETTERS else f"{text[: TILE_LETTERS - 1]}…"
        for text in kept
    ]


def _axis_title(effect: MainEffect) -> str:
    has_unit = effect.unit not in ("", "choice")
    return f"{effect.parameter} [{effect.unit}]" if has_unit else effect.parameter
