"""Definition of the work, and the part of it that runs in a worker.

A *work* is a scan apart from where and how often it is interrupted; a *job* is what
workers must know of it. A worker keeps what it built for a job under the job's key,
so that it builds a scene once, and needs no set-up of its own before its first unit.
"""

from __future__ import annotations

import secrets
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module, metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from reachmap import __version__
from reachmap.errors import EngineError, MapFileError, ReachmapError
from reachmap.runtime.encoding import Json, encode

if TYPE_CHECKING:  # workers import this module, and have no use for HDF5
    from reachmap.maps.records import RunInfo, Status
    from reachmap.runtime.progress import Progress

KINDS: dict[str, str] = {
    "workspace_map": "reachmap.scans.workspace_results:KIND",
    "bin_map": "reachmap.scans.bin_scan:KIND",
    "study": "reachmap.studies.assembly:KIND",
}
"""Kind of scan to ``module:name`` of its :class:`Kind`; imported on use."""
ENGINES = ("numpy", "scipy", "pin", "coal", "ompl", "eaik")
# Stages of one run that a worker may be sent back to.
KEPT_JOBS = 3
# A choice: the last calls, which say where; in characters.
MAX_TRACEBACK = 4000


def unchanged(context: Any) -> Any:
    """Prepare nothing."""
    return context


