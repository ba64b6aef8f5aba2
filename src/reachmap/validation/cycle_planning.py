"""Planning whole cycles to grasps, with the part."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from reachmap._typing import CodeArray, FloatArray
from reachmap.maps.parts import freeze
from reachmap.runtime.job import Job
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress
from reachmap.runtime.run import run
from reachmap.scans.cycle.from_scratch import FreshCycles
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.measured import attempt_seed
from reachmap.validation.picks import tool_poses
from reachmap.validation.planning import PickContext

# A stage of its own in the seed: other draws than those of the ways in.
_STAGE = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CycleResults:
    """Results of planning whole cycles. One row per grasp, r attempts each.

    Attributes
    ----------
    status : uint8 array, shape (n, r)
        :class:`~reachmap.maps.parts.StageStatus`.
    seconds : array, shape (n, r)
        Time of the whole cycle [s]; NaN without one.
    """

    status: CodeArray
    seconds: FloatArray

    def __post_init__(self) -> None:
        freeze(self)

    def take(self, rows: slice) -> CycleResults:
        """Results of some of the grasps."""
        return CycleResults(status=self.status[rows], seconds=self.seconds[rows])


@dataclass(slots=True, kw_only=True, eq=False)
class _Worker:
    """A worker's context, and the cell that it planned in last."""

    context: PickContext
    cell_sha256: str = ""
    cycles: FreshCycles | None = field(default=None)

    def cycles_for(self, pick: int) -> FreshCycles:
        """Planner of the cell as a grasp finds it."""
        loaded = self.context.cell_for(pick)
        if self.cycles is None or loaded.sha256 != self.cell_sha256:
            scenes = CycleScenes.of(loaded)
            assert scenes is not None
            self.cycles, self.cell_sha256 = FreshCycles(scenes), loaded.sha256
        return self.cycles


def plan_cycles(
    context: PickContext, options: RunOptions, *, progress: Progress
) -> CycleResults | None:
    """Plan a whole cycle over every grasp; None in a cell without a part."""
    if context.loaded.cell.held() is None:
        return None
    job = Job(function=cycle_unit, prepare=prepare, context=context)
    payloads = run(job, range(len(context.picks)), options, progress)
    return CycleResults(
        status=np.concatenate([payload["status"] for payload in payloads]),
        seconds=np.concatenate([payload["seconds"] for payload in payloads]),
    )


def prepare(context: PickContext) -> _Worker:
    """What a worker keeps from grasp to grasp."""
    return _Worker(context=context)


def cycle_unit(worker: _Worker, pick: int) -> dict[str, Any]:
    """Plan all attempts at one grasp, over any of its tool poses."""
    context = worker.context
    T = tool_poses(
        context.picks,
        pick,
        rolls=context.rolls,
        approach_axis=context.loaded.cell.robot.tcp.approach_axis,
    )
    cycles = worker.cycles_for(pick)
    key = (context.seed, int(context.picks.number[pick]))
    made = [
        cycles.plan(T, attempt_seed(*key, k, _STAGE)) for k in range(context.repeats)
    ]
    return {
        "status": np.array([[cycle.status for cycle in made]], np.uint8),
        "seconds": np.array([[cycle.seconds for cycle in made]]),
    }
