"""``reachmap heatmap``: file names, tables, and what it refuses."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from reachmap.cli import group
from reachmap.maps import (
    read_workspace_map,
    write_bin_map,
    write_placement,
    write_workspace_map,
)
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_provenance,
    synthetic_workspace_map,
)
from tests.support.synthetic_parts import bin_with_parts

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A current folder with a workspace map of two levels, 3 × 4 points each."""
    monkeypatch.chdir(tmp_path)
    shares = np.arange(24).reshape(2, 3, 4) / 24.0
    write_workspace_map(tmp_path / "workspace.h5", synthetic_workspace_map(shares))
    return tmp_path


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the drawing out where only files and names matter."""
    monkeypatch.setattr("reachmap.plots.parts.files.figure_bytes", lambda *a, **k: PNG)
    for name in ("level", "overview", "reachability", "costs", "approach", "directions",
                 "clearance", "saturation", "causes", "placement"):  # fmt: skip
        monkeypatch.setattr(f"reachmap.plots.albums.draw_{name}", lambda *a, **k: None)


def run(*arguments: str) -> Result:
    """Run the command in this process."""
    return CliRunner().invoke(group, ["heatmap", *arguments])


def names(result: Result) -> list[str]:
    """File names printed on stdout."""
    assert result.exit_code == 0, result.output
    return result.stdout.splitlines()


def test_default_is_the_path_map_of_the_current_folder(folder: Path) -> None:
    """One picture per level and an overview, under the names of the contract."""
    written = names(run())
    assert written == [
        "heatmaps/path_z+0.00.png",
        "heatmaps/path_z+0.10.png",
        "heatmaps/path_overview.png",
        "heatmaps/causes.png",
    ]
    for name in written:
        assert (folder / name).read_bytes().startswith(PNG)
    assert sorted(p.name for p in (folder / "heatmaps").iterdir()) == sorted(
        Path(name).name for name in written
    )


@pytest.mark.usefixtures("undrawn")
def test_existing_pictures_are_kept_unless_told_otherwise(folder: Path) -> None:
    """Exit code 2 and nothing touched, not even the pictures that were missing."""
    (folder / "heatmaps").mkdir()
    existing = folder / "heatmaps" / "path_z+0.10.png"
    existing.write_text("mine")
    result = run()
    assert result.exit_code == 2
    assert "exists already" in result.stderr
    assert existing.read_text() == "mine"
    assert list((folder / "heatmaps").iterdir()) == [existing]
    names(run("--overwrite"))
    assert existing.read_bytes().startswith(PNG)


def test_same_map_same_bytes(folder: Path) -> None:
    """Pictures can be versioned: drawing again changes nothing."""
    names(run("--level", "0.1", "-o", "a"))
    names(run("--level", "0.1", "-o", "b"))
    first, second = (folder / n / "path_z+0.10.png" for n in "ab")
    assert first.read_bytes() == second.read_bytes()


def test_one_level_of_one_quantity(folder: Path) -> None:
    """The level is chosen by its height; there is no overview then."""
    assert names(run("--quantity", "ik-free", "--level", "0.1", "--format", "svg")) == [
        "heatmaps/ik-free_z+0.10.svg"
    ]
    text = (folder / "heatmaps" / "ik-free_z+0.10.svg").read_text()
    assert text.startswith("<?xml")


@pytest.mark.usefixtures("undrawn")
def test_all_quantities(folder: Path) -> None:
    """Four quantities, each with two levels and an overview."""
    written = names(run("--quantity", "all", "--level", "0"))
    assert [Path(name).stem for name in written] == [
        "path_z+0.00",
        "ik_z+0.00",
        "ik-free_z+0.00",
        "difference_z+0.00",
    ]


def test_unknown_level_lists_the_levels(folder: Path) -> None:
    """A height between levels is not rounded to one in silence."""
    result = run("--level", "0.05")
    assert result.exit_code == 2
    assert "no level at z = 0.05 m (levels: +0.00, +0.10)" in result.stderr
    assert not (folder / "heatmaps").exists()


@pytest.mark.usefixtures("undrawn")
def test_tables_hold_the_numbers_of_the_map(folder: Path) -> None:
    """A CSV per level, the largest y first, as the picture shows it."""
    written = names(run("--level", "0.1", "--csv"))
    assert written == ["heatmaps/path_z+0.10.png", "heatmaps/path_z+0.10.csv"]
    with (folder / written[1]).open(newline="") as stream:
        header, *rows = csv.reader(stream)
    workspace = read_workspace_map(folder / "workspace.h5")
    np.testing.assert_allclose([float(v) for v in header[1:]], workspace.x)
    table = np.array([[float(v) for v in row] for row in rows])
    np.testing.assert_allclose(table[:, 0], workspace.y[::-1])
    np.testing.assert_allclose(
        table[:, 1:], workspace.path_reachability[1, ::-1], atol=1e-6
    )


@pytest.mark.usefixtures("undrawn")
def test_bin_map_gives_the_pictures_of_a_bin(folder: Path) -> None:
    """Reachability, costs, approach directions, saturation; layers are named."""
    write_bin_map(folder / "bin.h5", synthetic_bin_map(shape=(1, 2, 3, 4, 2)))
    stems = [Path(name).stem for name in names(run("bin.h5"))]
    assert stems == [
        "bin_reachability",
        "bin_directions",
        "bin_costs",
        "bin_approach",
        "bin_saturation",
        "bin_causes",
    ]
    write_bin_map(folder / "two.h5", synthetic_bin_map(shape=(2, 1, 2, 3, 1)))
    stems = [Path(name).stem for name in names(run("two.h5", "-o", "two", "--csv"))]
    assert "bin_reachability_layer+0.05" in stems
    assert "bin_saturation" not in stems  # one attempt saturates nothing
    parts = bin_with_parts(synthetic_bin_map(shape=(1, 1, 2, 3, 1)))
    write_bin_map(folder / "parts.h5", parts)
    assert "bin_clearance.png" in [
        Path(n).name for n in names(run("parts.h5", "-o", "parts"))
    ]
    assert "bin_approach_layer+0.10" in stems
    assert (folder / "two" / "bin_reachability_layer+0.10.csv").is_file()


@pytest.mark.usefixtures("undrawn")
def test_placement_is_drawn_on_the_map_it_was_made_from(folder: Path) -> None:
    """Another map beside it is not used in silence."""
    source = read_workspace_map(folder / "workspace.h5").stamp.content_sha256
    fitting = synthetic_placement(provenance=synthetic_provenance(source_sha256=source))
    write_placement(folder / "placement.h5", fitting)
    assert names(run("placement.h5", "--csv")) == [
        "heatmaps/placement.png",
        "heatmaps/placement.csv",
    ]
    rows = (folder / "heatmaps" / "placement.csv").read_text().splitlines()
    assert len(rows) == 5
    assert rows[-1].endswith("the bin collides with pedestal")
    write_placement(folder / "other.h5", synthetic_placement())
    result = run("other.h5", "-o", "other")
    assert names(result) == ["other/placement.png"]
    assert "not the map that other.h5 was made from" in result.stderr
    result = run("other.h5", "--workspace", "workspace.h5", "-o", "third")
    assert result.exit_code == 2
    assert not (folder / "third").exists()


def test_placement_without_a_map_is_drawn_by_itself(folder: Path) -> None:
    """The candidates and the bin, and a word that the map is missing."""
    (folder / "workspace.h5").unlink()
    write_placement(folder / "placement.h5", synthetic_placement())
    result = run("placement.h5")
    assert names(result) == ["heatmaps/placement.png"]
    assert "drawn without a map" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["missing.h5"], "missing.h5: no such file"),
        (["notes.txt"], "notes.txt: "),
        (["bin.h5", "--quantity", "ik"], "--quantity and --level are for workspace"),
        (["bin.h5", "--level", "0"], "--quantity and --level are for workspace"),
        (["workspace.h5", "--workspace", "workspace.h5"], "--workspace is for"),
        (["-o", "notes.txt"], "notes.txt: "),
        (["--level", "nan"], "'nan' is not a finite number"),
        (["--cmap", "jet"], "'jet' is not one of"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(
    folder: Path, arguments: list[str], message: str
) -> None:
    """No traceback, nothing written."""
    (folder / "notes.txt").write_text("no artefact")
    write_bin_map(folder / "bin.h5", synthetic_bin_map(shape=(1, 1, 2, 2, 1)))
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert "Traceback" not in result.output
    assert not (folder / "heatmaps").exists()


def test_map_with_a_cell_of_another_kind_is_drawn(folder: Path) -> None:
    """An artefact whose cell this version cannot read still gives its numbers."""
    workspace = synthetic_workspace_map(np.full((1, 2, 2), 0.5))
    strange = synthetic_provenance(cell_resolved_json="{}")
    write_workspace_map(folder / "s.h5", replace(workspace, provenance=strange))
    assert len(names(run("s.h5"))) == 3