def one_frame(payload: Any) -> tuple[int, int]:
    """Tally of a unit that is one frame and cannot fail."""
    return 1, 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A function to be called for many units, each from the context alone.

    Every callable is a function of a module that workers can import (the script that
    is running is none), so that it can be sent by name.

    Attributes
    ----------
    function : callable
        ``function(state, unit) -> payload``. Its result depends on nothing else. A
        payload is a nest of numbers, text and arrays; a unit whatever pickles.
    context : picklable
        What workers need to know, as text and numbers rather than models.
    prepare : callable
        ``prepare(context) -> state``, called once per worker: the scene, say.
    tally : callable
        ``tally(payload) -> (ok, frames)`` for the progress report.
    """

    function: Callable[[Any, Any], Any]
    context: Any = field(repr=False)
    prepare: Callable[[Any], Any] = unchanged
    tally: Callable[[Any], tuple[int, int]] = one_frame


class Assemble(Protocol):
    """Joins the payloads of all units into the artefact."""

    def __call__(
        self, document: Mapping[str, Json], payloads: Sequence[Any], *, run: RunInfo
    ) -> Any:
        """Build the artefact; ``payloads`` is in unit order and read lazily."""


class Write(Protocol):
    """Publishes the artefact under its final name, atomically."""

    def __call__(
        self, path: Path, artefact: Any, /, *, overwrite: bool = False
    ) -> object:
        """Write ``artefact`` to ``path``."""


class Blank(Protocol):
    """Makes the payload of a unit that has none."""

    def __call__(self, document: Mapping[str, Json], unit: int, status: Status) -> Any:
        """Payload whose every frame has ``status``: NOT_ATTEMPTED or ERROR."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A kind of scan: how payloads become an artefact.

    It is all that merging shards or looking into a store needs; everything
    particular to one scan comes from the store's ``document``.

    Attributes
    ----------
    name : str
        Key in :data:`KINDS`.
    blank, assemble, write
        See the protocols of this module.
    """

    name: str
    blank: Blank
    assemble: Assemble
    write: Write


class Stages(Protocol):
    """What has to be known before the units of a work; kept in the store, too."""

    def run(
        self, phase: str, job: Job, units: Sequence[Any], *, most: int | None = None
    ) -> list[Any]:
        """Payloads of all units of a job of its own, on at most ``most`` workers."""

    def once(
        self,
        phase: str,
        function: Callable[[Progress], Any],
        tally: Callable[[Any], tuple[int, int]] = one_frame,
    ) -> Any:
        """Payload of a single unit, computed by this process."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """What a scan computes, independent of workers and interruptions.

    Attributes
    ----------
    kind : Kind
    units : sequence
        What each unit is about; one should take some hundred milliseconds.
    job : callable
        ``job(stages) -> Job``: what to do with each, called when some are left to do;
        None where the stages have done it.
    settings : mapping
        All that determines the result, as JSON values. A store resumes only when
        every entry agrees; the names appear in the refusal ("seed 1 → 2").
    document : mapping
        What ``kind`` needs besides the payloads, as JSON values; not compared.
    frames : int
        Frames in all units together.
    """

    kind: Kind
    units: Sequence[Any]
    job: Callable[[Stages], Job | None]
    settings: Mapping[str, Json]
    document: Mapping[str, Json]
    frames: int


def kind_named(name: str, *, source: Path) -> Kind:
    """Find the kind a store names.

    Raises
    ------
    MapFileError
        When this version knows no such kind; ``source`` is the store to blame.
    """
    if name not in KINDS:
        known = ", ".join(KINDS)
        raise MapFileError(f"{source}: a journal of kind {name!r}; known: {known}")
    module, _, attribute = KINDS[name].partition(":")
    kind: Kind = getattr(import_module(module), attribute)
    return kind


def blocks(count: int, size: int) -> list[range]:
    """Cut 0 … ``count`` - 1 into ranges of at most ``size``.

    Examples
    --------
    >>> blocks(5, 2)
    [range(0, 2), range(2, 4), range(4, 5)]
    """
    return [range(k, min(k + size, count)) for k in range(0, count, size)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """How a unit went.

    ``ok`` and ``frames`` are its tally, ``wall_s`` and ``cpu_s`` the time of the
    worker's thread on it.
    """

    ok: int = 0
    frames: int = 0
    wall_s: float = 0.0
    cpu_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """Result of a unit: its payload as text, or the text of the error."""

    index: int
    text: str
    failed: bool = False
    measure: Measure = field(default_factory=Measure)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ticket:
    """A job under its key; without the job where the worker has got ready for it."""

    key: str
    packages: Mapping[str, str]
    job: Job | None = field(repr=False)

    def without_job(self) -> Ticket:
        """Return what goes with each unit."""
        return Ticket(key=self.key, packages=self.packages, job=None)


def ticket_for(job: Job) -> Ticket:
    """Ticket of a job, under a random key, with the versions of its engines."""
    return Ticket(key=secrets.token_hex(16), packages=engine_versions(), job=job)


def engine_versions() -> dict[str, str]:
    """Versions of what a result depends on, by distribution name."""
    versions = {"reachmap": __version__}
    for name in ENGINES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "absent"
    return versions


_states: OrderedDict[str, tuple[Job, Any]] = OrderedDict()
# One unit at a time per process: models and scenes are not made for threads, which
# a Dask worker may have several of. A unit of a study may have units of its own.
_busy = threading.RLock()


def get_ready(ticket: Ticket) -> None:
    """Build the state of a job ahead of its first unit."""
    with _busy:
        _prepared(ticket)


def compute(ticket: Ticket, index: int, unit: Any) -> Reply:
    """Compute one unit; an exception inside it is a reply too, with its traceback.

    Raises
    ------
    ReachmapError
        Wrong input, which every other unit would meet as well.
    """
    with _busy:
        job, state = _prepared(ticket)
        wall_s, cpu_s = time.perf_counter(), time.thread_time()
        try:
            payload = job.function(state, unit)
            text, (ok, frames), failed = encode(payload), job.tally(payload), False
        except Exception as error:
            if isinstance(error, ReachmapError) and not isinstance(error, EngineError):
                raise
            text = encode(traceback.format_exc()[-MAX_TRACEBACK:])
            ok, frames, failed = 0, 0, True
        # Units of its own may have pushed this job out.
        _states.setdefault(ticket.key, (job, state))
        measure = Measure(
            ok=ok,
            frames=frames,
            wall_s=time.perf_counter() - wall_s,
            cpu_s=time.thread_time() - cpu_s,
        )
    return Reply(index=index, text=text, failed=failed, measure=measure)


def forget(key: str) -> None:
    """Drop what was built for a job, in a process that lives on after it."""
    _states.pop(key, None)


def _prepared(ticket: Ticket) -> tuple[Job, Any]:
    if ticket.key not in _states:
        if (job := ticket.job) is None:
            raise EngineError("a worker has not received its job")
        _check_packages(ticket.packages)
        _states[ticket.key] = job, job.prepare(job.context)
        while len(_states) > KEPT_JOBS:
            _states.popitem(last=False)
    _states.move_to_end(ticket.key)
    return _states[ticket.key]


def _check_packages(wanted: Mapping[str, str]) -> None:
    here = engine_versions()
    wrong = [
        f"{name} {here.get(name)} instead of {version}"
        for name, version in wanted.items()
        if here.get(name) != version
    ]
    if wrong:
        raise EngineError(
            f"a worker has other packages ({', '.join(wrong)}), so its results would "
            "not be the same: install the same versions everywhere"
        )
