"""Other arms than the UR5 go through the whole pipeline, unchanged."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from reachmap.maps.format.registry import read_artefact
from reachmap.maps.records import BinMap, Status, WorkspaceMap
from tests.support.command_line import reachmap

EXAMPLE = Path(__file__).parents[2] / "examples" / "pile-2.json"
SMALL = (
    "workspace_scan.z_step=0.7",
    "workspace_scan.cubes.right.grid=[4,3]",
    "workspace_scan.cubes.left.grid=[4,3]",
    "bin_scan.grid=[4,3]",
    "bin_scan.repeats=1",
)


def overrides(*values: str) -> list[str]:
    """The values as options."""
    return [word for value in values for word in ("--set", value)]


def done(folder: Path, *arguments: str, timeout: float = 300.0) -> str:
    """Run a command that must succeed and return its answer."""
    result = reachmap(folder, *arguments, timeout=timeout)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_a_seven_joint_map_says_that_it_is_approximate(tmp_path):
    """The sampled joint and the number of its values are stored and said."""
    cube = "{name: a, min: [0.3, 0, 0.1], max: [0.5, 0, 0.1], grid: [2, 1]}"
    tiny = (f"workspace_scan.cubes=[{cube}]", "workspace_scan.orientations.rolls=1")
    done(tmp_path, "workspace-scan", "panda-eye-in-hand", "-j", "1", *overrides(*tiny))
    said = done(tmp_path, "info", "workspace.h5").replace("\n", " ")
    assert "inverse kinematics is approximate (panda_joint7 sampled at 25" in said
    stored = json.loads(done(tmp_path, "info", "workspace.h5", "--json"))["settings"]
    assert stored["ik_method"] == "redundant-grid"
    assert stored["ik_complete"] is False
    assert "panda_joint7 sampled at 25 values" in stored["ik_approximation"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cell", "joints"), [("ur10-eye-in-hand", 6), ("panda-eye-in-hand", 7)]
)
def test_another_arm_goes_through_the_whole_pipeline(tmp_path, cell, joints):
    """From the cell to the report; every map holds what the arm's geometry allows."""
    done(tmp_path, "workspace-scan", cell, "-j", "1", *overrides(*SMALL))
    for command in ("heatmap", "place-bin", "bin-scan"):
        done(tmp_path, command, *(() if command == "heatmap" else ("-j", "1")))
    done(tmp_path, "heatmap", "bin.h5", "-o", "bin-pictures")
    done(tmp_path, "rank", str(EXAMPLE), "-o", "ranked.json", "--chart", "chart.png")
    done(tmp_path, "report", ".", "-o", "report.html")
    done(tmp_path, "verify", "workspace.h5", "placement.h5", "bin.h5")

    workspace = read_artefact(tmp_path / "workspace.h5")
    assert isinstance(workspace, WorkspaceMap)
    assert len(workspace.joint_names) == joints
    free, path = workspace.ik_free_reachability, workspace.path_reachability
    assert np.nanmax(path) > 50.0
    assert (path <= free + 1e-9).all()
    assert (free <= workspace.ik_reachability + 1e-9).all()

    bin_map = read_artefact(tmp_path / "bin.h5")
    assert isinstance(bin_map, BinMap)
    reached = bin_map.status == Status.PATH_FOUND
    assert 0.2 < reached.mean() < 1.0, "the tool fits into most of the bin"
    with h5py.File(tmp_path / "bin.h5") as file:
        assert file["paths/configuration"].shape[1] == joints

    grasps = json.loads((tmp_path / "ranked.json").read_text())["grasps"]
    costs = [grasp["reachmap"]["cost"] for grasp in grasps]
    ranked = [cost for cost in costs if cost is not None]
    assert len(ranked) > len(grasps) / 2
    assert costs == sorted(ranked) + [None] * (len(costs) - len(ranked))
