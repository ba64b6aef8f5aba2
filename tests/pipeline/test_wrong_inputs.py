"""Wrong inputs end in one clear line per mistake, exit code 2, and nothing touched."""

from __future__ import annotations

import os
import shutil
import subprocess

import pytest

from reachmap.cell.loading import shipped_cells
from tests.support.command_line import reachmap


def refused(result: subprocess.CompletedProcess[str], *words: str) -> list[str]:
    """Check a refusal and return its lines."""
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
    for word in words:
        assert word in result.stderr, result.stderr
    return [line for line in result.stderr.splitlines() if line.strip()]


@pytest.fixture
def toy(tmp_path):
    """A copy of the toy cell that may be spoilt."""
    cell = shipped_cells()["planar-toy"]
    shutil.copy(cell, tmp_path / "cell.yaml")
    shutil.copytree(cell.parent / "planar-toy", tmp_path / "planar-toy")
    return tmp_path


def test_four_mistakes_are_four_lines(toy):
    """Each mistake of a cell is a line with file, line, column and the value found."""
    text = (toy / "cell.yaml").read_text()
    text = text.replace("wall: 0.01", "wall: thin").replace("z_step: 0.1", "z_step: -1")
    text = text.replace("seed: 1", "sead: 1").replace("repeats: 2", "repeats: 0", 1)
    (toy / "cell.yaml").write_text(text)
    lines = refused(reachmap(toy, "workspace-scan", "cell.yaml"), "thin", "sead")
    assert len(lines) == 4
    assert all("cell.yaml:" in line for line in lines)
    assert not (toy / "workspace.h5").exists()


def test_a_missing_mesh_is_named(toy):
    """A body whose mesh is not there is a line that names the file."""
    text = (toy / "cell.yaml").read_text()
    text = text.replace(
        "shape: {cylinder: {radius: 0.01, length: 0.10}}",
        "shape: {mesh: {file: lost.stl}}",
    )
    (toy / "cell.yaml").write_text(text)
    refused(reachmap(toy, "workspace-scan", "cell.yaml"), "lost.stl", "cell.yaml:")


def test_a_scan_configuration_in_collision_names_the_bodies(toy):
    """A blocked start is refused with the two bodies that touch."""
    start = "scan_configuration.q_deg.joint_1=0"
    result = reachmap(toy, "workspace-scan", "cell.yaml", "--set", start)
    refused(result, "link_1", "post", "touches")


def test_a_map_of_the_wrong_kind_is_named(toy):
    """A workspace map where a bin map is expected says what it is."""
    cube = "{name: one, min: [0.2, 0, 0], max: [0.4, 0, 0], grid: [2, 1]}"
    coarse = f"workspace_scan.cubes=[{cube}]"
    scan = reachmap(toy, "workspace-scan", "cell.yaml", "--set", coarse)
    assert scan.returncode == 0, scan.stderr
    (toy / "grasps.json").write_text(
        '{"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin",'
        ' "grasps": []}'
    )
    result = reachmap(toy, "rank", "grasps.json", "--map", "workspace.h5")
    refused(result, "workspace.h5", "bin")
    refused(reachmap(toy, "bin-scan", "workspace.h5"), "workspace.h5", "placement")


def test_grasps_without_a_frame_are_refused(toy):
    """A grasp list must say which frame it is in."""
    (toy / "grasps.json").write_text(
        '{"format": "reachmap.grasps", "format_version": "1.0", "grasps": []}'
    )
    refused(reachmap(toy, "rank", "grasps.json"), "grasps.json", "frame")


def test_an_existing_output_is_left_alone(toy):
    """Without --overwrite the old file stays, byte for byte."""
    (toy / "workspace.h5").write_bytes(b"precious")
    refused(reachmap(toy, "workspace-scan", "cell.yaml"), "workspace.h5", "--overwrite")
    assert (toy / "workspace.h5").read_bytes() == b"precious"


def test_a_folder_that_cannot_be_written_is_named(toy):
    """A place that refuses is a line, before any work is done."""
    where = toy / "nowhere" / "w.h5"
    result = reachmap(toy, "workspace-scan", "cell.yaml", "-o", str(where))
    refused(result, "nowhere")
    if os.geteuid() != 0:
        locked = toy / "locked"
        locked.mkdir(mode=0o500)
        refused(
            reachmap(toy, "workspace-scan", "cell.yaml", "-o", str(locked / "w.h5"))
        )


def test_a_missing_input_names_the_command_that_makes_it(toy):
    """A command without its input says where that comes from."""
    refused(reachmap(toy, "bin-scan", "placement.h5"), "place-bin")
    refused(reachmap(toy, "heatmap"), "workspace.h5")
