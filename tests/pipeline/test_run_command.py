"""`reachmap run`: the chain in one command, kept where it fits, refused where not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from reachmap.cli import group
from reachmap.maps import read_bin_map, read_placement, read_workspace_map

SIZES = (
    "bin_scan.grid=[3,2]",
    "workspace_scan.cubes.0.grid=[8,4]",
    "workspace_scan.cubes.1.grid=[8,4]",
)
SMALL = (
    *(word for size in SIZES for word in ("--set", size)),
    "-j",
    "1",
    "--no-progress",
)


def run(*arguments: object) -> Result:
    """Run the chain on the toy cell."""
    words = ["run", "planar-toy", *map(str, arguments), *SMALL]
    return CliRunner().invoke(group, words)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a finished chain and the list it ranked."""
    folder = tmp_path_factory.mktemp("chain")
    grasp = {"position": [0.0, 0.0, 0.2], "quaternion_wxyz": [1, 0, 0, 0]}
    document = {"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin"}
    (folder / "grasps.json").write_text(json.dumps({**document, "grasps": [grasp]}))
    result = run("-o", folder / "run", "--grasps", folder / "grasps.json")
    assert result.exit_code == 0, result.output
    return folder


def test_the_chain_is_made_one_from_the_other(folder: Path) -> None:
    """All artefacts, pictures, the ranked list and the page."""
    made = folder / "run"
    workspace = read_workspace_map(made / "workspace.h5")
    placement = read_placement(made / "placement.h5")
    bin_map = read_bin_map(made / "bin.h5")
    assert placement.provenance.source_sha256 == workspace.stamp.content_sha256
    assert bin_map.provenance.source_sha256 == placement.stamp.content_sha256
    ranked = json.loads((made / "ranked.json").read_text())
    assert ranked["reachmap"]["map_sha256"] == bin_map.stamp.content_sha256
    assert (made / "report.html").exists()
    assert any((made / "pictures").iterdir())


@pytest.mark.slow
def test_what_is_missing_alone_is_made_again(folder: Path) -> None:
    """The same command goes on after the last whole artefact."""
    made = folder / "run"
    before = (made / "workspace.h5").read_bytes()
    content = read_bin_map(made / "bin.h5").stamp.content_sha256
    (made / "bin.h5").unlink()
    pictures = sorted((made / "pictures").iterdir())
    pictures[0].unlink()
    answer = json.loads(run("-o", made, "--json").stdout)
    assert answer["made"] == [str(made / "bin.h5")]
    assert answer["kept"] == [str(made / "workspace.h5"), str(made / "placement.h5")]
    assert (made / "workspace.h5").read_bytes() == before
    assert read_bin_map(made / "bin.h5").stamp.content_sha256 == content
    pictures[0].unlink()
    kept = json.loads(run("-o", made, "--json").stdout)
    assert (kept["made"], len(kept["kept"])) == ([], 3)
    assert sorted((made / "pictures").iterdir()) == pictures


def test_another_cells_folder_is_refused(folder: Path) -> None:
    """Nothing is replaced unless asked for."""
    result = run("-o", folder / "run", "--seed", 99)
    assert result.exit_code == 2
    assert "workspace.h5: was made from another cell" in result.output


def test_a_wrong_list_is_refused_before_any_work(tmp_path: Path) -> None:
    """Minutes of scanning do not come first."""
    result = run("-o", tmp_path / "run", "--grasps", tmp_path / "none.json")
    assert result.exit_code == 2
    assert not (tmp_path / "run").exists()
