"""Computing units, and scans of them, which can be interrupted and resumed anywhere.

::

    work ──▶ open_pool ──▶ Pool.replies ──▶ Store ──▶ Results ──▶ kind.assemble/write

Payloads reach the artefact through the store only, so that one that was computed
just now and one that an earlier run left are the same bits.
"""

from __future__ import annotations

import logging
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from reachmap.disk import is_there
from reachmap.errors import EngineError, IncompleteError, NoRoomError, OutputError
from reachmap.maps import RunClock, RunInfo, check_output
from reachmap.maps.bytes.publish import Identity, announced, identity
from reachmap.runtime.encoding import decode, encode
from reachmap.runtime.executors import open_pool
from reachmap.runtime.job import Job, Measure, Reply, Work, engine_versions, one_frame
from reachmap.runtime.journal import PUBLISHED, UNITS, Header
from reachmap.runtime.options import RunOptions
from reachmap.runtime.pool import Pool
from reachmap.runtime.progress import Progress
from reachmap.runtime.results import Results, last_line
from reachmap.runtime.signals import Interrupted, StopRequest, stop_signals
from reachmap.runtime.store import Store, open_store, store_path

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    path : Path
        The artefact, or the store of a shard.
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


def run(
    job: Job, units: Sequence[Any], options: RunOptions, progress: Progress
) -> list[Any]:
    """Payloads of units, in their order; for work that needs no store.

    Raises
    ------
    EngineError
        A unit failed.
    ReachmapError, KeyboardInterrupt
        As for :func:`run_scan`.
    """
    progress.begin(len(units))
    try:
        with stop_signals() as stop, open_pool(options) as pool:
            return compute(pool, job, units, progress, stop=stop, most=len(units))
    finally:
        progress.end()


def compute(
    pool: Pool,
    job: Job,
    units: Sequence[Any],
    progress: Progress,
    *,
    most: int | None = None,
    stop: StopRequest | None = None,
    measured: Callable[[Reply], object] = lambda reply: None,
) -> list[Any]:
    """Payloads of units, in their order, on workers that are there already.

    Parameters
    ----------
    most : int, optional
        Workers to use at most; a single one is this process.
    stop : StopRequest, optional
        Is looked at now and then.
    measured : callable
        Is called with each unit as it arrives.

    Raises
    ------
    EngineError
        A unit failed.
    """
    payloads: list[Any] = [None] * len(units)
    slots = pool.slots(len(units), most)
    with closing(pool.replies(job, dict(enumerate(units)), slots)) as replies:
        for reply in replies:
            if stop is not None:
                stop.check()
            if reply is None:
                progress.tick()
                continue
            if reply.failed:
                raise _unit_failed(reply.index, decode(reply.text))
            payloads[reply.index] = decode(reply.text)
            measured(reply)
            progress.add(reply.measure.frames, reply.measure.ok)
    return payloads


def run_scan(work: Work, *, output: Path, options: RunOptions, label: str) -> Outcome:
    """Compute a work and publish its artefact, going on where an earlier run ended.

    Parameters
    ----------
    work : Work
    output : Path
        The artefact. Its store lies beside it until it is published.
    options : RunOptions
    label : str
        First word of the progress report.

    Raises
    ------
    OutputError
        When ``output`` exists, cannot be written, or another run is at it.
    MapFileError
        When the store belongs to other settings.
    IncompleteError
        When units failed (the artefact is there, but for them), or there is no room.
    Interrupted
        After Ctrl-C or SIGTERM; everything done is in the store.
    """
    clock = RunClock(workers=options.workers)
    with run_units(work, output=output, options=options, label=label, clock=clock) as (
        results,
        store,
    ):
        info = clock.finish()
        path, artefact = store.path, None
        if options.shard is None:
            path = output
            artefact = work.kind.assemble(results.document, results, run=info)
            _publish(work, artefact, output, store, options)
        resumed = store.resumed
    results.check_failures(path)
    return Outcome(
        path=path,
        artefact=artefact,
        computed=results.done - resumed,
        resumed=resumed,
        run=info,
    )


@contextmanager
def run_units(
    work: Work, *, output: Path, options: RunOptions, label: str, clock: RunClock
) -> Iterator[tuple[Results, Store]]:
    """Compute the units that are not done; the part of :func:`run_scan` before writing.

    The store stays locked for the ``with`` block, in which the artefact is to be
    published. Leaving the block normally removes the store, unless units failed or
    it is a shard's.

    Raises
    ------
    ReachmapError, Interrupted
        As for :func:`run_scan`.
    """
    path = store_path(output, options.shard)
    if options.shard is None:
        check_output(output, overwrite=options.overwrite or is_there(path))
    header = header_of(work, options.shard)
    with (
        open_store(path, header, restart=options.restart) as store,
        stop_signals() as stop,
    ):
        if options.shard is None:
            check_output(output, overwrite=options.overwrite or _is_own(store, output))
        try:
            with ExitStack() as stack:
                run = _Run(
                    store=store,
                    stop=stop,
                    options=options,
                    label=label,
                    clock=clock,
                    stack=stack,
                )
                _compute_missing(work, run)
            results = Results(work.kind, [store])
            yield results, store
        except KeyboardInterrupt:
            raise Interrupted(
                f"interrupted: {store.safe_text()}\n"
                f"to resume: {command_line().replace(' --restart', '')}"
            ) from None
        if options.shard is None and not results.failed:
            store.remove()


def header_of(work: Work, shard: tuple[int, int] | None = None) -> Header:
    """Header of the store of a work; package versions are settings too."""
    return Header(
        kind=work.kind.name,
        units=len(work.units),
        shard=shard or (1, 1),
        settings={**work.settings, "packages": engine_versions()},
        document=dict(work.document),
    )


