"""A map holds for its own cell, wherever its bin was placed, and for no other."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.errors import MapFileError
from reachmap.geometry import yaw_transform
from reachmap.maps import write_bin_map
from reachmap.maps.records import Provenance
from reachmap.ranking.answers.cell_check import differing_sections
from reachmap.tools.rank import rank
from tests.support.ranking_maps import make_bin_map

CELL = "ur5-eye-in-hand"


@pytest.fixture(scope="module")
def loaded():
    """The shipped cell."""
    return read_cell(CELL)


@pytest.fixture(scope="module")
def bin_map(loaded):
    """A map of the shipped cell after its bin was placed."""
    scan = dict.fromkeys(loaded.scan_configuration_rad, 0.1)
    placed = loaded.with_changes(
        bin_pose=yaw_transform(0.6, -0.1, 0.02, 0.7), scan_configuration_rad=scan
    )
    made = make_bin_map(shape=(1, 3, 3))
    provenance = Provenance(
        cell_yaml=placed.text,
        cell_resolved_json=placed.resolved_json,
        urdf=placed.urdf,
        srdf=placed.srdf,
        files_sha256=placed.files_sha256,
    )
    stamp = dataclasses.replace(made.stamp, cell_sha256=placed.sha256)
    return dataclasses.replace(made, provenance=provenance, stamp=stamp)


def test_the_own_cell_agrees_although_its_bin_was_placed(bin_map, loaded):
    """Bin pose and scan configuration are results of the pipeline, not the cell."""
    assert bin_map.stamp.cell_sha256 != loaded.sha256
    assert differing_sections(bin_map, loaded) == []


@pytest.mark.parametrize(
    ("override", "sections"),
    [
        ("bin_scan.repeats=1", []),
        ("seed=5", []),
        ("robot.tcp.xyz=[0, 0, 0.21]", ["robot"]),
        ("bin.wall=0.01", ["bin"]),
        ("collision.safety_margin_m=0.01", ["collision"]),
        ("camera=null", ["camera"]),
    ],
)
def test_other_cells_differ_in_named_sections(bin_map, override, sections):
    """Settings of scans are let pass; robot, bodies, bin and margins are not."""
    other = read_cell(CELL, [override])
    assert differing_sections(bin_map, other) == sections


def test_another_robot_description_differs(bin_map, loaded):
    """The same cell text on other meshes is another cell."""
    changed = dict.fromkeys(loaded.files_sha256, "0" * 64)
    provenance = dataclasses.replace(bin_map.provenance, files_sha256=changed)
    other = dataclasses.replace(bin_map, provenance=provenance)
    assert differing_sections(other, loaded) == ["the robot description or a mesh"]


def test_the_tool_refuses_and_can_be_forced(bin_map, tmp_path, caplog):
    """A map of another cell is refused with the difference; force warns instead."""
    path = tmp_path / "bin.h5"
    write_bin_map(path, bin_map)
    (tmp_path / "g.json").write_text(
        '{"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin", '
        '"grasps": [{"position": [0, 0, 0.05], "direction": [0, 0, -1]}]}'
    )
    how = {"map_path": path, "cell": CELL, "overrides": ["bin.wall=0.01"]}
    with pytest.raises(MapFileError, match=r"another cell .*\(different: bin\)"):
        rank([tmp_path / "g.json"], **how)
    with caplog.at_level(logging.WARNING, logger="reachmap"):
        answer = rank([tmp_path / "g.json"], **how, force=True)
    assert "different: bin" in caplog.text
    assert len(answer.documents[0]["grasps"]) == 1
    assert np.isfinite(answer.documents[0]["grasps"][0]["reachmap"]["distance"])
    rank([tmp_path / "g.json"], map_path=path, cell=CELL)
