"""Cubes of different lattices make one map."""

from __future__ import annotations

import json

from tests.support.command_line import reachmap

CUBES = (
    "[{name: a, min: [0.2, -0.4, 0], max: [0.6, 0, 0], grid: [2, 2]},"
    " {name: b, min: [0.2, 0, 0], max: [0.6, 0.4, 0], grid: [4, 3]}]"
)


def test_cubes_of_different_lattices_are_summarised(tmp_path):
    """Squares that neither cube has count for no level's mean."""
    cubes = f"workspace_scan.cubes={CUBES}"
    scan = ("workspace-scan", "planar-toy", "-j", "1", "--set", cubes, "--json")
    result = reachmap(tmp_path, *scan)
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    info = json.loads(reachmap(tmp_path, "info", "workspace.h5", "--json").stdout)
    level = info["summary"]["levels"][0]
    assert answer["best_level_percent"] == round(level["path_percent"], 2)
    assert 0 < answer["best_level_percent"] < 100
