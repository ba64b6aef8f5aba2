"""Where the units run: the one place that knows ``--executor`` names.

====================== ===========================================================
Name                   Workers
====================== ===========================================================
processes              processes of this machine; one worker is this process
dask:local             a Dask cluster on this machine, gone after the run
dask:tcp://HOST:PORT   a Dask cluster that is there already (also ``dask:tls://…``)
====================== ===========================================================

The library takes any other ``concurrent.futures.Executor``, too: as a callable that
makes it, and makes it again after its workers have died.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager
from typing import Any, TypeAlias

from reachmap.errors import (
    IncompleteError,
    MissingExtraError,
    SettingsError,
)
from reachmap.runtime.work import unchanged
from reachmap.runtime.workers.crew import LaneSpec
from reachmap.runtime.workers.processes import (
    in_process_lane,
    one_thread_each,
    process_lanes,
)
from reachmap.runtime.workers.tasks import Parcel, compute

UNITS_PER_THREAD = 4
WINDOW_AGE_S = 5.0
WAIT_FOR_WORKERS_S = 300.0
SCHEMES = ("tcp://", "tls://", "ws://", "wss://")

ExecutorChoice: TypeAlias = str | Callable[[], Executor]

log = logging.getLogger(__name__)


@contextmanager
def open_lanes(
    name: ExecutorChoice, workers: int, parcel: Parcel
) -> Iterator[list[LaneSpec]]:
    """Make the lanes that an ``--executor`` name stands for.

    Parameters
    ----------
    name : str or callable
        See the table of this module; or what makes an executor.
    workers : int
        Number of workers; a Dask cluster that is there already has its own.
    parcel : Parcel

    Yields
    ------
    list of LaneSpec

    Raises
    ------
    SettingsError
        For a name that is not in the table.
    MissingExtraError
        When Dask is not installed.
    """
    check_executor(name)
    if not isinstance(name, str):
        yield [_lane_of(name, workers, parcel)]
    elif name != "processes":
        with _dask_client(name.removeprefix("dask:"), workers) as client:
            yield [_dask_lane(client, parcel)]
    elif workers == 1:
        yield [in_process_lane(parcel)]
    else:
        with one_thread_each():
            yield process_lanes(parcel, workers)


def check_executor(name: ExecutorChoice) -> None:
    """Refuse a name that is not in the table of this module.

    Raises
    ------
    SettingsError
    """
    if not isinstance(name, str) or name in ("processes", "dask:local"):
        return
    address = name.removeprefix("dask:")
    if address == name or not address.startswith(SCHEMES):
        raise SettingsError(
            f"executor {name!r}: expected processes, dask:local or dask:tcp://HOST:PORT"
        )


def _lane_of(make: Callable[[], Executor], workers: int, parcel: Parcel) -> LaneSpec:
    return LaneSpec(
        start=make,
        stop=lambda executor: executor.shutdown(wait=False, cancel_futures=True),
        parcel=parcel,
        label=parcel,
        window=lambda: UNITS_PER_THREAD * workers,
    )


@contextmanager
def _dask_client(address: str, workers: int) -> Iterator[Any]:
    distributed = _distributed()
    import dask

    with ExitStack() as stack:
        # A survey of all test grasps is large, and meant to be sent.
        threshold = {"distributed.admin.large-graph-warning-threshold": "1 GB"}
        stack.enter_context(dask.config.set(threshold))
        stack.enter_context(distributed.utils.silence_logging_cmgr(_dask_log_level()))
        try:
            if address == "local":
                cluster = stack.enter_context(_local_cluster(workers))
                address = cluster.scheduler_address
            client = distributed.Client(address, set_as_default=False)
            stack.enter_context(client)
            client.wait_for_workers(1, timeout=WAIT_FOR_WORKERS_S)
        except (OSError, TimeoutError, RuntimeError) as error:
            raise SettingsError(f"no Dask workers at {address}: {error}") from error
        yield client


@contextmanager
def _local_cluster(workers: int) -> Iterator[Any]:
    """Start a cluster of this machine that leaves judging dead workers to us."""
    import dask

    settings = {
        # The first death is reported: the crew tries the unit again, alone.
        "distributed.scheduler.allowed-failures": 0,
        # Otherwise a worker that is being restarted this long after its death, by
        # chance a second time, is taken for lost and never comes back.
        "distributed.deploy.lost-worker-timeout": "1 day",
    }
    with (
        dask.config.set(settings),
        one_thread_each(),
        _distributed().LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            silence_logs=_dask_log_level(),
        ) as cluster,
    ):
        yield cluster


def _dask_log_level() -> int:
    # What matters of it (dead workers, a lost scheduler) is said by the crew.
    return logging.INFO if log.isEnabledFor(logging.DEBUG) else logging.CRITICAL


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise MissingExtraError(
            "this executor needs Dask: pip install 'reachmap-cells[dask]'"
        ) from error
    return distributed


def _dask_lane(client: Any, parcel: Parcel) -> LaneSpec:
    return LaneSpec(
        start=lambda: _DaskExecutor(client, parcel),
        stop=lambda executor: executor.shutdown(wait=False),
        parcel=parcel.label(),
        label=parcel.label(),
        window=_Window(client),
        lost=lambda error: _is_killed(error) and not _is_of_unit(error),
        deaths=_deaths,
    )


class _DaskExecutor(Executor):
    """Dask's executor, which is given the job once and only then units.

    As the result of a task the job goes to each worker once, also to those that come
    later, and it is made again when the workers that had it die.
    """

    def __init__(self, client: Any, parcel: Parcel) -> None:
        self._parcel = client.submit(unchanged, parcel, pure=False)
        # Not pure: a unit that is tried again must be computed again.
        self._executor = client.get_executor(pure=False)

    def submit(self, fn: Any, /, label: Any, *unit: Any) -> Future[Any]:  # type: ignore[override]
        """Submit a function of the job."""
        future: Future[Any] = self._executor.submit(fn, self._parcel, *unit)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Forget what was submitted, unless it is to be waited for."""
        self._executor.shutdown(wait=wait)


def _is_killed(error: Any) -> bool:
    return isinstance(error, _distributed().scheduler.KilledWorker)


def _deaths(error: Any) -> int:
    return int(error.allowed_failures) + 1 if _is_killed(error) else 0


def _is_of_unit(error: Any) -> bool:
    return str(error.task).startswith(f"{compute.__name__}-")


class _Window:
    """Units in flight for a cluster that may grow, shrink and go away."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._asked_s = -math.inf
        self._seen_s = time.monotonic()
        self._units = 1

    def __call__(self) -> int:
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
                "what is done is kept, the same command goes on from there"
            )
