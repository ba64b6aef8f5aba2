"""Real processes, really killed."""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from reachmap.runtime.journal import read_store
from reachmap.runtime.store import store_path
from tests.support import toy_work
from tests.support.toy_work import expected

SCRIPT = Path(toy_work.__file__)


def command(output, *options, **toy):
    """Command line of a toy scan."""
    return [
        sys.executable,
        str(SCRIPT),
        str(output),
        *options,
        "--toy",
        json.dumps(toy),
    ]


def start(output, *options, limit=None, more=None, **toy):
    """Start a toy scan in a session of its own."""
    environment = {**os.environ, "PYTHONPATH": str(SCRIPT.parents[2]), **(more or {})}

    def before_start():
        # A shell starts what it runs in the background with Ctrl-C ignored.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        if limit is not None:
            limit()

    return subprocess.Popen(
        command(output, *options, **toy),
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=before_start,
    )


def finish(output, *options, **toy):
    """Run a toy scan to its end: exit code, units done now and before, messages."""
    process = start(output, *options, **toy)
    out, err = process.communicate(timeout=120)
    return process.returncode, out.split(), err


def wait_for_units(output, count, process):
    """Wait until the journal holds some units."""
    journal = store_path(output)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and process.poll() is None:
        if journal.exists() and journal.read_bytes().count(b"\n\n") > count + 1:
            return
        time.sleep(0.01)
    pytest.fail(f"no {count} units: {process.communicate()}")


def workers_of(process):
    """Worker processes of a scan, without multiprocessing's own helper."""
    workers = []
    for child in children_of(process):
        with suppress(psutil.Error):  # it may end this moment
            if "spawn_main" in " ".join(child.cmdline()):
                workers.append(child)
    return workers


def children_of(process):
    """Child processes; none when it has ended."""
    try:
        return psutil.Process(process.pid).children()
    except psutil.NoSuchProcess:
        return []


def wait_a_while(output, process, rng):
    """Wait for a random time, or for a random number of further units."""
    if rng.random() < 0.5:
        time.sleep(rng.uniform(0.05, 1.5))
        return
    more, deadline = rng.randrange(1, 20), time.monotonic() + 60
    before = size(output)
    while process.poll() is None and size(output) < before + more * 300:
        assert time.monotonic() < deadline
        time.sleep(0.005)


def size(output):
    """Length of the journal; a toy's line has about 300 bytes."""
    try:
        return store_path(output).stat().st_size
    except FileNotFoundError:
        return 0


def kill_at_random_moments(output, count, seed):
    """SIGKILL a scan up to `count` times, resume it, and return how often it died."""
    rng, deaths = random.Random(seed), 0
    while deaths < count and not output.exists():
        process = start(output, "-j", "2", units=60, pause_s=0.02)
        wait_a_while(output, process, rng)
        children = children_of(process)
        process.kill()
        process.communicate()
        deaths += process.returncode == -signal.SIGKILL
        _, alive = psutil.wait_procs(children, timeout=20)
        assert not alive, "workers outlived the run"
    return deaths


@pytest.mark.parametrize(
    ("count", "seed"),
    [
        (3, 0),
        *(pytest.param(50, k, marks=pytest.mark.slow) for k in range(1, 500, 100)),
    ],
)
def test_killed_at_random_moments_and_resumed(tmp_path, count, seed):
    """After any number of SIGKILLs the artefact is that of an undisturbed run."""
    deaths = 0
    while deaths < count:
        output = tmp_path / f"out-{seed}.json"
        deaths += kill_at_random_moments(output, count - deaths, seed)
        if not output.exists():
            code, _, err = finish(output, "-j", "2", units=60)
            assert code == 0, err
        assert json.loads(output.read_text()) == expected(units=60)
        seed += 1
    assert deaths == count


@pytest.mark.parametrize(
    ("number", "workers"),
    [
        (signal.SIGINT, "2"),
        (signal.SIGTERM, "1"),
        pytest.param(signal.SIGINT, "1", marks=pytest.mark.slow),
        pytest.param(signal.SIGTERM, "2", marks=pytest.mark.slow),
        (signal.SIGHUP, "2"),
    ],
)
def test_told_to_stop(tmp_path, number, workers):
    """Ctrl-C, SIGTERM and a closed terminal end promptly, and say how to go on."""
    output = tmp_path / "out.json"
    process = start(output, "-j", workers, pause_s=0.4)
    wait_for_units(output, 2, process)
    children = workers_of(process)
    assert len(children) == (2 if workers == "2" else 0)
    os.killpg(process.pid, number)  # a terminal signals the whole group
    began = time.monotonic()
    _, err = process.communicate(timeout=30)
    assert time.monotonic() - began < 5
    assert process.returncode == 130
    assert "units are safe in" in err
    assert "to resume: toy_work.py" in err
    assert "Traceback" not in err
    assert not any(child.is_running() for child in children)
    code, (_, resumed), err = finish(output, "-j", workers)
    assert code == 0, err
    assert int(resumed) >= 2
    assert json.loads(output.read_text()) == expected()


