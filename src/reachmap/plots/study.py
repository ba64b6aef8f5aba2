"""A study: main effects parameter by parameter, and the grid of two parameters."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reachmap.maps.study.record import OBJECTIVES, Study
from reachmap.maps.summary.study import UNIT_WORDS, MainEffect, main_effect, value_texts
from reachmap.plots.parts.style import (
    BIN_COLOUR,
    NOT_ATTEMPTED,
    PercentMap,
    axes_at,
    colour_map,
    drawing,
    ink_on,
    new_figure,
    put_title,
)

PANEL, GAP, LEFT, BOTTOM, HEIGHT, HEAD = 2.6, 0.35, 0.85, 0.68, 2.6, 1.0
SQUARE = 0.75
# More labels than this would run into each other.
MOST_LABELS = 8
LABEL = 14


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
            axes.set_ylabel(f"{name} [{UNIT_WORDS[OBJECTIVES[name]]}]")
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
        color=BIN_COLOUR,
        linewidth=1.6,
        markersize=5,
        capsize=4,
        elinewidth=1.2,
    )
    if choice or len(effect.values) <= MOST_LABELS:
        axes.set_xticks(effect.values, [text[:LABEL] for text in effect.labels])
        axes.tick_params(axis="x", labelrotation=30 * (len(effect.values) > 4))
    axes.margins(x=0.12, y=0.15)
    axes.set_xlabel(_axis_title(effect))
    axes.grid(axis="y", color="#e4e4e4", linewidth=0.7)
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
    unit = UNIT_WORDS[OBJECTIVES[name]]
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


def _axis_title(effect: MainEffect) -> str:
    has_unit = effect.unit not in ("", "choice")
    return f"{effect.parameter} [{effect.unit}]" if has_unit else effect.parameter
