"""What every command has in common on stdout: text, or one JSON value."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

from reachmap.cell.loading import read_cell
from reachmap.cli import group
from reachmap.cli.group import COMMANDS
from reachmap.maps import write_bin_map
from tests.support.ranking_maps import make_bin_map
from tests.support.toy_artefacts import toy_bin_map


def run(*arguments: object) -> Result:
    """Run the command line in this process."""
    return CliRunner().invoke(group, [str(value) for value in arguments])


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_answers_with_json(name: str) -> None:
    """One spelling everywhere."""
    command = group.get_command(click.Context(group), name)
    assert command is not None
    assert "--json" in [flag for p in command.params for flag in p.opts]


def test_json_of_ranking(tmp_path: Path) -> None:
    """The lists themselves, what was written, or a story: one JSON value each."""
    write_bin_map(tmp_path / "bin.h5", make_bin_map(seed=1))
    grasp = {"id": "a", "position": [0.0, 0.0, 0.05], "direction": [0, 0, -1]}
    document = {"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin"}
    lists = [tmp_path / "one.json", tmp_path / "two.json"]
    for path in lists:
        path.write_text(json.dumps({**document, "grasps": [grasp]}))
    call = ["rank", "--map", tmp_path / "bin.h5", "--json"]
    assert json.loads(run(*call, lists[0]).stdout)["grasps"][0]["id"] == "a"
    assert len(json.loads(run(*call, *lists).stdout)) == 2
    target = tmp_path / "ranked.json"
    told = json.loads(run(*call, lists[0], "-o", target).stdout)
    assert told["output"] == [str(target)]
    assert told["lists"][0]["grasps"] == 1
    assert "a" in json.loads(run(*call, lists[0], "--explain", "a").stdout).popitem()[1]


def test_json_of_motions_schemas_and_shells(tmp_path: Path) -> None:
    """Texts travel inside JSON where there is no file."""
    path = tmp_path / "bin.h5"
    write_bin_map(path, toy_bin_map())
    told = json.loads(run("export", path, "--all", "--json").stdout)
    assert told["text"].startswith("# reachmap motions")
    told = json.loads(
        run("export", path, "--all", "--json", "-o", tmp_path / "m.csv").stdout
    )
    assert told == {"format": "csv", "motions": told["motions"],
                    "output": str(tmp_path / "m.csv")}  # fmt: skip
    plain, one_line = run("schema", "cell").stdout, run("schema", "cell", "--json")
    assert json.loads(plain) == json.loads(one_line.stdout)
    assert json.loads(run("completion", "fish", "--json").stdout)["shell"] == "fish"


def test_the_version_comes_with_engines_where_asked() -> None:
    """Before and after: the order of the two flags does not matter."""
    assert run("--version").stdout.splitlines() == ["reachmap 0.2.0"]
    for call in (["--version", "-v"], ["-v", "--version"], ["--verbose", "--version"]):
        lines = run(*call).stdout.splitlines()
        names = [line.split()[0] for line in lines]
        assert {"python", "numpy", "pin", "ompl", "eaik", "h5py"} <= set(names)


def completed(*words: str) -> list[str]:
    """What a shell is offered for the last of some words."""
    found = subprocess.run(
        [sys.executable, "-c", "from reachmap.cli import main; main()"],
        env={
            **os.environ,
            "_REACHMAP_COMPLETE": "bash_complete",
            "COMP_WORDS": " ".join(["reachmap", *words]),
            "COMP_CWORD": str(len(words)),
        },
        capture_output=True,
        text=True,
        check=True,
    )
    return [line.partition(",")[2] for line in found.stdout.splitlines()]


def test_shells_complete_cells_and_keys() -> None:
    """Names of shipped cells, and keys of the cell that is named, dot by dot."""
    assert "ur5-eye-in-hand" in completed("check", "ur")
    assert completed("check", "--set", "bin_sc") == ["bin_scan."]
    assert "bin_scan.grid=" in completed("check", "--set", "bin_scan.")
    assert completed("check", "planar-toy", "--set", "bodies.p") == ["bodies.post."]
    assert "workspace-scan" in completed("work")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts_name_the_command(shell: str) -> None:
    """What `eval "$(reachmap completion bash)"` runs."""
    script = run("completion", shell).stdout
    assert "_REACHMAP_COMPLETE" in script
    assert "reachmap" in script


@pytest.mark.parametrize("name", ["planar-toy", "ur5-eye-in-hand"])
def test_a_shipped_cell_is_exported_with_its_comments(
    name: str, tmp_path: Path
) -> None:
    """From any folder it is the same cell, ready to be edited."""
    target = tmp_path / "my-cell.yaml"
    assert run("cells", "--export", name, "-o", target).exit_code == 0
    assert "#" in target.read_text()
    assert read_cell(str(target)).sha256 == read_cell(name).sha256
    assert run("cells", "--export", name, "-o", target).exit_code == 2


def test_an_unknown_cell_to_export_is_said(tmp_path: Path) -> None:
    """Neither a shipped name nor a file."""
    result = run("cells", "--export", "ur7")
    assert result.exit_code != 0
