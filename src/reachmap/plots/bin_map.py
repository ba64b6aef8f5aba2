"""Bin map, point by point: reachability after one and after all attempts, and costs."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from reachmap._typing import FloatArray
from reachmap.maps.records import BinMap
from reachmap.maps.summary.directions import reachability_of_directions
from reachmap.maps.summary.statistics import are_independent, attempted, found_after
from reachmap.plots.parts.bin_view import BinView, frame_bin, percent_after, view_of
from reachmap.plots.parts.squares import (
    MISSING,
    PERCENT_SCALE,
    axis_titles,
    colour_bar,
    draw_squares,
    number_size,
    whole_percent,
)
from reachmap.plots.parts.style import (
    COST_MAP,
    PercentMap,
    axes_at,
    colour_map,
    drawing,
    new_figure,
    put_title,
    subtitle_of,
)

# Lengths on paper [in]: choices of layout.
LEFT, RIGHT, TOP, BOTTOM = 0.80, 0.95, 1.05, 0.60
WIDEST, TALLEST = 6.0, 6.0


@drawing()
def draw_reachability(
    bin_map: BinMap, layer: int = 0, *, percent_map: PercentMap = "RdYlGn"
) -> Figure:
    """Reachability of each point after 1 and after all attempts (Fig. 6b).

    Parameters
    ----------
    bin_map : BinMap
    layer : int
        Index of the layer of test grasps.
    """
    repeats = bin_map.path_found.shape[-1]
    panels = [
        (_share_text(bin_map, layer, n), percent_after(bin_map, n)[layer])
        for n in ([1, repeats] if are_independent(bin_map) else [repeats])
    ]
    return _draw_row(
        bin_map, layer, panels, "Path reachability in the bin", percent_map
    )


@drawing()
def draw_directions(
    bin_map: BinMap, layer: int = 0, *, percent_map: PercentMap = "RdYlGn"
) -> Figure:
    """Reachability of frames, of directions and of points, side by side.

    Parameters
    ----------
    bin_map : BinMap
    layer : int
        Index of the layer of test grasps.
    """
    directions, points = reachability_of_directions(bin_map)
    named = (
        ("test grasps", bin_map.path_reachability),
        ("directions, with at least one roll", directions),
        ("points, with at least one direction", points),
    )
    panels = [
        (f"{name} · {_mean_text(values[layer])}", values[layer])
        for name, values in named
    ]
    title = "Path reachability of test grasps, directions and points"
    return _draw_row(bin_map, layer, panels, title, percent_map, widest=WIDEST * 0.8)


def _mean_text(values: FloatArray) -> str:
    known = values[~np.isnan(values)]
    return f"{known.mean():.2f} %" if known.size else "not attempted"


def _draw_row(
    bin_map: BinMap,
    layer: int,
    panels: Sequence[tuple[str, FloatArray]],
    title: str,
    percent_map: PercentMap,
    *,
    widest: float = WIDEST,
) -> Figure:
    """Percentages of a layer side by side, under one title and with one scale."""
    view = view_of(bin_map)
    low, high = view.view()
    scale_in = min(widest / (high[0] - low[0]), TALLEST / (high[1] - low[1]))
    width, height = (high - low) * scale_in
    figure = new_figure(
        LEFT + len(panels) * (width + 0.35) - 0.35 + RIGHT, BOTTOM + height + TOP
    )
    left = LEFT
    for column, (text, values) in enumerate(panels):
        left = LEFT + column * (width + 0.35)
        axes = axes_at(figure, left, BOTTOM, width, height)
        mesh = draw_squares(
            axes,
            bin_map.x,
            bin_map.y,
            values,
            colours=colour_map(percent_map),
            scale=PERCENT_SCALE,
            font_size=number_size(bin_map.x, bin_map.y, scale_in),
        )
        frame_bin(axes, view)
        axis_titles(axes, "the bin")
        axes.set_title(text, loc="left", pad=6)
        if column:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)
    bar = (left + width + 0.15, BOTTOM, 0.16, height)
    colour_bar(figure, mesh, bar, "Path reachability [%]")
    put_title(figure, LEFT, title, _subtitle(view, layer))
    return figure


def _share_text(bin_map: BinMap, layer: int, attempts: int) -> str:
    tried = attempted(bin_map)[layer]
    hit = int((found_after(bin_map, attempts)[layer] & tried).sum())
    total = int(tried.sum())
    share = f"{100.0 * hit / total:.2f} %" if total else "not attempted"
    word = "attempt" if attempts == 1 else "attempts"
    return f"after {attempts} {word} · {share} ({hit} of {total} test grasps)"


def _subtitle(view: BinView, layer: int) -> str:
    parts = ("seen from above", view.layer_text(layer), view.cell_name)
    return subtitle_of(parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Panel:
    title: str
    unit: str
    values: FloatArray
    digits: int
    percent: bool = False

    def text(self, value: float) -> str:
        if self.percent:
            return whole_percent(value)
        return MISSING if np.isnan(value) else f"{value:.{self.digits}f}"


@drawing()
def draw_clearance(bin_map: BinMap, layer: int = 0) -> Figure:
    """Clearance at each point [mm]: of its narrowest best path, and of the median.

    Parameters
    ----------
    bin_map : BinMap
        With margins.
    layer : int
        Index of the layer of test grasps.
    """
    if bin_map.margins is None:
        raise ValueError("the bin map has no margins")
    clearance = 1e3 * bin_map.margins.clearance[layer]
    known = ~np.isnan(clearance)
    least = np.where(known, clearance, np.inf).min(axis=-1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # points without any path
        median = np.nanmedian(clearance, axis=-1)
    panels = [
        _Panel(title=title, unit="mm", values=values, digits=1)
        for title, values in (
            ("Narrowest test grasp", np.where(known.any(axis=-1), least, np.nan)),
            ("Median test grasp", median),
        )
    ]
    view = view_of(bin_map)
    said = (
        f"smallest distance between two bodies on the path · {_subtitle(view, layer)}"
    )
    return _draw_panels(bin_map, view, panels, "Clearance", said)


@drawing()
def draw_cycle(
    bin_map: BinMap, layer: int = 0, *, percent_map: PercentMap = "RdYlGn"
) -> Figure:
    """Whole cycles at each point [percent], and their mean time [s].

    Parameters
    ----------
    bin_map : BinMap
        With a cycle.
    layer : int
        Index of the layer of test grasps.
    """
    cycle = bin_map.cycle
    if cycle is None:
        raise ValueError("the bin map has no cycles")
    seconds = _mean(cycle.cycle_time[layer])
    panels = [
        _Panel(
            title="Whole cycles",
            unit="%",
            values=cycle.reachability[layer],
            digits=1,
            percent=True,
        ),
        _Panel(title="Cycle time", unit="s", values=seconds, digits=_digits(seconds)),
    ]
    view = view_of(bin_map)
    said = f"test grasps with lift, transfer and return · {_subtitle(view, layer)}"
    title = "Whole picks in the bin"
    return _draw_panels(bin_map, view, panels, title, said, percent_map)


@drawing()
def draw_costs(
    bin_map: BinMap, cost: FloatArray | None = None, layer: int = 0
) -> Figure:
    """Path length, planning time, execution time and cost J of each point.

    A point shows the mean over its test grasps that were reached, each of which is
    the mean over its successful attempts.

    Parameters
    ----------
    bin_map : BinMap
    cost : array, shape (nl, ny, nx, no), optional
        J of each test grasp; not finite where it is not path reachable. Without it
        there are three panels.
    layer : int
        Index of the layer of test grasps.
    """
    view = view_of(bin_map)
    panels = _cost_panels(bin_map, cost, layer)
    said = f"mean over the test grasps reached at each point · {_subtitle(view, layer)}"
    return _draw_panels(bin_map, view, panels, "Cost of reaching into the bin", said)


def _draw_panels(
    bin_map: BinMap,
    view: BinView,
    panels: Sequence[_Panel],
    title: str,
    subtitle: str,
    percent_map: PercentMap = "RdYlGn",
) -> Figure:
    """Two panels a row, each with its own scale."""
    rows = -(-len(panels) // 2)
    low, high = view.view()
    scale_in = min(5.6 / (high[0] - low[0]), TALLEST / (high[1] - low[1]))
    width, height = (high - low) * scale_in
    across, down = width + 1.15, height + 0.75
    figure = new_figure(LEFT + 2 * across - 0.35, rows * down + BOTTOM + TOP - 0.75)
    for index, panel in enumerate(panels):
        row, column = divmod(index, 2)
        left, bottom = LEFT + column * across, BOTTOM + (rows - 1 - row) * down
        axes = axes_at(figure, left, bottom, width, height)
        mesh = draw_squares(
            axes,
            bin_map.x,
            bin_map.y,
            panel.values,
            colours=colour_map(percent_map if panel.percent else COST_MAP),
            scale=PERCENT_SCALE if panel.percent else _range(panel.values),
            text=panel.text,
            font_size=number_size(bin_map.x, bin_map.y, scale_in, 4),
        )
        frame_bin(axes, view)
        axis_titles(axes, "the bin")
        axes.set_title(_panel_title(panel), loc="left", pad=6)
        bar = (left + width + 0.12, bottom, 0.14, height)
        legend = colour_bar(figure, mesh, bar, "", step=None)
        legend.ax.set_title(panel.unit, fontsize=8.5, pad=6)
        if column:
            axes.set_ylabel("")
        if index + 2 < len(panels):
            axes.set_xlabel("")
    put_title(figure, LEFT, title, subtitle)
    return figure


def _cost_panels(bin_map: BinMap, cost: FloatArray | None, layer: int) -> list[_Panel]:
    name, attempts = "Planning time (CPU)", bin_map.planning_cpu_time
    if bin_map.effort is not None:
        name, seconds = "Planning effort", bin_map.effort.seconds_per_check
        checks = np.where(bin_map.path_found == 1, bin_map.effort.checks, np.nan)
        attempts = checks * seconds
    planning = _point_means(attempts[layer])
    milliseconds = bool(np.nanmax(planning, initial=0.0) < 1.0)
    planning = planning * 1000.0 if milliseconds else planning
    named = [
        ("Path length", "rad", _point_means(bin_map.path_length[layer])),
        (name, "ms" if milliseconds else "s", planning),
        ("Execution time", "s", _point_means(bin_map.execution_time[layer])),
    ]
    if cost is not None:
        named.append(
            (
                "Cost J",
                "",
                _mean(np.where(np.isfinite(cost[layer]), cost[layer], np.nan)),
            )
        )
    return [
        _Panel(title=title, unit=unit, values=values, digits=_digits(values))
        for title, unit, values in named
    ]


def _panel_title(panel: _Panel) -> str:
    if np.isnan(panel.values).all():
        return f"{panel.title} · nothing reached"
    mean = float(np.nanmean(panel.values))
    unit = f" {panel.unit}" if panel.unit else ""
    return f"{panel.title} · mean {mean:.{panel.digits}f}{unit}"


def _point_means(values: FloatArray) -> FloatArray:
    """Mean over attempts, then over orientations: (ny, nx, no, nr) to (ny, nx)."""
    return _mean(_mean(values))


def _mean(values: FloatArray) -> FloatArray:
    """Mean along the last axis over what is not NaN; NaN where nothing is."""
    known = ~np.isnan(values)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            np.where(known, values, 0.0).sum(axis=-1) / known.sum(axis=-1)
        )


def _digits(values: FloatArray) -> int:
    """Decimals that leave three significant digits of the largest."""
    top = float(np.nanmax(values, initial=0.0))
    return 0 if top >= 100.0 else 1 if top >= 10.0 else 2


def _range(values: FloatArray) -> Normalize:
    if np.isnan(values).all():
        return Normalize(0.0, 1.0)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return Normalize(low, high if high > low else low + 1.0)
