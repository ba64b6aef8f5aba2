"""Dask as an executor; the clusters are real and on this machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

from reachmap.errors import MissingExtraError
from reachmap.runtime.journal import read_store
from reachmap.runtime.options import RunOptions
from reachmap.runtime.run import run_scan
from reachmap.runtime.store import store_path
from tests.support import toy_work
from tests.support.toy_work import expected

SCRIPT = Path(toy_work.__file__)


def start(output, executor, **toy):
    """Start a toy scan on Dask."""
    options = ["-j", "2", "--executor", executor, "--toy", json.dumps(toy)]
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), str(output), *options],
        env={**os.environ, "PYTHONPATH": str(SCRIPT.parents[2])},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process):
    """Exit code and messages."""
    _, err = process.communicate(timeout=240)
    return process.returncode, err


def wait_for_units(output, count, process):
    """Wait until the journal holds some units."""
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and process.poll() is None:
        journal = store_path(output)
        if journal.exists() and journal.read_bytes().count(b"\n\n") > count + 1:
            return
        time.sleep(0.02)
    pytest.fail(f"no {count} units: {process.communicate()}")


@contextmanager
def cluster(folder, *, workers=2):
    """A scheduler and workers of their own, as on a real cluster."""
    dask = [sys.executable, "-m", "distributed.cli."]
    environment = {**os.environ, "PYTHONPATH": str(SCRIPT.parents[2])}
    info = folder / "scheduler.json"
    null = subprocess.DEVNULL
    scheduler = subprocess.Popen(
        [*dask[:2], f"{dask[2]}dask_scheduler", "--scheduler-file", str(info),
         "--host", "127.0.0.1", "--port", "0", "--no-dashboard"],
        env=environment,
        stdout=null,
        stderr=null,
    )  # fmt: skip
    crew = [
        subprocess.Popen(
            [*dask[:2], f"{dask[2]}dask_worker", "--scheduler-file", str(info),
             "--nthreads", "2", "--no-dashboard", "--local-directory", str(folder)],
            env=environment,
            stdout=null,
            stderr=null,
        )
        for _ in range(workers)
    ]  # fmt: skip
    try:
        deadline = time.monotonic() + 60
        while not info.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        yield json.loads(info.read_text())["address"], scheduler, crew
    finally:
        for process in (*crew, scheduler):
            process.terminate()
            process.wait(timeout=60)


def test_without_dask_the_extra_is_named(tmp_path, monkeypatch):
    """Asking for Dask where it is not installed says what to install."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"reachmap-cells\[dask\]"):
        run_scan(
            toy_work.toy_work(),
            output=tmp_path / "out.json",
            options=RunOptions(executor="dask:local"),
            label="toy",
        )


@pytest.mark.slow
def test_a_worker_of_a_local_cluster_is_killed(tmp_path):
    """Two workers, one killed midway: the artefact is that of a run by processes."""
    output = tmp_path / "out.json"
    process = start(output, "dask:local", pause_s=0.2, ballast=20_000_000)
    wait_for_units(output, 5, process)
    workers = [
        child
        for child in psutil.Process(process.pid).children()
        if "spawn_main" in " ".join(child.cmdline())
    ]
    assert len(workers) == 2
    workers[0].kill()
    code, err = finish(process)
    assert code == 0, err
    assert "Warning" not in err
    assert json.loads(output.read_text()) == expected()
    assert not store_path(output).exists()


@pytest.mark.slow
def test_a_poisoned_unit_on_dask(tmp_path):
    """The poisoned unit is given up, its neighbours are not."""
    output = tmp_path / "out.json"
    code, err = finish(start(output, "dask:local", poison=[3], buggy=[9]))
    assert code == 3, err
    assert "unit 3: killed 3 workers" in err
    assert json.loads(output.read_text()) == expected(failed=(3, 9))


@pytest.mark.slow
def test_a_cluster_that_is_there_already(tmp_path):
    """Workers with several threads, found by address, give the same artefact."""
    output = tmp_path / "out.json"
    with cluster(tmp_path) as (address, _, crew):
        process = start(output, f"dask:{address}", pause_s=0.05)
        wait_for_units(output, 3, process)
        crew[0].kill()
        code, err = finish(process)
    assert code == 0, err
    assert json.loads(output.read_text()) == expected()


@pytest.mark.slow
def test_a_scheduler_that_dies(tmp_path):
    """Losing the cluster ends the run with exit code 3; processes finish it."""
    output = tmp_path / "out.json"
    with cluster(tmp_path) as (address, scheduler, _):
        process = start(output, f"dask:{address}", pause_s=0.5)
        wait_for_units(output, 3, process)
        scheduler.kill()
        code, err = finish(process)
    assert code == 3, err
    assert "Traceback" not in err
    with read_store(store_path(output)) as entries:
        assert len(entries.results()) >= 3
    outcome = run_scan(
        toy_work.toy_work(), output=output, options=RunOptions(), label="toy"
    )
    assert outcome.resumed >= 3
    assert json.loads(output.read_text()) == expected()


@pytest.mark.slow
def test_no_cluster_at_the_address(tmp_path):
    """A wrong address is a clean error after a while, with nothing lost."""
    output = tmp_path / "out.json"
    code, err = finish(start(output, "dask:tcp://127.0.0.1:9"))
    assert code == 2, err
    assert "no Dask workers at tcp://127.0.0.1:9" in err
    assert "Traceback" not in err
