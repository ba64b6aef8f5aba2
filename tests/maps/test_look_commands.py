"""`info`, `verify` and `compare` through the command line, and what they leave."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from reachmap.cli import group
from reachmap.maps import (
    read_bin_map,
    write_bin_map,
    write_placement,
    write_workspace_map,
)
from reachmap.plots.parts import files, style
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_workspace_map,
)


def run(*words: Any) -> Result:
    """Call the command line in this process."""
    return CliRunner().invoke(group, [str(word) for word in words])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """workspace.h5, better.h5, bin.h5, placement.h5 and a damaged.h5."""
    path = tmp_path_factory.mktemp("run")
    fractions = np.full((2, 5, 4), 0.5)
    write_workspace_map(
        path / "workspace.h5", synthetic_workspace_map(fractions, shared_row=2)
    )
    fractions[1] = 0.75
    write_workspace_map(
        path / "better.h5", synthetic_workspace_map(fractions, shared_row=2)
    )
    found = np.zeros((1, 2, 2, 3, 3), bool)
    found[0, 0, :, :, 1] = True
    connected = np.zeros((1, 2, 2, 3), bool)
    connected[0, :, :, 0] = True
    record = synthetic_bin_map(found, connected=connected)
    late = record.hit_time_limit.copy()
    late[0, 1, 1, 1, 2] = 1
    write_bin_map(path / "bin.h5", dataclasses.replace(record, hit_time_limit=late))
    write_placement(path / "placement.h5", synthetic_placement())
    data = bytearray((path / "bin.h5").read_bytes())
    data[5000] ^= 4
    (path / "damaged.h5").write_bytes(data)
    return path


def test_info_of_a_workspace_map(folder: Path) -> None:
    """Levels with the best marked, counts, causes with pairs, evidence, provenance."""
    answer = run("info", folder / "workspace.h5")
    assert answer.exit_code == 0
    text = answer.stdout
    assert "workspace map, format 1.1, content" in text
    assert "192 test frames, 40 squares on 2 levels, method roadmap" in text
    assert "  best  +0.00   50.00" in text
    assert "path found                      96 (50.0 %)" in text
    assert "camera housing | bin wall +x" in text
    assert "reached      96 frames in 1 component, 5 attempts" in text
    assert "settings   repeats=5, planner.name=" in text
    assert "overrides  seed=1" in text
    assert not answer.stderr


def test_info_of_a_bin_map(folder: Path) -> None:
    """Reached after n attempts with intervals, missed ones, quadrants, times."""
    answer = run("info", folder / "bin.h5")
    assert answer.exit_code == 0
    text = answer.stdout
    assert "12 test grasps, 3 attempts each, 1 layer, 6 stored paths" in text
    assert "1        0  12   0.00   0.00 to 24.25" in text
    assert "2        6  12  50.00  25.38 to 74.62" in text
    assert "2 test grasps proved connected but missed by every attempt; with" in text
    assert "the limit on wall-clock time ended 1 attempt" in text
    assert "  NE       3        0.0" in text
    times = read_bin_map(folder / "bin.h5").planning_cpu_time
    row = next(line for line in text.splitlines() if "planning time (CPU)" in line)
    unit, mean = row.removeprefix("  planning time (CPU)").split()[:2]
    assert unit == "ms"  # stored in seconds, of which they are a fraction
    assert float(mean) == pytest.approx(1e3 * np.nanmean(times), rel=0.01)


def test_info_of_a_placement(folder: Path) -> None:
    """Pose, score, margin, runner-up, the paper's choice, excluded candidates."""
    text = run("info", folder / "placement.h5").stdout
    assert "chosen          +0.500  +0.100  -0.050      +85.9     96.5" in text
    assert "runner-up" in text
    assert "paper's choice" in text
    assert "+x 0.12 m, -x 0.08 m, +yaw 22.9 deg" in text
    assert "1  the bin collides with pedestal" in text


@pytest.mark.parametrize("name", ["workspace.h5", "bin.h5", "placement.h5"])
def test_info_as_json_is_one_object(folder: Path, name: str) -> None:
    """Strict JSON with the summary and what the artefact was made from."""
    answer = run("info", folder / name, "--json")
    facts = json.loads(answer.stdout, parse_constant=lambda c: pytest.fail(c))
    assert set(facts) >= {"kind", "cell", "seed", "summary", "settings", "run"}
    assert facts["cell"] == "ur5-eye-in-hand"
    assert facts["finished"] is True


def test_json_numbers_are_those_of_the_text(folder: Path) -> None:
    """Counts under the names of the states; NaN is null."""
    facts = json.loads(run("info", folder / "bin.h5", "--json").stdout)
    summary = facts["summary"]
    assert summary["saturation"]["hits"] == [0, 6, 6]
    assert summary["saturation"]["missed"] == 2
    assert summary["causes"]["states"]["path_found"] == 8
    south = next(q for q in summary["quadrants"] if q["name"] == "SE")
    north = next(q for q in summary["quadrants"] if q["name"] == "NE")
    assert {north["saturation"]["hits"][-1], south["saturation"]["hits"][-1]} == {0, 3}
    unreached = north if north["saturation"]["hits"][-1] == 0 else south
    assert unreached["measures"]["path_length"]["mean"] is None


def test_info_hints_at_the_journal_of_an_unfinished_run(tmp_path: Path) -> None:
    """The artefact is not there yet, its journal is."""
    journal = tmp_path / "bin.h5.journal"
    journal.write_bytes(b'0123abcd {"format":"reachmap.journal","kind":"none"}\n')
    answer = run("info", tmp_path / "bin.h5")
    assert answer.exit_code == 2
    assert "unfinished run; name bin.h5.journal to see" in answer.stderr
    assert run("info", journal).exit_code == 2


