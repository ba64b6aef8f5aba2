"""A study as a whole: every variant across its parameters, and trade-offs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.maps.study.record import LOWER_IS_BETTER, Study
from reachmap.maps.study.words import (
    changes_text,
    digits_of,
    no_best_text,
    unit_of,
    value_texts,
)
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
    fit_width,
    grid_lines,
    ink_on,
    new_figure,
    put_text,
    put_title,
)

# Choices of layout: lengths on paper [in], letters, labels on an axis.
LEFT, BOTTOM, HEAD, HEIGHT = 0.85, 0.75, 1.05, 3.0
AXIS_IN = 1.5
SQUARE, GAP = 0.42, 0.75
LABEL = 12
MOST_LABELS = 8
# Letters of a parameter's name; by how much of the height equal lines are apart.
NAME, ASIDE = 24, 0.025
# Points of a front that are listed, and the height of a line about one [in].
MOST_NAMED, LINE = 8, 0.17


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
    named = min(len(set(map(tuple, study.objective[front][:, columns]))), MOST_NAMED)
    bottom = BOTTOM + LINE * (named + 0.3)
    figure = new_figure(LEFT + 4.4 + 0.35, bottom + 3.6 + HEAD)
    axes = axes_at(figure, LEFT, bottom, 4.4, 3.6)
    x, y = study.objective[:, first], study.objective[:, second]
    rest = known & ~front & (study.feasible > 0)
    unmet = known & ~front & (study.feasible == 0)
    axes.plot(x[rest], y[rest], "o", color=MUTED, markersize=4, label="variants")
    if unmet.any():
        axes.plot(x[unmet], y[unmet], "x", color=MUTED, label="violates a requirement")
    order = np.flatnonzero(front)[np.argsort(x[front], kind="stable")]
    corner = "steps-post" if names[0] in LOWER_IS_BETTER else "steps-pre"
    axes.plot(x[order], y[order], color=BIN_COLOUR, drawstyle=corner, linewidth=1.2)
    axes.plot(x[order], y[order], "o", color=BIN_COLOUR, label="Pareto front")
    if study.base >= 0 and known[study.base]:
        axes.plot(
            [x[study.base]], [y[study.base]], "s", color=INK, fillstyle="none",
            markersize=9, label="base",
        )  # fmt: skip
    for axis, name in ((axes.xaxis, names[0]), (axes.yaxis, names[1])):
        better = "less" if name in LOWER_IS_BETTER else "more"
        axis.set_label_text(f"{name} [{unit_of(name)}], {better} is better")
    axes.margins(0.08)
    grid_lines(axes, "both")
    axes.set_axisbelow(True)
    axes.legend(frameon=False, fontsize=7.5)
    _name_front(figure, axes, study, columns, order)
    said = f"{int(front.sum())} of {int(known.sum())} variants are Pareto-optimal"
    put_title(figure, LEFT, f"{names[0]} against {names[1]}", said)
    return figure


def _name_front(
    figure: Figure, axes: Axes, study: Study, columns: list[int], order: IntArray
) -> None:
    """Number the points of the front, and say below what each changes."""
    places: dict[tuple[float, ...], list[int]] = {}
    for row in order.tolist():
        places.setdefault(tuple(study.objective[row, columns].tolist()), []).append(row)
    shown = [*places.items()][:MOST_NAMED]
    for number, (at, rows) in enumerate(shown, 1):
        axes.annotate(
            str(number), (at[0], at[1]), xytext=(5, 5), textcoords="offset points",
            fontsize=7.5, color=BIN_COLOUR, fontweight="bold",
        )  # fmt: skip
        same = f" (and {len(rows) - 1} more)" if len(rows) > 1 else ""
        more = len(places) - len(shown)
        rest = f"; {more} more in the table" if more and number == len(shown) else ""
        what = changes_text(study, rows[0]) or "the base"
        line = put_text(
            figure, LEFT, 0.12 + LINE * (len(shown) - number),
            f"{number}  {what}{same}{rest}", fontsize=7.5,
        )  # fmt: skip
        fit_width(figure, LEFT, line)


@drawing()
def draw_parallel(
    study: Study, objective: int, percent_map: PercentMap = "RdYlGn"
) -> Figure:
    """Every variant as a line across its parameters, to what they come to.

    Lines that would coincide lie side by side.

    Parameters
    ----------
    study : Study
    objective : int
        On the last axis; it colours the lines.
    percent_map : str
    """
    name = study.objective_names[objective]
    unit = unit_of(name)
    value = study.objective[:, objective]
    known = study.done & ~np.isnan(value)
    count = len(study.parameter_names)
    width = AXIS_IN * max(count, 2)
    figure = new_figure(LEFT + width + 1.2, BOTTOM + HEIGHT + HEAD)
    axes = axes_at(figure, LEFT, BOTTOM, width, HEIGHT)
    scale = (
        PERCENT_SCALE
        if unit == "%"
        else Normalize(float(np.nanmin(value)), float(np.nanmax(value)))
    )
    colours = colour_map(percent_map if unit == "%" else "viridis")
    _draw_lines(axes, study, objective, [colours(scale(one)) for one in value])
    axes.set_xticks(
        range(count + 1),
        [*(n[-NAME:] for n in study.parameter_names), name],
        fontsize=7.5,
    )
    axes.set_yticks([])
    axes.set_xlim(-0.15, count + 0.15)
    axes.set_ylim(-0.12, 1.12)
    for spine in axes.spines.values():
        spine.set_visible(False)
    mesh = ScalarMappable(norm=scale, cmap=colours)
    colour_bar(
        figure, mesh, (LEFT + width + 0.35, BOTTOM, 0.14, HEIGHT),
        f"{name} [{unit}]", step=20.0 if unit == "%" else None,
    )  # fmt: skip
    said = (
        "dark: the best, " + (changes_text(study, study.best) or "which is the base")
        if study.best >= 0
        else no_best_text(int(study.done.sum()), study.requirements)
    )
    put_title(figure, LEFT, f"{int(known.sum())} variants, {name}", said)
    return figure


def _draw_lines(
    axes: Axes, study: Study, objective: int, colours: Sequence[Any]
) -> None:
    """Draw the lines of :func:`draw_parallel`, the best variant's last."""
    name, value = study.objective_names[objective], study.objective[:, objective]
    known = study.done & ~np.isnan(value)
    count = len(study.parameter_names)
    table = np.column_stack([study.parameter, value])
    low, high = table[known].min(axis=0), table[known].max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    height = np.where(high > low, (table - low) / span, 0.5)
    better = -1.0 if name in LOWER_IS_BETTER else 1.0
    order = np.flatnonzero(known)[np.argsort(better * value[known], kind="stable")]
    aside = np.linspace(-ASIDE, ASIDE, len(order)) if len(order) > 1 else [0.0]
    for row, shift in zip(order.tolist(), aside, strict=True):
        best = row == study.best
        axes.plot(
            range(count + 1),
            height[row] + np.append(np.full(count, shift), 0.0),
            "-o",
            color=INK if best else colours[row],
            linewidth=2.6 if best else 1.2,
            markersize=3,
            zorder=4 if best else 2,
        )
    _label_axes(axes, study, order, height)
    unit, digits = unit_of(name), digits_of(name)
    for at, end in {
        float(height[row, -1]): value[row] for row in order[[0, -1]]
    }.items():
        _write_beside(axes, count, at, f"{end:.{digits}f} {unit}")


