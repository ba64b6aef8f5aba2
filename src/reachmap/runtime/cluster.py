"""Units on a Dask cluster: a local one, or one that is already running."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager
from tempfile import TemporaryDirectory
from typing import Any

from reachmap.errors import IncompleteError, MissingExtraError, SettingsError
from reachmap.runtime.job import Ticket, compute, get_ready, unchanged
from reachmap.runtime.options import RunOptions, worker_count
from reachmap.runtime.pool import Slot

# Enough on the way that no thread waits for the network, few enough that a lost worker
# loses little.
UNITS_PER_THREAD = 4
# Choices: how often the size of the cluster is asked for, and how long a batch system
# may take to start its workers.
WINDOW_AGE_S = 5.0
WAIT_FOR_WORKERS_S = 300.0

log = logging.getLogger(__name__)


@contextmanager
def open_slot(options: RunOptions) -> Iterator[Slot]:
    """Start a cluster (``dask:local``) or find one, as the slot of a pool.

    Raises
    ------
    SettingsError
        There are no workers at the address.
    MissingExtraError
        Dask is not installed.
    """
    distributed = _distributed()
    import dask

    address = str(options.executor).removeprefix("dask:")
    with ExitStack() as stack:
        # A survey of all test grasps is large, and meant to be sent.
        threshold = {"distributed.admin.large-graph-warning-threshold": "1 GB"}
        stack.enter_context(dask.config.set(threshold))
        stack.enter_context(distributed.utils.silence_logging_cmgr(_log_level()))
        try:
            if address == "local":
                cluster = stack.enter_context(_local_cluster(options.workers))
                address = cluster.scheduler_address
            client = distributed.Client(address, set_as_default=False)
            stack.enter_context(client)
            client.wait_for_workers(1, timeout=WAIT_FOR_WORKERS_S)
        except (OSError, TimeoutError, RuntimeError) as error:
            raise SettingsError(f"no Dask workers at {address}: {error}") from error
        yield DaskSlot(client)


class DaskSlot(Slot):
    """All workers of a cluster, which replaces those that die itself."""

    def __init__(self, client: Any) -> None:
        super().__init__(lambda: DaskExecutor(client))
        self._client = client
        self._asked_s = -math.inf
        self._seen_s = time.monotonic()
        self._units = 1

    def ticket(self, ticket: Ticket) -> Ticket:
        """Return the ticket without its job, which the executor keeps."""
        return ticket.without_job()

    def stop(self, executor: Executor) -> None:
        """Forget what was submitted."""
        executor.shutdown(wait=False)

    def is_lost(self, error: BaseException) -> bool:
        """Whether the job itself has died with its workers."""
        return _is_killed(error) and not _is_of_unit(error)

    def deaths(self, error: BaseException) -> int:
        """Workers that the scheduler saw die of a unit before it gave up."""
        return int(error.allowed_failures) + 1 if _is_killed(error) else 0  # type: ignore[attr-defined]

    def window(self) -> int:
        """Keep every thread busy in a cluster that may grow, shrink and go away."""
        now = time.monotonic()
        if now - self._asked_s > WINDOW_AGE_S:
            self._asked_s = now
            self._ask(now)
        return self._units

    def _ask(self, now: float) -> None:
        try:
            threads = sum(self._client.nthreads().values())
        except (OSError, TimeoutError):
            threads = 0
        if threads:
            self._seen_s = now
            self._units = UNITS_PER_THREAD * threads
        elif now - self._seen_s > WAIT_FOR_WORKERS_S:
            raise IncompleteError(
                f"the Dask cluster has had no workers for {WAIT_FOR_WORKERS_S:.0f} s; "
                "finished work is kept; run the same command again to resume"
            )


class DaskExecutor(Executor):
    """Dask's executor, which is given a job once and then only units.

    As the result of a task the job goes to each worker once, also to those that come
    later, and it is made again when the workers that had it die.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._jobs: dict[str, Any] = {}
        # Not pure: a unit that is tried again must be computed again.
        self._executor = client.get_executor(pure=False)

    def submit(self, fn: Any, /, ticket: Ticket, *unit: Any) -> Future[Any]:  # type: ignore[override]
        """Submit a function of a job."""
        if fn is get_ready:
            self._jobs[ticket.key] = self._client.submit(unchanged, ticket, pure=False)
        future: Future[Any] = self._executor.submit(fn, self._jobs[ticket.key], *unit)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Forget what was submitted, unless it is to be waited for."""
        self._executor.shutdown(wait=wait)


@contextmanager
def _local_cluster(workers: int) -> Iterator[Any]:
    """Start a cluster of this machine that leaves judging dead workers to the pool."""
    import dask

    settings = {
        # The first death is reported: the pool tries the unit again, alone.
        "distributed.scheduler.allowed-failures": 0,
        # Otherwise a worker that is being restarted this long after its death, by
        # chance a second time, is taken for lost and never comes back.
        "distributed.deploy.lost-worker-timeout": "1 day",
    }
    with (
        # Its own folder for temporary files would stay for ever.
        TemporaryDirectory(prefix="reachmap-", ignore_cleanup_errors=True) as folder,
        dask.config.set(settings | {"temporary-directory": folder}),
        _distributed().LocalCluster(
            n_workers=worker_count(workers, workers),  # they all start at once
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            silence_logs=_log_level(),
        ) as cluster,
    ):
        yield cluster


def _log_level() -> int:
    # What matters of it (dead workers, a lost scheduler) is said by the pool.
    return logging.INFO if log.isEnabledFor(logging.DEBUG) else logging.CRITICAL


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise MissingExtraError(
            "this executor needs Dask: pip install 'reachmap-cells[dask]'"
        ) from error
    return distributed


def _is_killed(error: Any) -> bool:
    return isinstance(error, _distributed().scheduler.KilledWorker)


def _is_of_unit(error: Any) -> bool:
    return str(error.task).startswith(f"{compute.__name__}-")