@pytest.mark.parametrize("command", ["info", "verify"])
def test_damage_is_one_line_and_exit_code_2(folder: Path, command: str) -> None:
    """No traceback, nothing on stdout."""
    answer = run(command, folder / "damaged.h5")
    assert answer.exit_code == 2
    assert answer.stdout == ""
    assert answer.stderr.count("\n") == 1
    assert "damaged, its bytes do not match its seal" in answer.stderr


def test_verify_names_whole_files(folder: Path) -> None:
    """One line per file on stdout, exit code 0."""
    names = ("workspace.h5", "bin.h5", "placement.h5")
    answer = run("verify", *(folder / name for name in names))
    assert answer.exit_code == 0
    lines = answer.stdout.splitlines()
    assert [line.split(":")[0].rpartition("/")[2] for line in lines] == list(names)
    assert all("whole; format 1.1" in line for line in lines)


def test_verify_goes_on_after_a_damaged_file(folder: Path, tmp_path: Path) -> None:
    """Every file gets its verdict; the exit code is that of the worst."""
    files = [folder / "damaged.h5", folder / "bin.h5", tmp_path / "none.h5"]
    answer = run("verify", *files)
    assert answer.exit_code == 2
    assert answer.stdout.count("\n") == 1
    assert "damaged.h5" in answer.stderr
    assert "none.h5: no such file" in answer.stderr
    facts = json.loads(run("verify", *files, "--json").stdout)
    assert facts["whole"] is False
    assert [item["whole"] for item in facts["files"]] == [False, True, False]


def test_compare_says_what_changed(folder: Path) -> None:
    """Headline, frames, causes, squares, and the reverse of it."""
    answer = run("compare", folder / "workspace.h5", folder / "better.h5")
    assert answer.exit_code == 0
    text = answer.stdout
    assert "path reachability 50.00 % to 62.50 % (+12.50 points)" in text
    assert "160 of 160 and 160 test frames, by pose in robot_base" in text
    assert "gained, lost  20, 0 (p < 0.0001 by place)" in text
    assert "Why gained frames were not reached before" in text
    assert "0 squares of 40 changed significantly" in text
    assert "The cells are the same" in text
    back = run("compare", folder / "better.h5", folder / "workspace.h5").stdout
    assert "(-12.50 points)" in back


def test_compare_as_json_is_one_object(folder: Path) -> None:
    """Square by square, with counts and p-values."""
    answer = run("compare", folder / "workspace.h5", folder / "better.h5", "--json")
    facts = json.loads(answer.stdout, parse_constant=lambda c: pytest.fail(c))
    assert facts["change_points"] == 12.5
    assert (facts["gained"], facts["lost"]) == (20, 0)
    assert len(facts["squares"]) == 40
    upper = [s for s in facts["squares"] if s["z"] == 0.1]
    assert {s["change_points"] for s in upper} == {25.0}


@pytest.mark.parametrize(
    ("points", "code"), [("12.5", 0), ("12.6", 1), ("-1", 0), ("0", 0)]
)
def test_compare_as_a_gate(folder: Path, points: str, code: int) -> None:
    """Exit code 1 where the change is below the points asked for."""
    answer = run(
        "compare", folder / "workspace.h5", folder / "better.h5", "--fail-under", points
    )
    assert answer.exit_code == code
    assert ("is below +12.6 points" in answer.stderr) == (code == 1)
    assert "path reachability" in answer.stdout


def test_compare_lets_a_small_loss_pass(folder: Path) -> None:
    """A negative number of points is a loss that is allowed."""
    words = ("compare", folder / "better.h5", folder / "workspace.h5", "--fail-under")
    assert run(*words, "-13").exit_code == 0
    assert run(*words, "-12").exit_code == 1


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        ("workspace.h5", "bin.h5", "is a workspace map, .* a bin map; compare takes"),
        ("placement.h5", "placement.h5", "a bin placement; compare takes"),
        ("workspace.h5", "none.h5", "none.h5: no such file"),
        ("workspace.h5", "damaged.h5", "do not match its seal"),
    ],
)
def test_compare_refuses(folder: Path, a: str, b: str, message: str) -> None:
    """Other kinds, missing and damaged files: one line, exit code 2."""
    import re

    answer = run("compare", folder / a, folder / b)
    assert answer.exit_code == 2
    assert re.search(message, answer.stderr)
    assert answer.stderr.count("\n") == 1


def test_compare_draws(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One file by name, or a folder; existing files are kept without --overwrite."""
    monkeypatch.setattr(style, "DPI", 40)
    words = ("compare", folder / "workspace.h5", folder / "better.h5", "--picture")
    picture = tmp_path / "change.png"
    assert run(*words, picture).exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    again = run(*words, picture)
    assert again.exit_code == 2
    assert "exists already" in again.stderr


def test_the_album_of_a_comparison_goes_to_a_folder(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A path without .png or .svg is a folder; names are those of the album."""
    written: list[tuple[Path, list[str]]] = []

    def note(target: Path, items: list[Any], **_: Any) -> tuple[Path, ...]:
        written.append((target, [item.name for item in items]))
        return ()

    monkeypatch.setattr(files, "write_all", note)
    words = ("compare", folder / "workspace.h5", folder / "better.h5", "--picture")
    assert run(*words, tmp_path / "pictures").exit_code == 0
    assert run(*words, tmp_path / "one.svg").exit_code == 0
    assert written == [
        (tmp_path / "pictures", ["comparison", "comparison_overview"]),
        (tmp_path, ["one"]),
    ]
