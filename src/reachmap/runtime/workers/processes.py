"""Workers on this machine: one process per lane, or this process itself.

Each process is an executor of its own, so that one that dies takes nobody else's
work along, and it is certain which unit it was on.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, ParamSpec, TypeVar

from reachmap.runtime.workers.crew import LaneSpec
from reachmap.runtime.workers.tasks import Parcel, forget

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
WINDOW = 2  # one unit at work and one at hand

P = ParamSpec("P")
R = TypeVar("R")


class InProcess(Executor):
    """Does each task at once, in this process; for ``-j 1``, debugging, coverage."""

    def submit(
        self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs
    ) -> Future[R]:
        """Call ``fn``; the future is done when this returns."""
        future: Future[R] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class WorkerProcess(ProcessPoolExecutor):
    """A pool of one process that is stopped at once, and does not outlive this one."""

    def __init__(self) -> None:
        spawn = multiprocessing.get_context("spawn")
        # The worker holds the reading end of a pipe and leaves when the other end is
        # closed, which also happens when this process is killed.
        self._reader, self._writer = spawn.Pipe(duplex=False)
        super().__init__(
            max_workers=1,
            mp_context=spawn,
            initializer=_begin,
            # Nothing large: a worker that dies before it has read what it is started
            # with would leave this process writing for ever.
            initargs=(self._reader,),
        )

    def end(self) -> None:
        """Stop the worker, whatever it is doing."""
        self._writer.close()
        self._reader.close()
        for process in list((self._processes or {}).values()):
            process.kill()  # it has nothing to put in order
        if sys.version_info < (3, 11, 5):
            self._stop_writing()
        self.shutdown(wait=True, cancel_futures=True)

    def _stop_writing(self) -> None:
        # A task that was being written when the worker died has no reader, and the
        # pool would wait for it for ever (CPython issue 94777). Newer ones close the
        # pipe themselves; two threads must not.
        queue: Any = getattr(self, "_call_queue", None)
        if queue is not None:
            queue._reader.close()


def in_process_lane(parcel: Parcel) -> LaneSpec:
    """Make the lane of ``-j 1``."""
    return LaneSpec(
        start=InProcess,
        stop=lambda executor: forget(parcel),
        parcel=parcel,
        label=parcel,
        window=lambda: 1,
        in_order=True,
    )


def process_lanes(parcel: Parcel, workers: int) -> list[LaneSpec]:
    """One lane per worker process."""
    return [
        LaneSpec(
            start=WorkerProcess,
            stop=_end,
            parcel=parcel,
            label=parcel.label(),
            window=lambda: WINDOW,
            in_order=True,
        )
        for _ in range(workers)
    ]


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Make processes started meanwhile use one thread in numeric libraries."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _end(executor: Executor) -> None:
    if isinstance(executor, WorkerProcess):
        executor.end()


def _begin(lifeline: Connection) -> None:
    """Begin a worker: leave Ctrl-C to the parent, and do not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_with, args=(lifeline,), daemon=True).start()


def _leave_with(lifeline: Connection) -> None:
    lifeline.poll(None)
    os._exit(1)
