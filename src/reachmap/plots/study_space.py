"""A study as a whole: every variant across its parameters, and trade-offs."""

from __future__ import annotations

import itertools

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from reachmap._typing import BoolArray, FloatArray
from reachmap.maps.study.record import LOWER_IS_BETTER, OBJECTIVES, Study
from reachmap.maps.study.words import UNIT_WORDS, changes_text
from reachmap.plots.parts.squares import PERCENT_SCALE, colour_bar
from reachmap.plots.parts.style import (
    BIN_COLOUR,
    INK,
    MUTED,
    NOT_ATTEMPTED,
    PALE,
    PercentMap,
    axes_at,
    colour_map,
    drawing,
    ink_on,
    new_figure,
    put_title,
)

LEFT, BOTTOM, HEAD, HEIGHT = 0.85, 0.75, 1.05, 3.0
AXIS_IN = 1.5
SQUARE, GAP = 0.42, 0.75
LABEL = 12
MOST_LABELS = 8


def pareto_front(values: FloatArray, known: BoolArray) -> BoolArray:
    """Rows that no other row betters in one value without being worse in another.

    Parameters
    ----------
    values : array, shape (n, k)
        More is better.
    known : bool array, shape (n,)
        Rows to be looked at.

    Examples
    --------
    >>> rows = np.array([[1.0, 3.0], [2.0, 2.0], [1.0, 2.0]])
    >>> pareto_front(rows, np.ones(3, bool)).tolist()
    [True, True, False]
    """
    front = known.copy()
    for k in np.flatnonzero(known):
        better = (values[known] >= values[k]).all(axis=1)
        better &= (values[known] > values[k]).any(axis=1)
        front[k] = not better.any()
    return front


def _oriented(study: Study, columns: list[int]) -> FloatArray:
    signs = [
        -1.0 if study.objective_names[k] in LOWER_IS_BETTER else 1.0 for k in columns
    ]
    return np.asarray(study.objective[:, columns] * signs)


