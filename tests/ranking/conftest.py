"""A folder with a bin map and grasp lists, as a user would have it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reachmap.maps import write_bin_map
from tests.support.ranking_maps import make_bin_map

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="session")
def map_file(tmp_path_factory):
    """A bin map with more than half of its test grasps unreachable."""
    path = tmp_path_factory.mktemp("map") / "bin.h5"
    write_bin_map(path, make_bin_map(shape=(1, 6, 8), seed=11, reachable=0.4))
    return path


@pytest.fixture
def folder(tmp_path, map_file, monkeypatch):
    """The current folder, with bin.h5, pile-1.json, pile-2.json and one far grasp."""
    (tmp_path / "bin.h5").symlink_to(map_file)
    for name in ("pile-1.json", "pile-2.json"):
        (tmp_path / name).write_bytes((EXAMPLES / name).read_bytes())
    far = json.loads((tmp_path / "pile-1.json").read_text())
    far["grasps"] = far["grasps"][:3]
    far["grasps"][1]["position"] = [1.0, 0.0, 0.05]
    (tmp_path / "far.json").write_text(json.dumps(far))
    monkeypatch.chdir(tmp_path)
    return tmp_path
