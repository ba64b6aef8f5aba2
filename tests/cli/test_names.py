"""Names that are not those of files are wrong inputs, wherever one is given."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from reachmap.cell.loading import cell_from_text, shipped_cells
from reachmap.cli import group
from reachmap.cli.group import COMMANDS
from reachmap.errors import CellError
from reachmap.maps import write_bin_map, write_workspace_map
from tests.support.toy_artefacts import toy_bin_map, toy_workspace

LONG = "a" * 300
LOOP = "loop"  # a link to itself
ODD = (LONG, LOOP, "folder", ".", "/")
INPUTS = [name for name in COMMANDS if name not in {"cells", "schema", "report"}]
GRASPS = '{"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin", '
OUTPUTS = {
    "workspace-scan": ("planar-toy",),
    "heatmap": ("workspace.h5",),
    "place-bin": ("workspace.h5",),
    "bin-scan": ("--cell", "planar-toy"),
    "study": ("planar-toy", "--vary", "seed=1,2"),
    "rank": ("grasps.json", "--map", "bin.h5"),
    "merge": ("some.journal",),
}
FOLDER_TOO = ("heatmap", "rank")


def refuse(*arguments: str) -> str:
    """Run a command that must end as a wrong input does; returns its complaint."""
    result = CliRunner().invoke(group, list(arguments))
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    return result.stderr


@pytest.fixture(scope="module")
def maps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a map of each scan."""
    folder = tmp_path_factory.mktemp("maps")
    write_workspace_map(folder / "workspace.h5", toy_workspace())
    write_bin_map(folder / "bin.h5", toy_bin_map())
    return folder


@pytest.fixture
def here(maps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder: maps, an empty list, and things that are no files."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(maps, tmp_path, dirs_exist_ok=True)
    (tmp_path / "grasps.json").write_text(GRASPS + '"grasps": []}')
    (tmp_path / LOOP).symlink_to(LOOP)
    (tmp_path / "folder").mkdir()
    return tmp_path


@pytest.mark.parametrize("name", ODD)
@pytest.mark.parametrize("command", INPUTS)
def test_an_input_that_is_no_file(command: str, name: str, here: Path) -> None:
    """It is named back, without a traceback, and nothing is written."""
    before = sorted(here.iterdir())
    new = ("-o", "new.h5")
    more: dict[str, tuple[str, ...]] = dict.fromkeys(
        ("merge", "workspace-scan", "bin-scan"), new
    )
    more["validate"] = ("grasps.json",)
    more["export"] = ("--all",)
    more["study"] = ("--vary", "seed=1,2")
    more["robust"] = ("--tool", "2mm")
    arguments = (name, *more.get(command, ()))
    if command == "compare":
        arguments = (name, "bin.h5")
    assert name[:100] in refuse(command, *arguments)
    assert sorted(here.iterdir()) == before


@pytest.mark.parametrize(
    ("name", "why"),
    [
        (LONG, "no such folder"),
        (LOOP, "no such folder"),
        ("grasps.json", "is a file; a report is made of the folder that holds it"),
    ],
)
def test_a_report_of_no_folder(name: str, why: str, here: Path) -> None:
    """A report is made from a folder."""
    assert f"{name}: {why}" in refuse("report", name)


@pytest.mark.parametrize("name", ["bin.h5", LOOP, "/dev/null", *ODD])
def test_grasps_that_are_no_list(name: str, here: Path) -> None:
    """The list to validate may be as wrong as the map."""
    assert name[:100] in refuse("validate", "bin.h5", name)


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (command, name)
        for command in OUTPUTS
        for name in (f"{LONG}.out", ".", "/")
        if name == f"{LONG}.out" or command not in FOLDER_TOO
    ],
)
def test_an_output_that_can_be_no_file(command: str, name: str, here: Path) -> None:
    """It is refused before anything is computed or written."""
    before = sorted(here.iterdir())
    assert name in refuse(command, *OUTPUTS[command], "-o", name)
    assert sorted(here.iterdir()) == before


@pytest.mark.parametrize("reference", [f"package://{LONG}/x.urdf", f"{LONG}.urdf"])
def test_a_reference_with_an_impossible_name(reference: str, tmp_path: Path) -> None:
    """In a cell it is a mistake at its line."""
    text = shipped_cells()["planar-toy"].read_text()
    text = text.replace("planar-toy/planar_arm.urdf", reference)
    with pytest.raises(CellError, match=r"robot\.urdf: .*not found"):
        cell_from_text(text, label="cell.yaml", directory=tmp_path)


def test_an_output_that_must_be_named() -> None:
    """Without it the command says which option is missing."""
    assert "Missing option '-o' / '--output'" in refuse("merge", "some.journal")