@drawing()
def draw_pareto(study: Study, first: int, second: int) -> Figure:
    """Two objectives against each other, with the Pareto-optimal variants.

    Parameters
    ----------
    study : Study
    first, second : int
        Objectives across and upwards.
    """
    columns = [first, second]
    known = study.done & ~np.isnan(study.objective[:, columns]).any(axis=1)
    front = pareto_front(_oriented(study, columns), known)
    names = [study.objective_names[k] for k in columns]
    figure = new_figure(LEFT + 4.4 + 0.35, BOTTOM + 3.6 + HEAD)
    axes = axes_at(figure, LEFT, BOTTOM, 4.4, 3.6)
    x, y = study.objective[:, first], study.objective[:, second]
    rest = known & ~front & (study.feasible > 0)
    unmet = known & ~front & (study.feasible == 0)
    axes.plot(x[rest], y[rest], "o", color=MUTED, markersize=4, label="variants")
    if unmet.any():
        axes.plot(x[unmet], y[unmet], "x", color=MUTED, label="violates a requirement")
    order = np.flatnonzero(front)[np.argsort(x[front], kind="stable")]
    axes.plot(x[order], y[order], "-o", color=BIN_COLOUR, label="Pareto front")
    if study.base >= 0 and known[study.base]:
        axes.plot(
            [x[study.base]], [y[study.base]], "s", color=INK, fillstyle="none",
            markersize=9, label="base",
        )  # fmt: skip
    for axis, name in ((axes.xaxis, names[0]), (axes.yaxis, names[1])):
        better = "less" if name in LOWER_IS_BETTER else "more"
        unit = UNIT_WORDS[OBJECTIVES[name]]
        axis.set_label_text(f"{name} [{unit}], {better} is better")
    axes.margins(0.08)
    axes.grid(color="#e4e4e4", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.legend(frameon=False, fontsize=7.5)
    said = f"{int(front.sum())} of {int(known.sum())} variants are Pareto-optimal"
    put_title(figure, LEFT, f"{names[0]} against {names[1]}", said)
    return figure


@drawing()
def draw_parallel(
    study: Study, objective: int, percent_map: PercentMap = "RdYlGn"
) -> Figure:
    """Every variant as a line across its parameters, coloured by an objective.

    Parameters
    ----------
    study : Study
    objective : int
    percent_map : str
    """
    name = study.objective_names[objective]
    value = study.objective[:, objective]
    known = study.done & ~np.isnan(value)
    count = len(study.parameter_names)
    width = AXIS_IN * max(count, 2)
    figure = new_figure(LEFT + width + 1.2, BOTTOM + HEIGHT + HEAD)
    axes = axes_at(figure, LEFT, BOTTOM, width, HEIGHT)
    percent = OBJECTIVES[name] == "percent"
    scale = (
        PERCENT_SCALE
        if percent
        else Normalize(float(np.nanmin(value)), float(np.nanmax(value)))
    )
    colours = colour_map(percent_map if percent else "viridis")
    low, high = study.parameter[known].min(axis=0), study.parameter[known].max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    better = -1.0 if name in LOWER_IS_BETTER else 1.0
    # The best on top.
    for row in np.flatnonzero(known)[np.argsort(better * value[known], kind="stable")]:
        heights = (study.parameter[row] - low) / span
        best = row == study.best
        axes.plot(
            range(count),
            heights,
            "-o",
            color=INK if best else colours(scale(value[row])),
            linewidth=2.6 if best else 1.2,
            markersize=4,
        )
    for k in range(count):
        axes.axvline(k, color=PALE, zorder=0)
        for end, at in ((low[k], 0.0), (high[k], 1.0)):
            axes.annotate(
                f"{end:g}", (k, at), xytext=(4, -9 if at == 0 else 5),
                textcoords="offset points", fontsize=7.0, color=MUTED,
            )  # fmt: skip
    axes.set_xticks(
        range(count), [n[-24:] for n in study.parameter_names], fontsize=7.5
    )
    axes.set_yticks([])
    axes.set_ylim(-0.12, 1.12)
    for spine in axes.spines.values():
        spine.set_visible(False)
    mesh = ScalarMappable(norm=scale, cmap=colours)
    unit = UNIT_WORDS[OBJECTIVES[name]]
    colour_bar(
        figure, mesh, (LEFT + width + 0.15, BOTTOM, 0.14, HEIGHT),
        f"{name} [{unit}]", step=20.0 if percent else None,
    )  # fmt: skip
    said = (
        "dark: the best, " + (changes_text(study, study.best) or "the base")
        if study.best >= 0
        else "no variant meets the requirements"
    )
    put_title(figure, LEFT, f"{int(known.sum())} variants, {name}", said)
    return figure


@drawing()
def draw_interactions(
    study: Study, objective: int, percent_map: PercentMap = "RdYlGn"
) -> Figure:
    """Mean of an objective over every two parameters, averaged over the rest.

    Where rows of squares have the same pattern, the two do not depend on each other.

    Parameters
    ----------
    study : Study
        A grid of three parameters or more.
    objective : int
    percent_map : str
    """
    name = study.objective_names[objective]
    unit = UNIT_WORDS[OBJECTIVES[name]]
    value = study.objective[:, objective]
    known = study.done & ~np.isnan(value)
    pairs = list(itertools.combinations(range(len(study.parameter_names)), 2))
    tables = [_pair_table(study, value, known, *pair) for pair in pairs]
    low, high = (f([f(t) for t in tables]) for f in (np.nanmin, np.nanmax))
    scale = PERCENT_SCALE if unit == "%" else Normalize(float(low), float(high))
    colours = colour_map(percent_map if unit == "%" else "viridis")
    widths = [SQUARE * t.shape[1] + GAP for t in tables]
    height = max(SQUARE * t.shape[0] for t in tables)
    figure = new_figure(LEFT + sum(widths) + 0.9, BOTTOM + height + HEAD)
    left = LEFT
    for (a, b), table, width in zip(pairs, tables, widths, strict=True):
        box = (left, BOTTOM, SQUARE * table.shape[1], SQUARE * table.shape[0])
        axes = axes_at(figure, *box)
        mesh = axes.pcolormesh(
            np.ma.masked_invalid(table), cmap=colours, norm=scale, edgecolors="white"
        )
        axes.set_facecolor(NOT_ATTEMPTED)
        for (y, x), mean in np.ndenumerate(table):
            if not np.isnan(mean):
                axes.text(
                    x + 0.5, y + 0.5, f"{mean:.0f}" if unit == "%" else f"{mean:.2f}",
                    ha="center", va="center", fontsize=6.5,
                    color=ink_on(np.array(mesh.to_rgba(np.array(mean)))),
                )  # fmt: skip
        for axis, k in ((axes.xaxis, a), (axes.yaxis, b)):
            values = np.unique(study.parameter[known, k])
            axis.set_ticks(np.arange(len(values)) + 0.5, [f"{v:g}" for v in values])
            axis.set_label_text(study.parameter_names[k][-24:], fontsize=7.5)
            axis.set_tick_params(length=0, labelsize=6.5)
        left += width
    colour_bar(
        figure, mesh, (left - GAP + 0.15, BOTTOM, 0.14, height), f"[{unit}]",
        step=20.0 if unit == "%" else None,
    )  # fmt: skip
    put_title(
        figure,
        LEFT,
        f"{name} over every two parameters",
        "means over all other parameters",
    )
    return figure


def _pair_table(
    study: Study, value: FloatArray, known: BoolArray, a: int, b: int
) -> FloatArray:
    """Means over the rest, shape (values of b, values of a); NaN: none."""
    columns = [study.parameter[:, k] for k in (a, b)]
    xs, ys = (np.unique(column[known]) for column in columns)
    table = np.full((len(ys), len(xs)), np.nan)
    for (j, y), (i, x) in itertools.product(enumerate(ys), enumerate(xs)):
        rows = known & (columns[0] == x) & (columns[1] == y)
        if rows.any():
            table[j, i] = value[rows].mean()
    return table
