"""A bin map in a few numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.maps.records import BinMap, Status
from reachmap.maps.summary.statistics import (
    Causes,
    Saturation,
    attempted,
    causes_of,
    saturation_of,
)


@dataclass(frozen=True, slots=True)
class Shown:
    """How a measured variable is shown to people.

    Attributes
    ----------
    words, unit : str
    scale : float
        Units in one SI unit, in which variables are stored.
    """

    words: str
    unit: str
    scale: float = 1.0

    def of(self, spread: Spread) -> Spread:
        """Turn a measure from SI units into the unit shown."""
        return Spread(
            count=spread.count,
            mean=self.scale * spread.mean,
            std=self.scale * spread.std,
            low=self.scale * spread.low,
            median=self.scale * spread.median,
            high=self.scale * spread.high,
        )


MEASURES: dict[str, Shown] = {
    "path_length": Shown("path length", "rad"),
    "path_length_planned": Shown("planned part of it", "rad"),
    "tcp_path_length": Shown("TCP path length", "m"),
    "planning_cpu_time": Shown("planning time (CPU)", "ms", 1e3),
    "planning_time": Shown("planning time (wall)", "ms", 1e3),
    "simplification_time": Shown("simplification time", "ms", 1e3),
    "execution_time": Shown("execution time", "s"),
}
"""Measured variables, as tables show them."""

QUADRANTS = ("NE", "NW", "SE", "SW")


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """A measure over the attempts that found a path; NaN without any.

    Attributes
    ----------
    count : int
        Attempts.
    mean, std, low, median, high : float
        ``std`` is that of the sample; ``low`` and ``high`` are the extremes.
    """

    count: int
    mean: float
    std: float
    low: float
    median: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class QuadrantSummary:
    """One quadrant of the bin: N is +y, E is +x of the bin frame."""

    name: str
    saturation: Saturation
    measures: dict[str, Spread]


@dataclass(frozen=True, slots=True, kw_only=True)
class BinSummary:
    """A bin map in a few numbers.

    Attributes
    ----------
    grasps : int
        Test grasps that were attempted.
    reachable : int
        Those with the status path_found.
    repeats, layers, paths, time_limit_hits : int
        Attempts per test grasp, heights, stored paths, attempts that the limit on
        wall-clock time ended.
    saturation : Saturation
    causes : Causes
    measures : mapping of str to Spread
        By variable, see :data:`MEASURES`.
    quadrants : tuple of QuadrantSummary
    """

    grasps: int
    reachable: int
    repeats: int
    layers: int
    paths: int
    time_limit_hits: int
    saturation: Saturation
    causes: Causes
    measures: dict[str, Spread]
    quadrants: tuple[QuadrantSummary, ...]


def summarise_bin(record: BinMap) -> BinSummary:
    """Count attempts, causes, quadrants and measures of a bin map."""
    return BinSummary(
        grasps=int(attempted(record).sum()),
        reachable=int((record.status == Status.PATH_FOUND).sum()),
        repeats=record.path_found.shape[-1],
        layers=len(record.layer),
        paths=len(record.paths.row_size),
        time_limit_hits=int(record.hit_time_limit.sum()),
        saturation=saturation_of(record),
        causes=causes_of(record),
        measures=_measures(record),
        quadrants=tuple(_quadrant(record, name) for name in QUADRANTS),
    )


def in_quadrant(record: BinMap, name: str) -> BoolArray:
    """Test grasps of a quadrant, shape (nl, ny, nx, no).

    A point in the middle of the bin belongs to the north and to the east.
    """
    y = record.y >= 0 if name[0] == "N" else record.y < 0
    x = record.x >= 0 if name[1] == "E" else record.x < 0
    inside = y[None, :, None, None] & x[None, None, :, None]
    return np.broadcast_to(inside, record.status.shape)


def spread_of(values: FloatArray) -> Spread:
    """Mean and spread of numbers, NaN left out."""
    known = values[~np.isnan(values)]
    if len(known) == 0:
        nan = float("nan")
        return Spread(count=0, mean=nan, std=nan, low=nan, median=nan, high=nan)
    return Spread(
        count=len(known),
        mean=float(known.mean()),
        std=float(known.std(ddof=1)) if len(known) > 1 else 0.0,
        low=float(known.min()),
        median=float(np.median(known)),
        high=float(known.max()),
    )


def _measures(record: BinMap, chosen: BoolArray | None = None) -> dict[str, Spread]:
    rows = slice(None) if chosen is None else chosen
    return {name: spread_of(getattr(record, name)[rows].ravel()) for name in MEASURES}


def _quadrant(record: BinMap, name: str) -> QuadrantSummary:
    chosen = in_quadrant(record, name)
    return QuadrantSummary(
        name=name,
        saturation=saturation_of(record, chosen),
        measures=_measures(record, chosen),
    )
