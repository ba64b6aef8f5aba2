"""The part of a scan that runs in a worker: any process, any machine.

A worker keeps what it built for a run under the run's key, so that it builds the
scene once, and needs no set-up of its own before its first unit.
"""

from __future__ import annotations

import os
import secrets
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

from reachmap import __version__
from reachmap.errors import EngineError, ReachmapError
from reachmap.runtime.encoding import Json, compact
from reachmap.runtime.journal.format import Measure
from reachmap.runtime.work import Work

ENGINES = ("numpy", "scipy", "pin", "coal", "ompl", "eaik")
KEPT_JOBS = 2
MAX_TRACEBACK = 4000


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What a worker must know of a work."""

    function: Callable[[Any, int], Any]
    prepare: Callable[[Any], Any]
    encode: Callable[[Any], Json]
    tally: Callable[[Any], tuple[int, int]]
    context: Any
    packages: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parcel:
    """A job under the key of its run.

    ``job`` is None when the worker has got ready for it before.
    """

    key: str
    job: Job | None = field(repr=False)

    def label(self) -> Parcel:
        """Return the parcel without its contents."""
        return Parcel(key=self.key, job=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """What came of one unit: JSON text of its result, or of what went wrong."""

    unit: int
    payload: str
    failed: bool = False
    measure: Measure = field(default_factory=Measure)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Prepared:
    job: Job
    state: Any


_prepared: OrderedDict[str, _Prepared] = OrderedDict()
# One unit at a time per process: models and scenes are not made for threads, which
# a Dask worker may have several of.
_busy = threading.Lock()


def package_versions() -> dict[str, str]:
    """Versions of what a result depends on, by distribution name."""
    versions = {"reachmap": __version__}
    for name in ENGINES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "absent"
    return versions


def parcel_from_work(work: Work) -> Parcel:
    """Pack what workers must know."""
    job = Job(
        function=work.function,
        prepare=work.prepare,
        encode=work.kind.encode,
        tally=work.tally,
        context=work.context,
        packages=package_versions(),
    )
    return Parcel(key=secrets.token_hex(16), job=job)


def get_ready(parcel: Parcel) -> int:
    """Build the state of a job ahead of its first unit; returns the process id."""
    with _busy:
        _prepared_for(parcel)
    return os.getpid()


def compute(parcel: Parcel, unit: int) -> Reply:
    """Compute one unit.

    Parameters
    ----------
    parcel : Parcel
    unit : int

    Returns
    -------
    Reply
        An exception inside the unit is a reply too, with its traceback.

    Raises
    ------
    ReachmapError
        Wrong input, which every other unit would meet as well.
    """
    with _busy:
        prepared = _prepared_for(parcel)
        wall_s, cpu_s = time.perf_counter(), time.thread_time()
        try:
            payload = prepared.job.function(prepared.state, unit)
            text = compact(prepared.job.encode(payload))
            ok, frames = prepared.job.tally(payload)
            failed = False
        except Exception as error:
            if isinstance(error, ReachmapError) and not isinstance(error, EngineError):
                raise
            text = compact(traceback.format_exc()[-MAX_TRACEBACK:])
            ok, frames, failed = 0, 0, True
        measure = Measure(
            ok=ok,
            frames=frames,
            wall_s=time.perf_counter() - wall_s,
            cpu_s=time.thread_time() - cpu_s,
        )
    return Reply(unit=unit, payload=text, failed=failed, measure=measure)


def forget(parcel: Parcel) -> None:
    """Drop what was built for a run, in a process that lives on after it."""
    _prepared.pop(parcel.key, None)


def _prepared_for(parcel: Parcel) -> _Prepared:
    if parcel.key not in _prepared:
        if (job := parcel.job) is None:
            raise EngineError("a worker was not told what to do")
        _check_packages(job.packages)
        _prepared[parcel.key] = _Prepared(job=job, state=job.prepare(job.context))
        while len(_prepared) > KEPT_JOBS:
            _prepared.popitem(last=False)
    _prepared.move_to_end(parcel.key)
    return _prepared[parcel.key]


def _check_packages(wanted: Mapping[str, str]) -> None:
    here = package_versions()
    wrong = [
        f"{name} {here[name]} instead of {version}"
        for name, version in wanted.items()
        if here.get(name) != version
    ]
    if wrong:
        raise EngineError(
            f"a worker has other packages ({', '.join(wrong)}), so its results would "
            "not be the same: install the same versions everywhere"
        )
