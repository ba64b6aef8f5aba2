"""Where artefacts come from, and how their runs went."""

import dataclasses
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from reachmap.errors import MapFileError
from reachmap.maps import RunClock, collect_provenance
from reachmap.maps.provenance import (
    package_versions,
    provenance_from_texts,
    record_texts,
    run_from_texts,
)
from tests.support.synthetic_maps import synthetic_provenance, synthetic_run


def test_the_clock_adds_up_phases() -> None:
    """Wall time and CPU time by phase, with what workers report."""
    clock = RunClock(workers=3, argv=["reachmap", "bin-scan", "--set", "a b"])
    for _ in range(2):
        with clock.phase("wait"):
            time.sleep(0.02)
    clock.add_cpu("wait", 10.0)
    run = clock.finish()
    assert run.command_line == "reachmap bin-scan --set 'a b'"
    assert run.workers == 3
    assert 0.04 <= run.wall_s["wait"] < 2
    assert 10.0 <= run.cpu_s["wait"] < 11
    assert run.started <= run.finished


def test_a_phase_that_fails_is_timed_too() -> None:
    """What an interrupted phase took is kept."""
    clock = RunClock()
    with pytest.raises(KeyboardInterrupt, match="now"), clock.phase("plan"):
        raise KeyboardInterrupt("now")
    assert "plan" in clock.finish().wall_s


def test_versions_of_what_is_installed_are_taken_down() -> None:
    """Python and NumPy are there; what is not installed is left out."""
    versions = package_versions(["numpy", "no-such-distribution"])
    assert set(versions) == {"python", "numpy"}


def test_everything_of_a_loaded_cell_is_kept() -> None:
    """Texts, overrides and hashes go from the cell to the record as they are."""
    loaded: Any = SimpleNamespace(
        text="a",
        resolved_json="{}",
        overrides=("b=1",),
        urdf="c",
        srdf="d",
        files_sha256={"mesh": "e"},
    )
    found = collect_provenance(loaded, settings={"repeats": 5}, source_sha256="f")
    assert dataclasses.replace(found, packages={}) == synthetic_provenance(
        cell_yaml="a",
        cell_resolved_json="{}",
        overrides=("b=1",),
        urdf="c",
        srdf="d",
        files_sha256={"mesh": "e"},
        packages={},
        settings={"repeats": 5},
        source_sha256="f",
    )


def test_texts_and_records_turn_into_each_other() -> None:
    """The texts of the two groups hold everything of the two records."""
    provenance, run = synthetic_provenance(), synthetic_run()
    assert provenance_from_texts(record_texts(provenance), "file") == provenance
    assert run_from_texts(record_texts(run), "file") == run


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("settings_json", "{", "settings_json is not JSON"),
        ("settings_json", "[" * 100_000, "settings_json is not JSON"),
        ("packages_json", "[]", "packages_json is not a JSON dict"),
        ("overrides_json", '"x"', "overrides_json is not a JSON list"),
    ],
)
def test_odd_provenance_is_refused(name: str, text: str, message: str) -> None:
    """Texts that are not what they should be name the file and the text."""
    with pytest.raises(MapFileError, match=f"map.h5: {message}"):
        provenance_from_texts({name: text}, str(Path("map.h5")))


@pytest.mark.parametrize("workers", ["two", "-1", "9" * 5000])
def test_an_odd_number_of_workers_is_refused(workers: str) -> None:
    """A number is a few digits."""
    with pytest.raises(MapFileError, match="run/workers is not a number"):
        run_from_texts({"workers": workers}, "map.h5")
