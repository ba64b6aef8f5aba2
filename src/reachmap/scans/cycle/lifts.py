"""Lifts from every configuration at which a grasp can be reached."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.core.planning.lift import Lift, Lifts
from reachmap.maps.parts import StageStatus, freeze
from reachmap.maps.records import NO_PAIR
from reachmap.runtime.job import Job, Stages, blocks
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.cycle.ways import Ways

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.scans.ik_survey import Survey

# Large enough to be solved in batches, small enough that workers end together.
LIFTS_PER_UNIT = 200
NEAREST_TO_SUCCESS = (
    StageStatus.LIFT_BLOCKED,
    StageStatus.LIFT_OUT_OF_REACH,
    StageStatus.PART_IN_COLLISION,
)
"""States without a lift, the one nearest to success first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LiftSurvey:
    """Lifts from goals.

    Attributes
    ----------
    status : uint8 array, shape (goals,)
        :class:`StageStatus`; NOT_ATTEMPTED where no path leads to the grasp.
    blocking_pair : int array, shape (goals,)
        Index into the map's ``body_pairs``, -1 where there is none.
    ways : Ways
        From the grasp to the end of the lift; empty without one.
    above_rim_m : array, shape (goals,)
        Height of the part's lowest point above the rim at its end [m]; NaN without one.
    """

    status: CodeArray
    blocking_pair: IntArray
    ways: Ways
    above_rim_m: FloatArray

    def __post_init__(self) -> None:
        freeze(self)

    @classmethod
    def join(cls, parts: Sequence[Mapping[str, Any]], dof: int) -> LiftSurvey:
        """Put payloads of lifts one after another."""
        return cls(
            status=_joined(parts, "status").astype(np.uint8),
            blocking_pair=_joined(parts, "blocking_pair").astype(np.int64),
            ways=Ways.join([part["ways"] for part in parts], dof),
            above_rim_m=_joined(parts, "above_rim"),
        )

    @classmethod
    def blank(cls, goals: int, dof: int) -> LiftSurvey:
        """No lift from any of some goals."""
        return cls(
            status=np.full(goals, StageStatus.NOT_ATTEMPTED, np.uint8),
            blocking_pair=np.full(goals, NO_PAIR, np.int64),
            ways=Ways(point=np.zeros((0, dof)), size=np.zeros(goals, np.int64)),
            above_rim_m=np.full(goals, np.nan),
        )

    def with_lifts(self, others: LiftSurvey, rows: IntArray) -> LiftSurvey:
        """The same with other lifts in place of those in some rows (m,)."""
        if not len(rows):
            return self
        status, pair = self.status.copy(), self.blocking_pair.copy()
        status[rows], pair[rows] = others.status, others.blocking_pair
        above_rim_m = self.above_rim_m.copy()
        above_rim_m[rows] = others.above_rim_m
        ways = [self.ways[k] for k in range(len(self.ways))]
        for k, row in enumerate(rows.tolist()):
            ways[row] = others.ways[k]
        dof = self.ways.point.shape[1]
        return LiftSurvey(
            status=status,
            blocking_pair=pair,
            ways=Ways.of(ways, dof),
            above_rim_m=above_rim_m,
        )

    def verdict(self, goals: IntArray) -> tuple[int, int]:
        """Status of a grasp without any lift, and the pair of bodies in the way."""
        status = self.status[goals]
        for code in NEAREST_TO_SUCCESS:
            if (status == code).any():
                pairs = self.blocking_pair[goals[status == code]]
                pairs = pairs[pairs >= 0]
                pair = int(np.bincount(pairs).argmax()) if len(pairs) else NO_PAIR
                return int(code), pair
        return int(StageStatus.NOT_ATTEMPTED), NO_PAIR


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LiftContext:
    """Context of a worker: the cell, and configurations (n, dof) at grasps."""

    loaded: LoadedCell
    body_pairs: tuple[str, ...]
    Q: FloatArray


def lift_in_stages(
    loaded: LoadedCell,
    survey: Survey,
    rows: IntArray,
    body_pairs: tuple[str, ...],
    stages: Stages,
    phase: str,
) -> LiftSurvey:
    """Lift the part from some goals of a survey."""
    context = LiftContext(loaded=loaded, body_pairs=body_pairs, Q=survey.grasps[rows])
    payloads = stages.run(
        phase,
        Job(function=lift_unit, prepare=prepare, context=context),
        [(part.start, part.stop) for part in blocks(len(rows), LIFTS_PER_UNIT)],
    )
    dof = survey.way.shape[1]
    blank = LiftSurvey.blank(len(survey.frame), dof)
    return blank.with_lifts(LiftSurvey.join(payloads, dof), rows)


def prepare(context: LiftContext) -> tuple[LiftContext, Lifts]:
    """Build the scenes, once per worker."""
    scenes = CycleScenes.of(context.loaded)
    assert scenes is not None
    return context, Lifts(scenes.lifted, scenes.carried, scenes.part)


def lift_unit(
    state: tuple[LiftContext, Lifts], block: tuple[int, int]
) -> dict[str, Any]:
    """Lift the part from one block of configurations."""
    context, lifts = state
    made = [lifts.of(q) for q in context.Q[slice(*block)]]
    return lift_payload(made, context.body_pairs, context.Q.shape[1])


def lift_payload(
    made: Sequence[Lift], body_pairs: Sequence[str], dof: int
) -> dict[str, Any]:
    """What a store keeps of some lifts."""
    number = {name: k for k, name in enumerate(body_pairs)}
    ways = Ways.of([lift.way.reshape(-1, dof) for lift in made], dof)
    return {
        "status": np.array([lift.status for lift in made], np.uint8),
        "blocking_pair": np.array(
            [number.get(lift.blocking_pair, NO_PAIR) for lift in made], np.int64
        ),
        "ways": dataclasses.asdict(ways),
        "above_rim": np.array([lift.above_rim_m for lift in made]),
    }


def _joined(parts: Sequence[Mapping[str, Any]], name: str) -> FloatArray:
    return np.concatenate([np.zeros(0), *(part[name] for part in parts)])
