"""Cycles over all test grasps, as payloads of units and as a section of the map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.parts import Cycle, StageStatus, freeze
from reachmap.maps.records import NO_PAIR
from reachmap.scans.cycle.planning import CyclePlan

_OF_THE_MAP = (
    "status", "blocking_pair", "time", "length", "drop_off", "cycle_time",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CycleResults:
    """Outcomes of the cycles over test grasps.

    Attributes
    ----------
    status, blocking_pair, time, length : array, shape (grasps, stages)
        As in :class:`~reachmap.maps.parts.Cycle`.
    drop_off, cycle_time : array, shape (grasps,)
    lift_above_rim : array, shape (grasps,)
        Height of the part's lowest point above the rim after the lift [m].
    """

    status: CodeArray
    blocking_pair: IntArray
    time: FloatArray
    length: FloatArray
    drop_off: IntArray
    cycle_time: FloatArray
    lift_above_rim: FloatArray

    def __post_init__(self) -> None:
        freeze(self)

    @classmethod
    def of(cls, plans: Sequence[CyclePlan]) -> CycleResults:
        """Put plans together."""
        return cls(
            status=np.array([plan.status for plan in plans], np.uint8),
            blocking_pair=np.array([plan.blocking_pair for plan in plans], np.int64),
            time=np.array([plan.time_s for plan in plans]),
            length=np.array([plan.length_rad for plan in plans]),
            drop_off=np.array([plan.drop_off for plan in plans], np.int64),
            cycle_time=np.array([plan.cycle_time_s for plan in plans]),
            lift_above_rim=np.array([plan.above_rim_m for plan in plans]),
        )

    @classmethod
    def blank(cls, grasps: int, stages: int) -> CycleResults:
        """Results of grasps without any outcome."""
        return cls(
            status=np.full((grasps, stages), StageStatus.NOT_ATTEMPTED, np.uint8),
            blocking_pair=np.full((grasps, stages), NO_PAIR, np.int64),
            time=np.full((grasps, stages), np.nan),
            length=np.full((grasps, stages), np.nan),
            drop_off=np.full(grasps, -1, np.int64),
            cycle_time=np.full(grasps, np.nan),
            lift_above_rim=np.full(grasps, np.nan),
        )

    def section(
        self, stages: Sequence[str], attempted: BoolArray, shaped: Callable[[Any], Any]
    ) -> Cycle:
        """The map's part.

        Parameters
        ----------
        stages : sequence of str
        attempted : bool array, shape (nl, ny, nx, no)
            Test grasps that count.
        shaped : callable
            Gives arrays over grasps the shape of the map.
        """
        whole = shaped((self.status == StageStatus.PATH_FOUND).all(axis=-1))
        with np.errstate(invalid="ignore"):
            percent = 100.0 * (whole & attempted).sum(-1) / attempted.sum(-1)
        return Cycle(
            stages=tuple(stages),
            **{name: shaped(getattr(self, name)) for name in _OF_THE_MAP},
            reachability=percent,
        )
