"""A bin map of the planar toy arm, and grasps whose reachability is known."""

from __future__ import annotations

import json

import pytest

from reachmap.tools.bin_scan import bin_scan
from tests.support.toy_truth import OVERRIDES, clear_rows, toy_grasps


@pytest.fixture(scope="session")
def toy_map(tmp_path_factory):
    """The map of the toy cell, its bin at the edge of what the arm reaches."""
    path = tmp_path_factory.mktemp("toy") / "bin.h5"
    bin_scan(None, path, cell="planar-toy", overrides=OVERRIDES)
    return path


@pytest.fixture
def folder(tmp_path, toy_map, monkeypatch):
    """The current folder, with bin.h5 and a list of eight toy grasps."""
    (tmp_path / "bin.h5").symlink_to(toy_map)
    rows = clear_rows(8, seed=2)
    (tmp_path / "toy.json").write_text(json.dumps(toy_grasps(rows)))
    monkeypatch.chdir(tmp_path)
    return tmp_path
