"""Predicted seconds per pick, stage by stage, and what they make an hour.

A pick over a test grasp takes the time of its cycle, which is cut into the way to the
grasp, the stages that follow and the waits; to it come the planning effort and what a
failure costs times its probability.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray
from reachmap.maps.parts import StageStatus
from reachmap.maps.records import BinMap, freeze

TO_GRASP, WAITS, PLANNING, FAILURE = "to_grasp_s", "waits_s", "planning_s", "failure_s"
NORMAL_95: Final = 1.96
"""Half width of a 95 % interval in standard errors."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CycleSeconds:
    """What picks over test grasps take.

    Attributes
    ----------
    names : tuple of str, length k
        ``to_grasp_s``, each stage with ``_s``, ``waits_s``.
    values : array, shape (points, orientations, k)
        [s]; they add up to the cycle's time. NaN without a whole cycle.
    status : uint8 array, shape (points, orientations)
        :class:`StageStatus` of the first stage that fails; that of the grasp where
        none does or none was tried.
    """

    names: tuple[str, ...]
    values: FloatArray
    status: CodeArray

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def whole(self) -> BoolArray:
        """Where there is a whole cycle, shape (points, orientations)."""
        return np.isfinite(self.values[..., 0])

    def usual_failure_s(self) -> float:
        """What a failure costs unless told: a whole cycle, the median of the map."""
        if not self.whole.any():
            return 0.0
        return float(np.median(self.values[self.whole].sum(axis=-1)))


def cycle_seconds(bin_map: BinMap, status: CodeArray) -> CycleSeconds | None:
    """Cut the cycle times of a map into their parts; None where it has none.

    Parameters
    ----------
    bin_map : BinMap
    status : uint8 array, shape (points, orientations)
        Of the grasps themselves.
    """
    cycle = bin_map.cycle
    if cycle is None:
        return None
    stages = len(cycle.stages)
    rest = cycle.cycle_time - cycle.time.sum(axis=-1)
    # The way in of the cycle is the best path; all else is waits.
    way_in = rest if bin_map.best is None else bin_map.best.execution_time
    to_grasp = np.minimum(way_in, rest)
    values = np.concatenate(
        [to_grasp[..., None], cycle.time, (rest - to_grasp)[..., None]], axis=-1
    )
    values[np.isnan(cycle.cycle_time)] = np.nan
    failed = cycle.status != StageStatus.PATH_FOUND
    first = np.take_along_axis(cycle.status, failed.argmax(axis=-1)[..., None], -1)
    lost = (
        (status == StageStatus.PATH_FOUND)
        & failed.any(axis=-1).reshape(status.shape)
    )  # fmt: skip
    return CycleSeconds(
        names=(TO_GRASP, *(f"{name}_s" for name in cycle.stages), WAITS),
        values=values.reshape(*status.shape, stages + 2),
        status=np.where(lost, first.reshape(status.shape), status),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Throughput:
    """How many picks an hour makes.

    Attributes
    ----------
    picks : int
        Picks or places that the mean is taken over.
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
        low = 3600.0 / (mean + error)
        high = 3600.0 / (mean - error) if error < mean else float("inf")
    return Throughput(
        picks=len(seconds),
        seconds=mean,
        picks_per_hour=3600.0 / mean,
        low=low,
        high=high,
    )
