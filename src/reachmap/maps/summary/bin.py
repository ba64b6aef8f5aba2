"""Summary of a bin map."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.maps.cycle.summary import CycleSummary, summarise_cycle
from reachmap.maps.records import BinMap, Status
from reachmap.maps.summary.directions import ReachedShares, reached_shares
from reachmap.maps.summary.emptying import Emptying, emptying_of
from reachmap.maps.summary.evidence import EvidenceSummary, evidence_of
from reachmap.maps.summary.reliability import Reliability, term_reliability
from reachmap.maps.summary.statistics import (
    Causes,
    Saturation,
    are_independent,
    attempted,
    causes_of,
    saturation_of,
)

# The usual safety margin, what a bin that is put down by hand is off by, and what one
# on a pallet is.
STEPS_M = (0.002, 0.005, 0.010)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearanceShare:
    """Test grasps whose best path keeps a clearance.

    Attributes
    ----------
    clearance_m : float
    frames : float
        Share of the test grasps [percent].
    """

    clearance_m: float
    frames: float


def clearance_shares(record: BinMap) -> tuple[ClearanceShare, ...]:
    """Share of test grasps by clearance of their best path; empty if unknown."""
    tried = int(attempted(record).sum())
    if record.margins is None or not tried:
        return ()
    clearance = np.nan_to_num(record.margins.clearance, nan=-1.0)
    return tuple(
        ClearanceShare(
            clearance_m=step, frames=100.0 * int((clearance >= step).sum()) / tried
        )
        for step in STEPS_M
    )


@dataclass(frozen=True, slots=True)
class MeasureDisplay:
    """Display name, unit and factor of a measured variable.

    Attributes
    ----------
    label, unit : str
    scale : float
        Units in one SI unit, in which variables are stored.
    """

    label: str
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


MEASURES: dict[str, MeasureDisplay] = {
    "path_length": MeasureDisplay("path length", "rad"),
    "path_length_planned": MeasureDisplay("planned part of it", "rad"),
    "tcp_path_length": MeasureDisplay("TCP path length", "m"),
    "planning_cpu_time": MeasureDisplay("planning time (CPU)", "ms", 1e3),
    "planning_time": MeasureDisplay("planning time (wall)", "ms", 1e3),
    "simplification_time": MeasureDisplay("simplification time", "ms", 1e3),
    "execution_time": MeasureDisplay("execution time", "s"),
    "effort_checks": MeasureDisplay("state checks", "1"),
    "approach_time": MeasureDisplay("straight approach in it", "s"),
    "retreat_time": MeasureDisplay("straight retreat after it", "s"),
    "clearance": MeasureDisplay("clearance", "mm", 1e3),
    "joint_margin": MeasureDisplay("distance to joint limits", "deg", 180.0 / np.pi),
    "smallest_singular_value": MeasureDisplay("smallest singular value", "1"),
}
"""Measured variables, as tables show them; not every map has all of them."""

MEASURED_ATTEMPTS = (
    "path_length", "path_length_planned", "tcp_path_length", "planning_cpu_time",
    "planning_time", "simplification_time", "execution_time",
)  # fmt: skip
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
class RefinementSummary:
    """What is known between the test grasps, where the roll is free.

    Attributes
    ----------
    asked : int or None
        ``bin_scan.refine`` of the cell; None where the map does not tell.
    grasps : int
        Further grasps whose verdict was found: no more than there are test grasps,
        and fewer where none is in doubt.
    reachable : int
        Those with a path in some roll.
    """

    asked: int | None
    grasps: int
    reachable: int


@dataclass(frozen=True, slots=True, kw_only=True)
class BinSummary:
    """Summary of a bin map.

    Attributes
    ----------
    grasps : int
        Test grasps that were attempted.
    reachable : int
        Those with the status path_found.
    repeats, layers, paths, time_limit_hits : int
        Attempts per test grasp, heights, stored paths, attempts that the limit on
        wall-clock time ended.
    independent : bool
        Whether the attempts are several searches of a planner, which saturate.
    saturation : Saturation
    causes : Causes
    measures : mapping of str to Spread
        By variable, see :data:`MEASURES`; margins are over test grasps.
    quadrants : tuple of QuadrantSummary
    shares : ReachedShares
        Reachability of frames, directions and points.
    reliability : mapping of str to Reliability
        By what J is made of, see :func:`term_reliability`.
    unreached : EvidenceSummary or None
        Behind ``no_path_found``; None where the map does not tell.
    emptying : Emptying or None
        Reachability by height; None with a single layer.
    clearances : tuple of ClearanceShare
        Test grasps by the clearance of their best path; empty where the map does not
        tell.
    cycle : CycleSummary or None
        What follows the grasps; None where the map does not tell.
    refinement : RefinementSummary or None
        None for a map without one.
    """

    grasps: int
    reachable: int
    repeats: int
    layers: int
    paths: int
    time_limit_hits: int
    independent: bool
    saturation: Saturation
    causes: Causes
    measures: dict[str, Spread]
    quadrants: tuple[QuadrantSummary, ...]
    shares: ReachedShares
    reliability: dict[str, Reliability]
    unreached: EvidenceSummary | None
    emptying: Emptying | None
    clearances: tuple[ClearanceShare, ...]
    cycle: CycleSummary | None
    refinement: RefinementSummary | None


def summarise_bin(record: BinMap) -> BinSummary:
    """Count attempts, causes, quadrants and measures of a bin map."""
    return BinSummary(
        grasps=int(attempted(record).sum()),
        reachable=int((record.status == Status.PATH_FOUND).sum()),
        repeats=record.path_found.shape[-1],
        layers=len(record.layer),
        paths=len(record.paths.row_size),
        time_limit_hits=int(record.hit_time_limit.sum()),
        independent=are_independent(record),
        saturation=saturation_of(record),
        causes=causes_of(record),
        measures=_measures(record),
        quadrants=tuple(_quadrant(record, name) for name in QUADRANTS),
        shares=reached_shares(record),
        reliability=term_reliability(record),
        unreached=_unreached(record),
        emptying=emptying_of(record),
        clearances=clearance_shares(record),
        cycle=summarise_cycle(record),
        refinement=_refinement(record),
    )


def _refinement(record: BinMap) -> RefinementSummary | None:
    if record.refinement is None:
        return None
    status = record.refinement.status
    cell = json.loads(record.provenance.cell_resolved_json)
    return RefinementSummary(
        asked=cell.get("bin_scan", {}).get("refine"),
        grasps=len(status),
        reachable=int((status == Status.PATH_FOUND).sum()),
    )


def _unreached(record: BinMap) -> EvidenceSummary | None:
    if record.component is None:
        return None
    # Attempts are those of the components; further ones are in the saturation.
    none = np.zeros_like(record.status)
    frames = [(record.status, record.component, none)]
    return evidence_of(frames, Status.NO_PATH_FOUND, record.components)


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
    return {
        name: spread_of(values[rows].ravel())
        for name, values in measured_values(record).items()
    }


def measured_values(record: BinMap) -> dict[str, FloatArray]:
    """Arrays behind the measures that a map has, NaN where nothing was measured."""
    values: dict[str, FloatArray] = {
        name: getattr(record, name) for name in MEASURED_ATTEMPTS
    }
    if record.effort is not None:
        found = record.path_found == 1
        values["effort_checks"] = np.where(found, record.effort.checks, np.nan)
    if record.times is not None:
        values["approach_time"] = record.times.approach
        values["retreat_time"] = record.times.retreat
    if record.margins is not None:
        for name in ("clearance", "joint_margin", "smallest_singular_value"):
            values[name] = getattr(record.margins, name)
    return values


def _quadrant(record: BinMap, name: str) -> QuadrantSummary:
    chosen = in_quadrant(record, name)
    return QuadrantSummary(
        name=name,
        saturation=saturation_of(record, chosen),
        measures=_measures(record, chosen),
    )
