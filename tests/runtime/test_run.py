from __future__ import annotations

import json
import multiprocessing
import os
import signal
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace

import pytest

from reachmap.errors import (
    EngineError,
    IncompleteError,
    MapFileError,
    OutputError,
    SceneError,
    SettingsError,
)
from reachmap.maps import RunClock
from reachmap.maps.records import RunInfo, Status
from reachmap.runtime.executors import open_pool
from reachmap.runtime.job import Job
from reachmap.runtime.journal import read_store
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress
from reachmap.runtime.results import Results, preview
from reachmap.runtime.run import compute, run_scan, run_units
from reachmap.runtime.signals import STOP_SIGNALS
from reachmap.runtime.store import store_path
from tests.support import toy_work
from tests.support.toy_work import Toy, expected


@pytest.fixture
def output(tmp_path):
    """Where the artefact goes."""
    return tmp_path / "out.json"


def run(output, toy=None, **settings):
    """Run a toy scan and read the artefact."""
    outcome = run_scan(
        toy_work.toy_work(toy),
        output=output,
        options=RunOptions(**settings),
        label="toy",
    )
    return outcome, json.loads(output.read_text())


@pytest.mark.parametrize("workers", [1, 2])
def test_the_artefact_is_what_the_function_says(output, workers):
    """Journal, workers and order leave no trace in the result; the journal is gone."""
    outcome, artefact = run(output, workers=workers)
    assert artefact == expected()
    assert (outcome.computed, outcome.resumed, outcome.path) == (40, 0, output)
    assert not store_path(output).exists()
    assert isinstance(outcome.run, RunInfo)
    assert outcome.run.workers == workers
    assert outcome.run.cpu_s["units"] >= 0


@pytest.mark.parametrize("workers", [1, 2])
def test_cpu_time_of_units_counts_once(output, workers):
    """Whether this process computes them or others do."""
    begin = time.process_time()
    outcome, _ = run(output, Toy(units=10, busy_s=0.05), workers=workers)
    own_s = time.process_time() - begin
    assert outcome.run.cpu_s["units"] >= 0.49
    if workers == 1:
        assert outcome.run.cpu_s["units"] <= own_s
    else:
        # What the workers do beside the units is not theirs.
        assert outcome.run.cpu_s["units"] < 0.9 + own_s


@pytest.mark.parametrize("workers", [1, 2])
def test_a_buggy_unit_is_recorded_and_tried_again(output, workers, caplog):
    """An exception inside a unit costs that unit; the same command repeats only it."""
    toy = Toy(buggy=(7, 39))
    with pytest.raises(IncompleteError, match=r"2 of 40 units failed") as caught:
        run(output, toy, workers=workers)
    assert caught.value.lines[1] == "unit 7: ZeroDivisionError: unit 7 divides by zero"
    assert json.loads(output.read_text()) == expected(failed=(7, 39))
    with read_store(store_path(output)) as entries:
        assert 'raise ZeroDivisionError(f"unit' in entries.failed()[39]
    outcome, artefact = run(output, workers=workers)
    assert artefact == expected()
    assert (outcome.computed, outcome.resumed) == (2, 38)
    assert not store_path(output).exists()


@pytest.mark.parametrize("workers", [1, 2])
def test_wrong_input_ends_the_run_at_once(output, workers):
    """A cell that cannot work is one message, not forty failed units."""
    with pytest.raises(SceneError, match="unit 5 met a cell that cannot work"):
        run(output, Toy(wrong=(5,)), workers=workers)
    assert not output.exists()
    assert run(output, workers=workers)[1] == expected()


@pytest.mark.parametrize(
    ("toy", "error", "said"),
    [
        (Toy(prepare="wrong"), SceneError, "scan configuration is in collision"),
        (Toy(prepare="buggy"), EngineError, "ZeroDivisionError: no scene"),
    ],
)
def test_a_scene_that_cannot_be_built_ends_the_run(output, toy, error, said):
    """Errors of preparing are reported as they are, defects as defects."""
    with pytest.raises(error, match=said):
        run(output, toy)


