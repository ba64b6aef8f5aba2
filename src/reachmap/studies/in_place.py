"""A work computed at once, in this process, with no store: a part of a larger unit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from reachmap.runtime.encoding import decode, encode
from reachmap.runtime.job import Job, Work, one_frame
from reachmap.runtime.journal import UNITS
from reachmap.runtime.progress import Progress


class _InPlace:
    """The :class:`~reachmap.runtime.job.Stages` of such a work."""

    def __init__(self) -> None:
        self.single: dict[str, Any] = {}

    def run(
        self, phase: str, job: Job, units: Sequence[Any], *, most: int | None = None
    ) -> list[Any]:
        """Payloads of all units of a job."""
        state = job.prepare(job.context)
        # As they would come from a store, bit for bit.
        return [decode(encode(job.function(state, unit))) for unit in units]

    def once(
        self,
        phase: str,
        function: Callable[[Progress], Any],
        tally: Callable[[Any], tuple[int, int]] = one_frame,
    ) -> Any:
        """Payload of a single unit."""
        payload = decode(encode(function(Progress(phase, quiet=True))))
        self.single[phase] = payload
        return payload


def payloads_in_place(work: Work) -> list[Any]:
    """Payloads of all units, the same as those of a run with a store.

    An exception in a unit is raised as it is.
    """
    stages = _InPlace()
    job = work.job(stages)
    if job is None:
        return [stages.single[UNITS]]
    return stages.run(UNITS, job, work.units)
