"""How many workers: what was asked for, the work, the memory, the container."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from reachmap.errors import SettingsError
from reachmap.runtime import options
from reachmap.runtime.executors import open_pool
from reachmap.runtime.options import RunOptions, available_cores, worker_count


def tree(root, files):
    """Write small files, as a kernel shows them."""
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({}, math.inf),
        ({"cpu.max": "max 100000\n"}, math.inf),
        ({"cpu.max": "150000 100000\n"}, 1.5),
        ({"cpu.max": "nonsense\n"}, math.inf),
        ({"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, math.inf),
        ({"cpu/cpu.cfs_quota_us": "400000", "cpu/cpu.cfs_period_us": "100000"}, 4.0),
    ],
)
def test_the_quota_of_a_container(tmp_path, files, cores):
    """Both versions of control groups, with and without a limit."""
    tree(tmp_path, files)
    assert options._quota_cores(tmp_path) == cores


def test_a_quota_counts_and_not_the_cores_of_the_host(monkeypatch):
    """A container with 1.5 cores of many gets two workers; without a quota all."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: range(64), raising=False)
    monkeypatch.setattr(options, "_quota_cores", lambda: 1.5)
    assert available_cores() == 2
    monkeypatch.setattr(options, "_quota_cores", lambda: math.inf)
    assert available_cores() == 64


def test_memory_of_a_container(tmp_path):
    """The least of what the machine has and what the group may still take."""
    tree(tmp_path, {"memory.max": "1000000", "memory.current": "400000"})
    assert options._free_bytes(tmp_path) == 600_000
    tree(tmp_path, {"memory.max": "max"})
    assert options._free_bytes(tmp_path) > 1e6


def test_no_more_workers_than_work_or_memory(monkeypatch):
    """And always one."""
    monkeypatch.setattr(options, "_free_bytes", lambda: 5.5 * options.WORKER_BYTES)
    assert worker_count(10**8, 3) == 3
    assert worker_count(10**8, 10**8) == 5
    assert worker_count(2, 10) == 2
    monkeypatch.setattr(options, "_free_bytes", lambda: 0.0)
    assert worker_count(8, 10) == 1


def test_a_hundred_million_workers_cost_nothing(caplog):
    """As many are made as there are units, and it is said."""
    with open_pool(RunOptions(workers=10**8)) as pool:
        assert len(pool.slots(3)) == 3
        assert len(pool.slots(4)) == 4
    assert caplog.text.count("workers instead of 100000000") == 1


@pytest.mark.parametrize(
    "name", ["", "threads", "dask:", "dask:tcp://", "dask:tcp://host", "dask:tcp://:1",
             "dask:tcp://host:0", "dask:tcp://host:99999", "dask:tcp://[::1",
             "dask:ftp://host:1"],
)  # fmt: skip
def test_an_executor_that_cannot_be_is_refused_at_once(name):
    """Before a scene is built or a cluster asked."""
    with pytest.raises(SettingsError, match="expected processes, dask:local"):
        RunOptions(executor=name)


SCRIPT = """
from pathlib import Path
from reachmap.runtime.options import RunOptions
from reachmap.runtime.run import run_scan
from tests.support.toy_work import toy_work

run_scan(toy_work(), output=Path("out.json"), options=RunOptions(workers=2), label="")
print("done")
"""


@pytest.mark.parametrize("how", ["file", "stdin", "-c"])
def test_a_script_needs_no_main_guard(tmp_path, how):
    """Workers do not import the script that is running, so it is not run again."""
    (tmp_path / "script.py").write_text(SCRIPT)
    arguments = {"file": ["script.py"], "stdin": ["-"], "-c": ["-c", SCRIPT]}[how]
    done = subprocess.run(
        [sys.executable, *arguments],
        input=SCRIPT if how == "stdin" else None,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"workers": 0}, "workers: expected 1 or more"),
        ({"workers": "2"}, "workers: expected 1 or more"),
        ({"shard": (3, 2)}, "i from 1 to N"),
        ({"shard": "1/2"}, "i from 1 to N"),
    ],
)
def test_wrong_options_of_a_run_are_named(wrong, message):
    """By the program that makes them, before any work."""
    with pytest.raises(SettingsError, match=message):
        RunOptions(**wrong)