def test_workers_that_die_while_preparing_end_the_run(output, monkeypatch):
    """A scene that kills its process is not retried for every unit."""
    monkeypatch.setattr("reachmap.runtime.pool.FAILED_STARTS", 3)
    with pytest.raises(EngineError, match="died 3 times before their first unit"):
        run(output, Toy(prepare="killed"), workers=2)


def test_poisoned_and_moody_units(output, tmp_path):
    """A unit that kills every worker is given up, one that kills one is not."""
    toy = Toy(poison=(20,), moody=(5, 6), marks=str(tmp_path))
    with pytest.raises(IncompleteError, match="1 of 40 units failed") as caught:
        run(output, toy, workers=2)
    # Two units that lost a worker and were done in the end allow two strikes more.
    assert caught.value.lines[1:] == ("unit 20: killed 5 workers",)
    assert json.loads(output.read_text()) == expected(failed=(20,))


def test_an_existing_artefact_is_not_replaced_unasked(output):
    """Without --overwrite an existing output is refused before anything is done."""
    run(output)
    before = output.read_bytes()
    with pytest.raises(OutputError, match="--overwrite"):
        run(output, Toy(seed=2))
    assert output.read_bytes() == before
    assert not store_path(output).exists()
    assert run(output, Toy(seed=2), overwrite=True)[1] == expected(seed=2)


def test_other_settings_do_not_resume(output):
    """A journal of another seed is refused by name, and discarded on request."""
    with pytest.raises(SceneError, match="unit 9"):
        run(output, Toy(wrong=(9,)))
    with pytest.raises(MapFileError, match=r"seed 1 → 2.*--restart"):
        run(output, Toy(seed=2))
    outcome, artefact = run(output, Toy(seed=2), restart=True)
    assert artefact == expected(seed=2)
    assert outcome.resumed == 0


def test_other_package_versions_do_not_resume(output, monkeypatch):
    """Half a map from one planner version and half from the next is no map."""
    with pytest.raises(SceneError, match="unit 9"):
        run(output, Toy(wrong=(9,)))
    monkeypatch.setattr("reachmap.runtime.job.__version__", "99.0")
    with pytest.raises(MapFileError, match=r'packages.reachmap "[\d.]+" → "99.0"'):
        run(output)


def test_failing_to_publish_keeps_the_journal(output, monkeypatch):
    """When the artefact cannot be written, nothing has to be computed again."""

    def full(path, artefact, *, overwrite=False):
        raise OutputError("No space left on device")

    work = toy_work.toy_work()
    broken = type(work.kind)(
        name="toy", blank=toy_work.blank, assemble=toy_work.assemble, write=full
    )
    monkeypatch.setattr(toy_work, "KIND", broken)
    with pytest.raises(OutputError, match="No space left"):
        run(output)
    monkeypatch.undo()
    outcome, artefact = run(output)
    assert (outcome.computed, outcome.resumed) == (0, 40)
    assert artefact == expected()


def test_any_executor_will_do(output):
    """A pool of threads, and a pool of processes that breaks, give the same map."""
    assert run(output, executor=lambda: ThreadPoolExecutor(3))[1] == expected()
    spawn = multiprocessing.get_context("spawn")
    with pytest.raises(IncompleteError, match="unit 11: killed 3 workers"):
        run(
            output,
            Toy(poison=(11,)),
            workers=2,
            executor=lambda: ProcessPoolExecutor(2, mp_context=spawn),
            overwrite=True,
        )
    assert json.loads(output.read_text()) == expected(failed=(11,))


def test_a_run_outside_the_main_thread(output):
    """A service may scan in a thread, where signals cannot be caught."""
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(run, output).result()[1] == expected()


def test_signal_handlers_and_environment_are_given_back(output):
    """After a run the process is as it was."""
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    environment = dict(os.environ)
    run(output, workers=2)
    assert {number: signal.getsignal(number) for number in STOP_SIGNALS} == before
    assert dict(os.environ) == environment


def test_an_unknown_executor_is_refused(output):
    """The message lists what there is; nothing is created."""
    for name in (
        "threads",
        "dask",
        "dask:",
        "dask:somewhere",
        "dask:http://x:1",
        "dask:tcp://",
        "dask:tcp://host",
        "dask:tcp://:1",
        "dask:tcp://host:99999",
    ):
        with pytest.raises(SettingsError, match="expected processes, dask:local"):
            run(output, executor=name)
    assert not list(output.parent.iterdir())


