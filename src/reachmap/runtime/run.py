"""Running a scan: journal, workers, artefact. Interrupt it anywhere, start it again.

::

    work ──▶ open_lanes ──▶ Crew.replies ──▶ Journal ──▶ Results ──▶ kind.assemble/write

Payloads reach the artefact through the journal only, so that one that was computed
just now and one that an earlier run left are the same bits.
"""

from __future__ import annotations

import json
import logging
import shlex
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reachmap.disk import is_there
from reachmap.maps import RunClock, RunInfo, check_output
from reachmap.runtime.journal.format import Header
from reachmap.runtime.journal.journal import (
    SYNC_INTERVAL_S,
    Journal,
    journal_path,
    open_journal,
)
from reachmap.runtime.progress import Progress
from reachmap.runtime.results import Results, last_line
from reachmap.runtime.signals import Interrupted, StopRequest, stop_signals
from reachmap.runtime.work import Work
from reachmap.runtime.workers.crew import Crew
from reachmap.runtime.workers.executors import (
    ExecutorChoice,
    check_executor,
    open_lanes,
)
from reachmap.runtime.workers.tasks import Reply, package_versions, parcel_from_work

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    path : Path
        The artefact, or the journal of a shard.
    artefact : object
        What was written; None for a shard.
    computed, resumed : int
        Units done now, and by earlier runs.
    run : RunInfo
    """

    path: Path
    artefact: Any
    computed: int
    resumed: int
    run: RunInfo


def run_scan(
    work: Work,
    *,
    output: Path,
    workers: int = 1,
    executor: ExecutorChoice = "processes",
    shard: tuple[int, int] | None = None,
    restart: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Outcome:
    """Compute a work and publish its artefact, going on where an earlier run ended.

    Parameters
    ----------
    work : Work
    output : Path
        The artefact. Its journal lies beside it until it is published.
    workers : int
        Processes; 1 works in this process.
    executor : str or callable
        See :mod:`reachmap.runtime.workers.executors`.
    shard : (int, int), optional
        (i, N): do the i-th of N shares, and leave the journal for ``merge``.
    restart : bool
        Discard what an earlier run left.
    overwrite : bool
        Replace ``output``; not needed when its own journal lies beside it.
    progress : Progress, optional

    Returns
    -------
    Outcome

    Raises
    ------
    OutputError
        When ``output`` exists, cannot be written, or another run is at it.
    MapFileError
        When the journal belongs to other settings.
    IncompleteError
        When units failed (the artefact is there, but for them), or there is no room.
    Interrupted
        After Ctrl-C or SIGTERM; everything done is in the journal.
    """
    journal = journal_path(output, shard)
    if shard is None:
        check_output(output, overwrite=overwrite or is_there(journal))
    clock = RunClock(workers=workers)
    with ExitStack() as stack:
        with clock.phase("units"):
            results = stack.enter_context(
                run_units(
                    work,
                    output=output,
                    workers=workers,
                    executor=executor,
                    shard=shard,
                    restart=restart,
                    progress=progress,
                )
            )
        clock.add_cpu("units", results.cpu_s)
        run = clock.finish()
        path, artefact = journal, None
        if shard is None:
            path = output
            artefact = work.kind.assemble(results.document, results, run=run)
            work.kind.write(output, artefact, overwrite=True)
    results.check_failures(path)
    return Outcome(
        path=path,
        artefact=artefact,
        computed=results.done - results.resumed,
        resumed=results.resumed,
        run=run,
    )


@contextmanager
def run_units(
    work: Work,
    *,
    output: Path,
    workers: int = 1,
    executor: ExecutorChoice = "processes",
    shard: tuple[int, int] | None = None,
    restart: bool = False,
    progress: Progress | None = None,
) -> Iterator[Results]:
    """Compute the units that are not done; the part of :func:`run_scan` before writing.

    The journal stays locked for the ``with`` block, in which the artefact is to be
    published. Leaving the block normally removes the journal, unless units failed or
    it is a shard's.

    Parameters
    ----------
    work, output, workers, executor, shard, restart, progress
        As for :func:`run_scan`.

    Yields
    ------
    Results
        Payloads of all units, of a shard's units for a shard.

    Raises
    ------
    ReachmapError, Interrupted
        As for :func:`run_scan`.
    """
    check_executor(executor)
    with (
        open_journal(
            journal_path(output, shard),
            header_of(work, shard),
            restart=restart,
            # Nobody looks at the clock while this process computes a unit.
            sync_interval_s=0.0 if _is_alone(executor, workers) else SYNC_INTERVAL_S,
        ) as journal,
        stop_signals() as stop,
    ):
        resumed = len(journal.entries.results)
        progress = progress or Progress("", quiet=True)
        try:
            _compute_missing(work, journal, workers, executor, progress, stop)
            results = Results(work.kind, [journal.entries], resumed=resumed)
            yield results
        except KeyboardInterrupt:
            raise Interrupted(_farewell(journal)) from None
        if shard is None and not results.failed:
            journal.remove()


def header_of(work: Work, shard: tuple[int, int] | None = None) -> Header:
    """First line of the journal of a work; package versions are settings too."""
    return Header(
        kind=work.kind.name,
        units=work.units,
        shard=shard or (1, 1),
        settings={**work.settings, "packages": package_versions()},
        document=work.document,
    )


def command_line() -> str:
    """Return the command that is running, as one could type it."""
    name = Path(sys.argv[0]).name
    program = "reachmap" if name in ("reachmap", "__main__.py") else name
    return shlex.join([program, *sys.argv[1:]])


def _compute_missing(
    work: Work,
    journal: Journal,
    workers: int,
    executor: ExecutorChoice,
    progress: Progress,
    stop: StopRequest,
) -> None:
    entries = journal.entries
    before = [record.measure for record in entries.results.values()]
    todo = [unit for unit in entries.header.own_units() if unit not in entries.results]
    if before:
        log.info("%d units were done before, %d are left", len(before), len(todo))
    progress.begin(
        _own_frames(work, entries.header),
        done=sum(measure.frames for measure in before),
        ok=sum(measure.ok for measure in before),
    )
    try:
        if todo:
            with (
                open_lanes(executor, workers, parcel_from_work(work)) as lanes,
                Crew(lanes) as crew,
                # A unit in this process is broken off; others are let to arrive.
                nullcontext() if _is_alone(executor, workers) else stop.deferred(),
                closing(crew.replies(todo)) as replies,
            ):
                for reply in replies:
                    if reply is None:
                        stop.check()
                        journal.sync_if_due()
                        progress.tick()
                    else:
                        _record(work, reply, journal, progress)
    finally:
        progress.end()


def _record(work: Work, reply: Reply, journal: Journal, progress: Progress) -> None:
    journal.append(
        reply.unit, reply.payload, failed=reply.failed, measure=reply.measure
    )
    if reply.failed:
        text = json.loads(reply.payload)
        log.warning("unit %d failed: %s", reply.unit, last_line(text))
        log.debug("%s", text)
    frames = reply.measure.frames or work.total_frames // work.units
    progress.add(frames, reply.measure.ok)


def _is_alone(executor: ExecutorChoice, workers: int) -> bool:
    return executor == "processes" and workers == 1


def _own_frames(work: Work, header: Header) -> int:
    return work.total_frames * len(header.own_units()) // work.units


def _farewell(journal: Journal) -> str:
    entries = journal.entries
    return (
        f"interrupted: {len(entries.results)} of {len(entries.header.own_units())} "
        f"units are safe in {journal.path}\n"
        f"to go on: {command_line().replace(' --restart', '')}"
    )
