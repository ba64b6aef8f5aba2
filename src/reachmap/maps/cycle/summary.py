"""The cycles of a bin map in a few numbers."""

from __future__ import annotations

import contextlib
import json
from collections import Counter
from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.maps.cycle.seconds import (
    TO_GRASP,
    Throughput,
    cycle_parts,
    failing_stage,
    throughput_of_bin,
)
from reachmap.maps.parts import ABOVE_RIM_M, StageStatus
from reachmap.maps.records import BinMap, Status

SHOWN = {TO_GRASP: "way to the grasp"}
# Lifts that rise all the way differ by rounding alone.
_ROUNDING_M = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class PartSeconds:
    """One part of the cycle, over the test grasps with a whole one.

    Attributes
    ----------
    name : str
        ``way to the grasp``, a stage, or ``waits``.
    seconds : float
        Mean [s].
    share : float
        Of the mean cycle, 0 to 1.
    """

    name: str
    seconds: float
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleEnd:
    """How cycles end before the robot is back, over reached test grasps.

    Attributes
    ----------
    stage, status : str
    pair : str
        Bodies in the way, "" where none are known.
    grasps : int
    """

    stage: str
    status: str
    pair: str
    grasps: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleSummary:
    """Cycles of a bin map.

    Attributes
    ----------
    reached : int
        Test grasps with a way in.
    whole : int
        Those of them with a whole cycle.
    reachability : float
        Test grasps with a whole cycle [percent].
    seconds, least, median, most : float
        Mean, extremes and median of the cycle time [s]; NaN without a whole cycle.
    parts : tuple of PartSeconds
    ends : tuple of CycleEnd
        Most frequent first.
    lower : int
        Whole cycles whose lift ends less than 10 mm above the rim.
    lowest_m : float
        How far above the rim the lowest of these ends [m]; NaN without any.
    drop_offs : tuple of (str, int)
        Places where the part may go, as the cell names them, and whole cycles to each.
    throughput : Throughput or None
    """

    reached: int
    whole: int
    reachability: float
    seconds: float
    least: float
    median: float
    most: float
    parts: tuple[PartSeconds, ...]
    ends: tuple[CycleEnd, ...]
    lower: int
    lowest_m: float
    drop_offs: tuple[tuple[str, int], ...]
    throughput: Throughput | None

    @property
    def put_down(self) -> str:
        """Whole cycles to each of several drop-offs, "" where there is one."""
        if len(self.drop_offs) < 2:
            return ""
        return ", ".join(f"{name} {count}" for name, count in self.drop_offs)

    @property
    def lower_lifts(self) -> str:
        """How many lifts end below the usual height, "" where none does."""
        if not self.lower:
            return ""
        return (
            f"{self.lower} of {self.whole} lifts end lower than "
            f"{1e3 * ABOVE_RIM_M:.0f} mm above the rim, the lowest at "
            f"{1e3 * self.lowest_m:.1f} mm"
        )

    @property
    def sentence(self) -> str:
        """Duration of a pick in a sentence."""
        if self.throughput is None:
            return "no test grasp has a whole cycle"
        longest = max(self.parts, key=lambda part: part.seconds)
        return (
            f"a pick takes {self.seconds:.2f} s on average, most of all the "
            f"{longest.name} ({100 * longest.share:.0f} %)"
        )


def summarise_cycle(record: BinMap) -> CycleSummary | None:
    """Count cycles and add up their parts; None for a map without them."""
    cycle = record.cycle
    if cycle is None:
        return None
    whole = np.isfinite(cycle.cycle_time)
    known = cycle.cycle_time[whole]
    nan = float("nan")
    low, middle, high = np.quantile(known, (0, 0.5, 1)) if len(known) else (nan,) * 3
    attempted = int((record.status != Status.NOT_ATTEMPTED).sum())
    lower = _lower_lifts(record)
    return CycleSummary(
        reached=int((record.status == Status.PATH_FOUND).sum()),
        whole=int(whole.sum()),
        reachability=100.0 * int(whole.sum()) / attempted if attempted else nan,
        seconds=float(known.mean()) if len(known) else nan,
        least=float(low),
        median=float(middle),
        most=float(high),
        parts=_parts(record),
        ends=_ends(record),
        lower=len(lower),
        lowest_m=float(lower.min()) if len(lower) else nan,
        drop_offs=_drop_offs(record, whole),
        throughput=throughput_of_bin(record),
    )


def _lower_lifts(record: BinMap) -> FloatArray:
    """How far above the rim those lifts end that do not rise as far as others [m]."""
    if record.lift_above_rim is None:
        return np.zeros(0)
    above_m = record.lift_above_rim
    return np.asarray(above_m[above_m < ABOVE_RIM_M - _ROUNDING_M])


def _drop_offs(record: BinMap, whole: BoolArray) -> tuple[tuple[str, int], ...]:
    assert record.cycle is not None
    place = record.cycle.drop_off[whole & (record.cycle.drop_off >= 0)]
    names = drop_off_names(record, int(place.max(initial=-1)) + 1)
    counts = np.bincount(place, minlength=len(names)).tolist()
    return tuple(zip(names, counts, strict=True))


def drop_off_names(record: BinMap, least: int) -> list[str]:
    """Names of a map's drop-offs in order; numbers where its cell does not tell them.

    Parameters
    ----------
    record : BinMap
    least : int
        How many there are, if not more.
    """
    with contextlib.suppress(ValueError, TypeError, KeyError, RecursionError):
        given = json.loads(record.provenance.cell_resolved_json)["drop_off"] or []
        entries = given if isinstance(given, list) else [given]
        names = [str(entry["name"]) for entry in entries]
        if len(names) >= least:
            return names
    return [f"drop-off {k + 1}" for k in range(least)]


def _parts(record: BinMap) -> tuple[PartSeconds, ...]:
    names, seconds = cycle_parts(record)
    known = seconds[np.isfinite(seconds[..., 0])]
    if not len(known):
        return ()
    means = known.mean(axis=0)
    shares = means / max(float(means.sum()), 1e-12)
    return tuple(
        PartSeconds(
            name=SHOWN.get(name) or name.removesuffix("_s").replace("_", " "),
            seconds=mean,
            share=share,
        )
        for name, mean, share in zip(
            names, means.tolist(), shares.tolist(), strict=True
        )
        if mean > 0.0
    )


def _ends(record: BinMap) -> tuple[CycleEnd, ...]:
    cycle = record.cycle
    assert cycle is not None
    stage = failing_stage(cycle)
    lost = (record.status == Status.PATH_FOUND) & (stage >= 0)
    at = (*np.nonzero(lost), stage[lost])
    counts = Counter(
        zip(
            stage[lost].tolist(),
            cycle.status[at].tolist(),
            cycle.blocking_pair[at].tolist(),
            strict=True,
        )
    )
    return tuple(
        CycleEnd(
            stage=cycle.stages[number],
            status=StageStatus(status).name.lower().replace("_", " "),
            pair=record.body_pairs[pair] if pair >= 0 else "",
            grasps=grasps,
        )
        for (number, status, pair), grasps in counts.most_common()
    )