def test_a_preview_shows_what_is_there(output):
    """A journal under way reads as an artefact with the rest not attempted."""
    with pytest.raises(SceneError, match="unit 9"):
        run(output, Toy(wrong=(9,)))
    rows = preview(store_path(output))["rows"]
    assert rows[:9] == expected()["rows"][:9]
    blank = toy_work.blank({}, 9, Status.NOT_ATTEMPTED)
    assert rows[9] == toy_work.bits(blank)


def test_results_are_a_sequence(output):
    """Payloads can be indexed, sliced, counted and run through more than once."""
    with run_units(
        toy_work.toy_work(),
        output=output,
        options=RunOptions(),
        label="toy",
        clock=RunClock(),
    ) as (results, _):
        assert isinstance(results, Results)
        assert len(results) == results.done == 40
        assert [one["unit"] for one in results] == list(range(40))
        assert [one["unit"] for one in results[3:9:2]] == [3, 5, 7]
        assert (results.missing, dict(results.failed)) == ((), {})
        with pytest.raises(IndexError, match="unit 40 of 40"):
            results[40]
    assert not store_path(output).exists()


def test_an_output_that_appears_meanwhile_is_kept(output):
    """What somebody else put there during the run is not replaced; nothing is lost."""
    with (
        pytest.raises(OutputError, match="40 of 40 units are safe in"),
        _somebody_writes(output),
    ):
        run(output)
    assert output.read_text() == "precious"
    outcome, artefact = run(output, overwrite=True)
    assert (outcome.resumed, artefact) == (40, expected())


@contextmanager
def _somebody_writes(output):
    before = toy_work.KIND

    def assemble(document, payloads, *, run):
        output.write_text("precious")
        return toy_work.assemble(document, payloads, run=run)

    toy_work.KIND = replace(before, assemble=assemble)
    try:
        yield
    finally:
        toy_work.KIND = before


def test_an_empty_store_is_no_licence_to_overwrite(output):
    """Only what this very work has published may be replaced unasked."""
    output.write_text("precious")
    store_path(output).touch()
    with pytest.raises(OutputError, match="--overwrite"):
        run(output)
    assert output.read_text() == "precious"


def test_an_artefact_with_errors_that_was_changed_is_kept(output):
    """The same command completes its own artefact, and no other under that name."""
    with pytest.raises(IncompleteError):
        run(output, Toy(buggy=(7,)))
    output.write_text("precious")
    with pytest.raises(OutputError, match="--overwrite"):
        run(output)
    assert output.read_text() == "precious"
    assert run(output, overwrite=True)[1] == expected()


def test_stages_are_kept_too(output):
    """What comes before the units is computed once, whatever interrupts the rest."""
    calls = []

    def staged(stages, toy):
        def add(progress):
            calls.append(1)
            return sum(shape)

        shape = stages.run(
            "survey", Job(function=double, context=None), [(1, 2), (3, 4)]
        )
        total = stages.once("sum", add)
        assert total == 20
        return Job(function=toy_work.compute, context=toy, prepare=toy_work.prepare)

    def work(toy):
        return replace(toy_work.toy_work(toy), job=lambda stages: staged(stages, toy))

    for toy in (Toy(wrong=(5,)), Toy(wrong=(9,)), Toy()):
        with suppress(SceneError):
            run_scan(work(toy), output=output, options=RunOptions(), label="toy")
    assert json.loads(output.read_text()) == expected()
    assert calls == [1]


def double(context, unit):
    """Twice the sum of a unit."""
    return 2 * sum(unit)


def test_a_pool_gets_ready_for_a_job_once():
    """Rounds of one job share what was built for it; another job builds its own."""
    built.clear()
    job, other = (Job(function=double, context=[k], prepare=build) for k in (1, 2))
    with open_pool(RunOptions()) as pool:
        for this in (job, job, job, other, job):
            progress = Progress("toy", quiet=True)
            assert compute(pool, this, [(1, 2)], progress) == [6]
    assert built == [1, 2, 1]


built: list[int] = []


def build(context):
    """Note that something was built."""
    built.extend(context)
    return context
