"""``reachmap cells --export``: from an artefact back to a cell file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from reachmap.cell.loading import LoadedCell, read_cell
from reachmap.cli import group
from reachmap.geometry import yaw_transform
from reachmap.maps import (
    BinPlacement,
    Stamp,
    collect_provenance,
    write_placement,
)


@pytest.fixture
def placed(tmp_path: Path) -> tuple[Path, LoadedCell]:
    """A placement.h5 of the toy cell with another bin pose, and that cell."""
    T_base_bin = yaw_transform(0.2, 0.3, -0.2, 0.4)
    loaded = read_cell("planar-toy", ["seed=9"]).with_changes(
        bin_pose=T_base_bin,
        scan_configuration_rad={"joint_1": 1.5, "joint_2": 0.1, "joint_3": 1 / 3},
    )
    record = BinPlacement(
        bin_pose=T_base_bin,
        scan_configuration=np.array([1.5, 0.1, 1 / 3]),
        chosen=0,
        runner_up=-1,
        paper_choice=-1,
        rule="search",
        candidate_pose=np.array([[0.2, 0.3, -0.2, 0.4]]),
        score=np.array([80.0]),
        worst_point=np.array([10.0]),
        reachable_share=np.array([70.0]),
        exact=np.ones(1, np.uint8),
        reason=("",),
        margin={"+x": 0.1},
        joint_names=("joint_1", "joint_2", "joint_3"),
        stamp=Stamp(seed=9, cell_sha256=loaded.sha256, config_sha256="c" * 64),
        provenance=collect_provenance(loaded, settings={}),
    )
    path = tmp_path / "placement.h5"
    write_placement(path, record)
    return path, loaded


def test_the_exported_cell_is_the_cell_of_the_artefact(
    placed: tuple[Path, LoadedCell], tmp_path: Path
) -> None:
    """Bin pose, scan configuration and overrides are in it, to the last digit."""
    path, loaded = placed
    output = tmp_path / "cell.yaml"
    result = CliRunner().invoke(
        group, ["cells", "--export", str(path), "-o", str(output)]
    )
    assert result.exit_code == 0, result.stderr
    exported = read_cell(str(output))
    assert exported.cell == loaded.cell
    assert exported.sha256 == loaded.sha256
    assert output.read_text().startswith("# Cell of placement.h5")


def test_export_without_output_prints(placed: tuple[Path, LoadedCell]) -> None:
    """The YAML alone is on standard output."""
    path, loaded = placed
    result = CliRunner().invoke(group, ["cells", "--export", str(path)])
    target = path.with_name("printed.yaml")
    target.write_text(result.stdout)
    assert read_cell(str(target)).sha256 == loaded.sha256


def test_export_leaves_existing_files_alone(
    placed: tuple[Path, LoadedCell], tmp_path: Path
) -> None:
    """Without --overwrite it is refused, and so is what is no artefact."""
    output = tmp_path / "cell.yaml"
    output.write_text("mine")
    arguments = ["cells", "--export", str(placed[0]), "-o", str(output)]
    result = CliRunner().invoke(group, arguments)
    assert result.exit_code == 2
    assert "--overwrite" in result.stderr
    assert output.read_text() == "mine"
    assert CliRunner().invoke(group, [*arguments, "--overwrite"]).exit_code == 0
    result = CliRunner().invoke(group, ["cells", "--export", str(output)])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert CliRunner().invoke(group, ["cells", "-o", "x.yaml"]).exit_code == 2