def command_line() -> str:
    """Return the command that is running, as one could type it."""
    name = Path(sys.argv[0]).name
    program = "reachmap" if name in ("reachmap", "__main__.py") else name
    return shlex.join([program, *sys.argv[1:]])


@dataclass(kw_only=True)
class _Run:
    """A run in progress; the :class:`~reachmap.runtime.job.Stages` of its work."""

    store: Store
    stop: StopRequest
    options: RunOptions
    label: str
    clock: RunClock
    stack: ExitStack
    _pool: Pool | None = field(default=None, init=False)

    def run(
        self, phase: str, job: Job, units: Sequence[Any], *, most: int | None = None
    ) -> list[Any]:
        """Payloads of all units of a job of its own, on at most ``most`` workers."""
        self.count_earlier(phase)
        with self.clock.phase(phase):
            self.complete(phase, job, dict(enumerate(units)), len(units), most)
        for index, text in self.store.failed(phase).items():
            raise _unit_failed(index, text)
        return [self.store.payload(index, phase) for index in range(len(units))]

    def once(
        self,
        phase: str,
        function: Callable[[Progress], Any],
        tally: Callable[[Any], tuple[int, int]] = one_frame,
    ) -> Any:
        """Payload of a single unit, computed by this process."""
        if 0 not in self.store.results(phase):
            with self.clock.phase(phase):
                payload = function(self.progress(phase))
            ok, frames = tally(payload)
            measure = Measure(ok=ok, frames=frames)
            reply = Reply(index=0, text=encode(payload), measure=measure)
            self.store.put(reply, phase)
            self.store.sync()
        return self.store.payload(0, phase)

    def progress(self, phase: str) -> Progress:
        """Progress report of a phase, under the label of the work."""
        label = (
            self.label if phase == UNITS else f"{self.label} {phase.replace('_', ' ')}"
        )
        return Progress(label, quiet=self.options.quiet)

    def count_earlier(self, phase: str) -> None:
        """Add the CPU time of the units that an earlier run computed."""
        done = self.store.results(phase).values()
        self.clock.add_cpu(phase, sum(measure.cpu_s for measure in done))

    def complete(
        self,
        phase: str,
        job: Job,
        units: Mapping[int, Any],
        frames: int,
        most: int | None = None,
    ) -> None:
        """Compute those of some units that the store does not hold yet."""
        done = self.store.results(phase)
        todo = {index: unit for index, unit in units.items() if index not in done}
        progress = self.progress(phase)
        progress.begin(
            frames,
            done=sum(measure.frames for measure in done.values()),
            ok=sum(measure.ok for measure in done.values()),
        )
        try:
            if todo:
                self._compute(phase, job, todo, progress, frames // len(units), most)
        finally:
            progress.end()

    def _compute(
        self,
        phase: str,
        job: Job,
        todo: Mapping[int, Any],
        progress: Progress,
        frames: int,
        most: int | None,
    ) -> None:
        if self._pool is None:
            self._pool = self.stack.enter_context(open_pool(self.options))
        slots = self._pool.slots(len(todo), most)
        with (
            # A unit in this process is aborted; others may finish.
            nullcontext() if slots[0].is_here else self.stop.deferred(),
            closing(self._pool.replies(job, todo, slots)) as replies,
        ):
            for reply in replies:
                if reply is None:
                    self.store.sync()  # all that have arrived, in one go
                    self.stop.check()
                    progress.tick()
                    continue
                self.store.put(reply, phase)
                if not slots[0].is_here:  # where the phase counts them itself
                    self.clock.add_cpu(phase, reply.measure.cpu_s)
                if reply.failed:
                    text = decode(reply.text)
                    log.warning("unit %d failed: %s", reply.index, last_line(text))
                    log.debug("%s", text)
                progress.add(reply.measure.frames or frames, reply.measure.ok)


def _compute_missing(work: Work, run: _Run) -> None:
    own = {index: work.units[index] for index in run.store.header.own_units()}
    left = len(own) - run.store.resumed
    run.count_earlier(UNITS)
    if run.store.resumed:
        log.info("%d units were done before, %d are left", run.store.resumed, left)
    if left and (job := work.job(run)) is not None:
        with run.clock.phase(UNITS):
            run.complete(UNITS, job, own, work.frames * len(own) // len(work.units))


def _publish(
    work: Work, artefact: Any, output: Path, store: Store, options: RunOptions
) -> None:
    """Put an artefact in place; the store knows it from before the move on."""
    overwrite = options.overwrite or _is_own(store, output)
    try:
        with announced(partial(_note, store)):
            work.kind.write(output, artefact, overwrite=overwrite)
        _note(store, identity(output))
    except OutputError as error:
        resume = f"{store.safe_text()}; run the same command again to resume"
        lines = [*error.lines, resume]
        if isinstance(error, NoRoomError):
            raise IncompleteError([*lines, "free some space first"]) from error
        raise OutputError(lines) from error


def _note(store: Store, published: Identity | None) -> None:
    """Remember a file as one of this work's, before it is in its place and after."""
    number = len(store.results(PUBLISHED))
    store.put(Reply(index=number, text=encode({"is": published})), PUBLISHED)
    store.sync()


def _is_own(store: Store, output: Path) -> bool:
    """Whether what stands in the place of the output was put there by this work."""
    found = identity(output)
    notes = (store.payload(number, PUBLISHED) for number in store.results(PUBLISHED))
    return found is not None and any(note.get("is") == found for note in notes)


def _unit_failed(index: int, text: str) -> EngineError:
    return EngineError(f"unit {index} failed: {last_line(text)}")
