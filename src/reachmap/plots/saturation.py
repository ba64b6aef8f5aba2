"""How many test grasps are reached after one, two, … attempts, with intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import ndtri

from reachmap._typing import FloatArray, IntArray
from reachmap.maps.records import BinMap
from reachmap.plots.bin_view import attempted, found_after, view_of
from reachmap.plots.style import (
    BIN_COLOUR,
    INK,
    MUTED,
    axes_at,
    drawing,
    new_figure,
    put_title,
)


def wilson_interval(
    hits: FloatArray, total: FloatArray, confidence: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Wilson score interval of a share, as fractions.

    It keeps its coverage near 0 and 1, where the normal approximation gives
    intervals that leave [0, 1] or have no width.

    Examples
    --------
    >>> low, high = wilson_interval(np.array(0.0), np.array(10.0))
    >>> float(low), round(float(high), 4)
    (0.0, 0.2775)
    """
    z2 = float(ndtri(0.5 + confidence / 2.0)) ** 2
    share = hits / total
    middle = (share + z2 / (2.0 * total)) / (1.0 + z2 / total)
    spread = share * (1.0 - share) / total + z2 / (4.0 * total**2)
    half = np.sqrt(z2 * spread) / (1.0 + z2 / total)
    return np.maximum(middle - half, 0.0), np.minimum(middle + half, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Saturation:
    """Test grasps reached over the number of attempts, in percent.

    Attributes
    ----------
    attempts : int array, shape (nr,)
    share, low, high : array, shape (nr,)
        Share reached, and its Wilson 95 % interval.
    proved : float
        Share that an attempt or the roadmap proves reachable.
    total : int
        Number of test grasps that were tried.
    """

    attempts: IntArray
    share: FloatArray
    low: FloatArray
    high: FloatArray
    proved: float
    total: int


def saturation_of(bin_map: BinMap) -> Saturation:
    """Count what the first 1, 2, … attempts reach."""
    tried = attempted(bin_map)
    total = max(int(tried.sum()), 1)
    attempts = np.arange(1, bin_map.path_found.shape[-1] + 1)
    hits = np.array(
        [int((found_after(bin_map, int(k)) & tried).sum()) for k in attempts], float
    )
    low, high = wilson_interval(hits, np.full_like(hits, total))
    known = bin_map.connected.astype(bool) | found_after(bin_map, int(attempts[-1]))
    return Saturation(
        attempts=attempts,
        share=100.0 * hits / total,
        low=100.0 * low,
        high=100.0 * high,
        proved=100.0 * int((known & tried).sum()) / total,
        total=total,
    )


@drawing()
def draw_saturation(bin_map: BinMap) -> Figure:
    """Share of test grasps reached over the number of attempts.

    Bars are Wilson 95 % intervals. Where the roadmap proves more test grasps
    reachable than the attempts found, a line shows its share.
    """
    data = saturation_of(bin_map)
    figure = new_figure(6.4, 4.6)
    axes = axes_at(figure, 0.85, 0.62, 5.2, 3.15)
    _draw_curve(axes, data)
    if data.proved > data.share[-1]:
        _draw_proved(axes, data.proved)
    _set_limits(axes, data)
    last = int(data.attempts[-1])
    title = f"{data.share[-1]:.2f} % after {last} attempt{'s' * (last > 1)}"
    if last > 1:
        title = f"{data.share[0]:.2f} % after 1 attempt, {title}"
    cell_name = view_of(bin_map).cell_name
    said = (f"{data.total} test grasps", "bars: Wilson 95 % intervals", cell_name)
    put_title(figure, 0.85, title, " · ".join(part for part in said if part))
    return figure


def _draw_curve(axes: Axes, data: Saturation) -> None:
    axes.errorbar(
        data.attempts,
        data.share,
        yerr=[data.share - data.low, data.high - data.share],
        fmt="-o",
        color=BIN_COLOUR,
        linewidth=1.6,
        markersize=5,
        capsize=4,
        elinewidth=1.2,
    )
    for k, value, bottom in zip(data.attempts, data.share, data.low, strict=True):
        axes.annotate(
            f"{value:.2f}",
            (k, bottom),
            xytext=(3, -5),
            textcoords="offset points",
            ha="left",
            va="top",
            fontsize=8.5,
            color=INK,
        )


def _draw_proved(axes: Axes, proved: float) -> None:
    axes.axhline(proved, color=MUTED, linewidth=1.2, linestyle=(0, (5, 3)))
    axes.annotate(
        f"proved reachable by the roadmap: {proved:.2f} %",
        (0.6, proved),
        xytext=(4, 4),
        textcoords="offset points",
        fontsize=8.5,
        color=MUTED,
    )


def _set_limits(axes: Axes, data: Saturation) -> None:
    top, bottom = max(float(data.high.max()), data.proved), float(data.low.min())
    span = max(top - bottom, 1.0)
    axes.set_ylim(max(0.0, bottom - 0.25 * span), min(102.0, top + 0.22 * span))
    axes.set_xlim(0.6, int(data.attempts[-1]) + 0.6)
    axes.set_xticks(data.attempts)
    axes.set_xlabel("attempts per test grasp")
    axes.set_ylabel("test grasps reached [%]")
    axes.grid(axis="y", color="#e4e4e4", linewidth=0.7)
    axes.set_axisbelow(True)
    for spine in ("top", "right"):
        axes.spines[spine].set_visible(False)
