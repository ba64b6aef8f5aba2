"""Duration of a pick by stage, and picks per hour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.maps.parts import Cycle, StageStatus
from reachmap.maps.records import BinMap

TO_GRASP, WAITS = "to_grasp_s", "waits_s"
NORMAL_95: Final = 1.96
"""Half width of a 95 % interval in standard errors."""


def cycle_parts(record: BinMap) -> tuple[tuple[str, ...], FloatArray]:
    """Split the cycle times of a map into the path to the grasp, stages and dwell.

    Parameters
    ----------
    record : BinMap
        With a cycle.

    Returns
    -------
    names : tuple of str, length k
        ``to_grasp_s``, each stage with ``_s``, ``waits_s``.
    seconds : array, shape (nl, ny, nx, no, k)
        They add up to the cycle's time; NaN without a whole cycle.
    """
    cycle = record.cycle
    assert cycle is not None
    rest = cycle.cycle_time - cycle.time.sum(axis=-1)
    # The way in of the cycle is the best path; all else is waits.
    way_in = rest if record.best is None else record.best.execution_time
    to_grasp = np.minimum(way_in, rest)
    seconds = np.concatenate(
        [to_grasp[..., None], cycle.time, (rest - to_grasp)[..., None]], axis=-1
    )
    seconds[np.isnan(cycle.cycle_time)] = np.nan
    return (TO_GRASP, *(f"{name}_s" for name in cycle.stages), WAITS), seconds


def failing_stage(cycle: Cycle) -> IntArray:
    """Stage at which each cycle ends early, -1 where it is whole.

    Returns
    -------
    int array, shape (nl, ny, nx, no)
        The first stage that was tried and failed; the first without a path where none
        was tried.
    """
    failed = cycle.status != StageStatus.PATH_FOUND
    tried = failed & (cycle.status != StageStatus.NOT_ATTEMPTED)
    first = np.where(tried.any(axis=-1), tried.argmax(axis=-1), failed.argmax(axis=-1))
    return np.where(failed.any(axis=-1), first, -1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Throughput:
    """Picks per hour, with an interval.

    Attributes
    ----------
    picks : int
        Picks, or points of the bin, that the mean is taken over.
    seconds : float
        Mean of a pick [s].
    picks_per_hour : float
    low, high : float
        Ends of a 95 % interval of the mean, if these picks are a sample of those to
        come; NaN for a single one.
    """

    picks: int
    seconds: float
    picks_per_hour: float
    low: float
    high: float


def throughput_of(seconds: FloatArray) -> Throughput | None:
    """Picks per hour of predicted seconds, shape (n,); None of none.

    Examples
    --------
    >>> round(throughput_of(np.array([9.0, 10.0, 11.0])).picks_per_hour)
    360
    """
    seconds = seconds[np.isfinite(seconds)]
    if not len(seconds):
        return None
    mean, low, high = float(seconds.mean()), float("nan"), float("nan")
    if len(seconds) > 1:
        error = NORMAL_95 * float(seconds.std(ddof=1)) / np.sqrt(len(seconds))
        low = 3600.0 / (mean + float(error))
        high = 3600.0 / (mean - float(error)) if error < mean else float("inf")
    return Throughput(
        picks=len(seconds),
        seconds=mean,
        picks_per_hour=3600.0 / mean,
        low=low,
        high=high,
    )


def throughput_of_bin(record: BinMap) -> Throughput | None:
    """Picks per hour of a bin whose every test grasp with a whole cycle is as likely.

    A pick takes its cycle, the planning effort, and the median cycle times the share
    of attempts that found no path. Orientations at one point are not independent, so
    the interval is that of the points' means.
    """
    cycle = record.cycle
    if cycle is None or not np.isfinite(cycle.cycle_time).any():
        return None
    whole = np.isfinite(cycle.cycle_time)
    missed = 1.0 - record.path_found.mean(axis=-1)
    seconds = cycle.cycle_time + missed * float(np.median(cycle.cycle_time[whole]))
    if record.best is not None and record.effort is not None:
        seconds += record.best.effort_checks * record.effort.seconds_per_check
    count = whole.sum(axis=-1)
    total = np.where(whole, seconds, 0.0).sum(axis=-1)
    return throughput_of((total[count > 0] / count[count > 0]).ravel())