def _label_axes(
    axes: Axes, study: Study, rows: Sequence[int] | IntArray, height: FloatArray
) -> None:
    """Draw an axis for each parameter and write its values, or the ends of many."""
    for k in range(height.shape[1]):
        axes.axvline(k, color=PALE, zorder=0)
    for k in range(len(study.parameter_names)):
        places = {
            round(float(height[row, k]), 9): value_texts(study, row)[k] for row in rows
        }
        shown = sorted(places)
        if len(shown) > MOST_LABELS:
            shown = [shown[0], shown[-1]]
        for at in shown:
            _write_beside(axes, k, at, places[at][:LABEL])


def _write_beside(axes: Axes, k: int, at: float, text: str) -> None:
    axes.annotate(
        text, (k, at), xytext=(5, 5), textcoords="offset points", fontsize=7.0,
        color=INK, zorder=6,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6},
    )  # fmt: skip


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
    unit = unit_of(name)
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
            rows = [int((study.parameter[:, k] == v).argmax()) for v in values]
            texts = [value_texts(study, row)[k][:LABEL] for row in rows]
            axis.set_ticks(np.arange(len(values)) + 0.5, texts)
            axis.set_label_text(axis_title(study, k), fontsize=7.5)
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


def axis_title(study: Study, k: int) -> str:
    """Name of a parameter, its end if it is long, with its unit."""
    name, unit = study.parameter_names[k][-NAME:], study.parameter_units[k]
    return name if unit in ("", "choice") else f"{name} [{unit}]"


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
