"""The commands run without options, one after the other, in one folder."""

from __future__ import annotations

import json

from tests.support.command_line import reachmap


def test_bin_scan_takes_the_cell_of_the_workspace_map(tmp_path):
    """Without a placement the bin stands where the scanned cell has it."""
    sizes = (
        "bin_scan.grid=[3,2]",
        "workspace_scan.cubes.0.grid=[8,4]",
        "workspace_scan.cubes.1.grid=[8,4]",
    )
    words = [word for size in sizes for word in ("--set", size)]
    scan = reachmap(tmp_path, "workspace-scan", "planar-toy", *words)
    assert scan.returncode == 0, scan.stderr
    result = reachmap(tmp_path, "bin-scan")
    assert result.returncode == 0, result.stderr
    assert "using the bin pose of workspace.h5" in result.stderr
    info = reachmap(tmp_path, "info", "bin.h5", "--json")
    assert "planar-toy" in info.stdout
    grasps = {
        "format": "reachmap.grasps",
        "format_version": "1.0",
        "frame": "bin",
        "grasps": [],
    }
    (tmp_path / "grasps.json").write_text(json.dumps(grasps))
    ranked = reachmap(tmp_path, "rank", "grasps.json")
    assert ranked.returncode == 0, ranked.stderr


def test_bin_scan_without_anything_takes_the_shipped_cell(tmp_path):
    """In an empty folder it is the shipped cell with its own bin."""
    result = reachmap(tmp_path, "bin-scan", "--dry-run", "--json")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["cell"] == "ur5-eye-in-hand"
