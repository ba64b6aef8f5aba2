"""How many modules a reader walks through to follow one list, or one test grasp."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from reachmap.cli import group
from reachmap.maps import write_bin_map
from tests.support.journeys import journey
from tests.support.ranking_maps import make_bin_map


def run(*arguments: str) -> None:
    """Run a command in this process."""
    result = CliRunner().invoke(group, list(arguments))
    assert result.exit_code == 0, result.output


def test_a_grasp_list_is_ranked_by_few_modules(tmp_path: Path) -> None:
    """From the command line to the answer, the check of the map included."""
    bin_map, grasps = tmp_path / "bin.h5", tmp_path / "grasps.json"
    write_bin_map(bin_map, make_bin_map(shape=(1, 2, 3)))
    grasp = {"position": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, -1.0]}
    header = {"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin"}
    grasps.write_text(json.dumps({**header, "grasps": [grasp]}))
    with journey() as found:
        run("rank", str(grasps), "--map", str(bin_map))
    assert len(found.files) <= 42, sorted(found.files)


@pytest.mark.slow
def test_a_test_grasp_is_decided_by_few_modules(tmp_path: Path) -> None:
    """Whatever the rest of the scan has to do before and after."""
    with journey("src/reachmap/scans/bin_scan.py:plan_unit") as found:
        run("bin-scan", "--cell", "planar-toy", "--set", "bin_scan.grid=[2,1]",
            "-j", "1", "-o", str(tmp_path / "bin.h5"))  # fmt: skip
    assert 0 < len(found.in_unit) <= 30, sorted(found.in_unit)


@pytest.mark.slow
def test_a_cell_is_scanned_by_few_modules(tmp_path: Path) -> None:
    """From the path of the cell to its workspace map."""
    cell = Path(__file__).parents[2] / "cells" / "planar-toy.yaml"
    with journey() as found:
        run("workspace-scan", str(cell), "-j", "1", "-o", str(tmp_path / "map.h5"))
    assert len(found.files) <= 95, sorted(found.files)
