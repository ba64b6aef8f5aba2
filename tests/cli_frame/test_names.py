"""Names that no file can have are wrong inputs, wherever one is given."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from toy_artefacts import toy_bin_map, toy_workspace

from reachmap.cell.loading import cell_from_text, shipped_cells
from reachmap.cli import group
from reachmap.cli.table import COMMANDS
from reachmap.errors import CellError
from reachmap.maps import write_bin_map, write_workspace_map

LONG = "a" * 300
NO_INPUT_FILE = {"cells", "schema"}
INPUTS = {
    **{name: (LONG,) for name in COMMANDS if name not in NO_INPUT_FILE},
    "compare": (LONG, LONG),
    "merge": (LONG, "-o", "bin.h5"),
    "validate": (LONG, "grasps.json"),
}
GRASPS = '{"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin", '
OUTPUTS = {
    "workspace-scan": ("planar-toy",),
    "heatmap": ("workspace.h5",),
    "place-bin": ("workspace.h5",),
    "bin-scan": ("--cell", "planar-toy"),
    "rank": ("grasps.json", "--map", "bin.h5"),
    "merge": ("some.journal",),
}


def refuse(*arguments: str) -> str:
    """Run a command that must end as a wrong input does; returns its complaint."""
    result = CliRunner().invoke(group, list(arguments))
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    return result.stderr


@pytest.mark.parametrize("command", INPUTS)
def test_an_input_with_an_impossible_name(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name longer than a file may have is named back, without a traceback."""
    monkeypatch.chdir(tmp_path)
    assert LONG[:100] in refuse(command, *INPUTS[command])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", OUTPUTS)
def test_an_output_with_an_impossible_name(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is refused before anything is computed or written."""
    monkeypatch.chdir(tmp_path)
    write_workspace_map(tmp_path / "workspace.h5", toy_workspace())
    write_bin_map(tmp_path / "bin.h5", toy_bin_map())
    (tmp_path / "grasps.json").write_text(GRASPS + '"grasps": []}')
    before = sorted(tmp_path.iterdir())
    assert LONG in refuse(command, *OUTPUTS[command], "-o", f"{LONG}.out")
    assert sorted(tmp_path.iterdir()) == before


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
