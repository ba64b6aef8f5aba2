"""Where units run: this process, processes of this machine, or any executor.

Each process is an executor of its own, so that one that dies takes nobody else's
work along, and it is certain which unit it was on.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from typing import Any, ParamSpec, TypeVar

from reachmap.runtime.job import Ticket, forget
from reachmap.runtime.options import RunOptions, available_cores, worker_count
from reachmap.runtime.pool import Pool, Slot

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
UNITS_PER_WORKER = 4  # in flight, where others share them out

log = logging.getLogger(__name__)

P = ParamSpec("P")
R = TypeVar("R")


@contextmanager
def open_pool(options: RunOptions) -> Iterator[Pool]:
    """Make the workers that the options ask for; they start with their first unit.

    Raises
    ------
    SettingsError
        There is no such Dask cluster.
    MissingExtraError
        Dask is not installed.
    """
    with _workers_import_no_script(), _one_thread_each():
        if not isinstance(options.executor, str):
            slot = _ExecutorSlot(options.executor, options.workers)
            with Pool(lambda units, most: (slot,)) as pool:
                yield pool
        elif options.executor != "processes":
            from reachmap.runtime.cluster import open_slot

            with open_slot(options) as cluster, Pool(lambda *_: (cluster,)) as pool:
                yield pool
        else:
            with Pool(_ProcessSlots(options.workers)) as pool:
                yield pool


class InProcess(Executor):
    """Runs each task immediately in this process; for ``-j 1``, debugging, coverage."""

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
        # Ended by a closed terminal, multiprocessing's own helper would be started
        # again, and print a traceback for each resource that it does not know.
        with _blocked(signal.SIGHUP):
            resource_tracker.ensure_running()
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

    def submit(
        self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs
    ) -> Future[R]:
        """Queue a task; a worker that is started for it hears no Ctrl-C as yet."""
        with _blocked(signal.SIGINT):
            return super().submit(fn, *args, **kwargs)

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


class InProcessSlot(Slot):
    """The slot of ``-j 1``."""

    is_wide = False
    is_here = True

    def __init__(self) -> None:
        super().__init__(InProcess)
        self._keys: set[str] = set()

    def ticket(self, ticket: Ticket) -> Ticket:
        """Return the ticket with its job, which jobs within may have pushed out."""
        self._keys.add(ticket.key)
        return ticket

    def stop(self, executor: Executor) -> None:
        """Drop what was built; the process lives on."""
        for key in self._keys:
            forget(key)


class _ProcessSlot(Slot):
    """A process of this machine."""

    is_wide = False

    def __init__(self) -> None:
        super().__init__(WorkerProcess)

    def ticket(self, ticket: Ticket) -> Ticket:
        """Return the ticket without its job, which the worker has by now."""
        return ticket.without_job()

    def stop(self, executor: Executor) -> None:
        """Kill the worker."""
        assert isinstance(executor, WorkerProcess)
        executor.end()


class _ProcessSlots:
    """As many processes as there is work for, kept from one job to the next."""

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._here = InProcessSlot()
        self._slots: list[Slot] = []

    def __call__(self, units: int, most: int | None) -> Sequence[Slot]:
        """Slots for a number of units; where one is wanted, it is this process."""
        if 1 in (self._workers, most):
            return [self._here]
        count = worker_count(self._workers, min(units, most or units))
        if not self._slots and self._workers > max(count, available_cores()):
            log.warning("using %d workers instead of %d", count, self._workers)
        while len(self._slots) < count:
            self._slots.append(_ProcessSlot())
        return self._slots[:count]


class _ExecutorSlot(Slot):
    """Any executor of ``concurrent.futures``."""

    def __init__(self, make: Callable[[], Executor], workers: int) -> None:
        super().__init__(make)
        self._workers = workers

    def window(self) -> int:
        """Keep its queue filled."""
        return UNITS_PER_WORKER * self._workers


@contextmanager
def _one_thread_each() -> Iterator[None]:
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


@contextmanager
def _workers_import_no_script() -> Iterator[None]:
    """Keep processes started meanwhile from importing the script that is running.

    What they call is named by module, so they have no use for it; and a script
    without ``if __name__ == "__main__":`` would start everything again in each.
    """
    namespace = vars(sys.modules["__main__"])
    names = ("__file__", "__spec__")
    hidden: dict[str, Any] = {k: namespace[k] for k in names if k in namespace}
    namespace.pop("__file__", None)
    namespace["__spec__"] = None
    try:
        yield
    finally:
        namespace.update(hidden)


@contextmanager
def _blocked(number: signal.Signals) -> Iterator[None]:
    """Block a signal here and in processes started meanwhile."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {number})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(lifeline: Connection) -> None:
    """Begin a worker: leave Ctrl-C to the parent, and do not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_leave_with, args=(lifeline,), daemon=True).start()


def _leave_with(lifeline: Connection) -> None:
    lifeline.poll(None)
    os._exit(1)