def test_a_worker_killed_again_and_again(tmp_path):
    """Killing a worker every quarter of a second costs time, never a unit."""
    output = tmp_path / "out.json"
    process = start(output, "-j", "2", units=40, pause_s=0.1, ballast=2_000_000)
    wait_for_units(output, 1, process)
    rng, killed = random.Random(7), 0
    while process.poll() is None and killed < 4:
        if workers := workers_of(process):
            rng.choice(workers).kill()
            killed += 1
        time.sleep(0.25)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert killed >= 3
    assert "a worker died at unit" in err
    assert json.loads(output.read_text()) == expected()


def test_no_room_left(tmp_path):
    """A file size limit ends with a message and exit code 3; more room resumes."""
    output = tmp_path / "out.json"

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))

    process = start(output, "-j", "1", limit=limit)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 3
    last = err.strip().splitlines()[-1]
    assert "File too large" in last
    assert "units are safe there" in last
    assert "Traceback" not in err
    with read_store(store_path(output)) as entries:
        kept = len(entries.results())
        assert (kept > 0, entries.damaged) == (True, 0)
    assert store_path(output).stat().st_size <= 6000
    code, counts, err = finish(output, "-j", "1")
    assert (code, counts) == (0, [str(40 - kept), str(kept)]), err
    assert json.loads(output.read_text()) == expected()


def test_a_second_run_on_one_output_is_refused(tmp_path):
    """Only one run writes; the other says so with exit code 2 and disturbs nothing."""
    output = tmp_path / "out.json"
    first = start(output, "-j", "1", pause_s=600.0)
    wait_for_units(output, 0, first)
    code, _, err = finish(output, "-j", "1")
    assert code == 2
    assert "is being written by another run" in err
    first.send_signal(signal.SIGINT)
    first.communicate(timeout=60)
    assert finish(output, "-j", "1")[0] == 0
    assert json.loads(output.read_text()) == expected()


def test_no_room_for_the_artefact(tmp_path):
    """All units fit, the artefact does not: exit code 3 names what is safe."""
    output = tmp_path / "out.json"

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))

    more = {"TOY_PADDING": "100000"}
    process = start(output, "-j", "1", units=60, limit=limit, more=more)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 3, err
    assert f"60 of 60 units are safe in {store_path(output)}" in err
    assert list(tmp_path.iterdir()) == [store_path(output)]
    code, counts, err = finish(output, "-j", "1", units=60)
    assert (code, counts) == (0, ["0", "60"]), err
    assert json.loads(output.read_text()) == expected(units=60)


@pytest.mark.parametrize("moment", ["os.fsync", "os.link", "pathlib.Path.unlink"])
def test_killed_while_publishing(tmp_path, moment):
    """Whatever moment it is, the same command ends well and leaves the output alone."""
    output, seen = tmp_path / "out.json", 0
    for count in range(1, 9):
        environment = {"TOY_DIES_AT": f"{moment}:{count}"}
        process = start(output, "-j", "1", more=environment)
        process.communicate(timeout=60)
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL
        seen += 1
    else:
        assert finish(output, "-j", "1")[0] == 0
    assert seen >= 1
    assert list(tmp_path.iterdir()) == [output]
    assert json.loads(output.read_text()) == expected()


@pytest.mark.parametrize(
    "moment",
    ["os.link:1", "pathlib.Path.unlink:1", *(f"os.fsync:{k}" for k in range(1, 5))],
)
def test_a_foreign_file_after_a_kill_is_no_licence_to_replace_it(tmp_path, moment):
    """Whatever moment of publishing it was: only the very file may be replaced."""
    output = tmp_path / "out.json"
    process = start(output, "-j", "1", more={"TOY_DIES_AT": moment})
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL
    output.unlink(missing_ok=True)
    output.write_text("precious")
    code, _, err = finish(output, "-j", "1")
    assert (code, output.read_text()) == (2, "precious")
    assert "--overwrite" in err
    output.unlink()
    assert finish(output, "-j", "1")[0] == 0
    assert json.loads(output.read_text()) == expected()
    assert list(tmp_path.iterdir()) == [output]
