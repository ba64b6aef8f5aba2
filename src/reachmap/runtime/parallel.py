"""Parallel work that is over in seconds and needs no journal."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from contextlib import closing
from typing import Any

from reachmap.errors import EngineError
from reachmap.runtime.encoding import json_from_value, value_from_json
from reachmap.runtime.progress import Progress
from reachmap.runtime.results import last_line
from reachmap.runtime.signals import stop_signals
from reachmap.runtime.work import one_frame
from reachmap.runtime.workers.crew import Crew
from reachmap.runtime.workers.executors import open_lanes
from reachmap.runtime.workers.tasks import Job, Parcel, package_versions


def compute_units(
    function: Callable[[Any, int], Any],
    units: int,
    *,
    prepare: Callable[[Any], Any],
    context: Any,
    workers: int,
    executor: str,
    progress: Progress,
) -> list[Any]:
    """Compute ``function(prepare(context), unit)`` for all units, in unit order.

    Parameters
    ----------
    function, prepare : callable
        Module-level, see :class:`reachmap.runtime.work.Work`.
    units : int
    context : picklable
    workers, executor
        As for :func:`reachmap.runtime.run.run_scan`.
    progress : Progress

    Raises
    ------
    EngineError
        A unit failed.
    """
    job = Job(
        function=function,
        prepare=prepare,
        encode=json_from_value,
        tally=one_frame,
        context=context,
        packages=package_versions(),
    )
    parcel = Parcel(key=secrets.token_hex(16), job=job)
    payloads: list[Any] = [None] * units
    progress.begin(units)
    with (
        stop_signals() as stop,
        open_lanes(executor, min(workers, units), parcel) as lanes,
        Crew(lanes) as crew,
        closing(crew.replies(range(units))) as replies,
    ):
        for reply in replies:
            stop.check()
            if reply is None:
                progress.tick()
                continue
            content = json.loads(reply.payload)
            if reply.failed:
                raise EngineError(f"unit {reply.unit} failed: {last_line(content)}")
            payloads[reply.unit] = value_from_json(content)
            progress.add(1, 1)
    progress.end()
    return payloads
