from __future__ import annotations

import sys
from concurrent.futures import BrokenExecutor

import pytest

from reachmap.runtime.executors import WorkerProcess

LARGE = b"x" * 2**22  # more than a pipe takes while nobody reads


@pytest.fixture
def hasty_threads():
    """Let threads take turns as often as Python can, so that races show."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("hasty_threads")
@pytest.mark.parametrize("dies_first", [False, True])
def test_a_worker_ends_while_a_task_is_on_its_way(dies_first):
    """No thread fails or waits for ever, whoever kills the worker."""
    for _ in range(300):
        worker = WorkerProcess()
        future = worker.submit(len, LARGE)
        if dies_first:
            for process in worker._processes.values():
                process.kill()
            # Now the pool is putting itself in order, in a thread of its own.
            assert isinstance(future.exception(), BrokenExecutor)
        worker.end()
        assert future.done()
