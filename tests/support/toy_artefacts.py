"""Real artefacts of the planar toy arm, made once per process in a second or two."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

from reachmap.maps.records import BinMap, WorkspaceMap
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.workspace_scan import workspace_scan

CUBE = '{"name":"all","min":[-0.6,-0.6,0],"max":[0.6,0.6,0],"grid":[7,7]}'
# A thicker post blocks a third of the first joint, and both solutions of some frames.
POST = "bodies.post.shape.cylinder.radius=0.035"
WORKSPACE = (f"workspace_scan.cubes=[{CUBE}]", POST)
BIN = ("bin_scan.grid=[3,2]", "bin_scan.repeats=2")


@cache
def toy_workspace() -> WorkspaceMap:
    """A workspace map with reachable and colliding frames."""
    with tempfile.TemporaryDirectory() as folder:
        made = workspace_scan(
            "planar-toy", Path(folder) / "workspace.h5", overrides=WORKSPACE
        )
    assert made is not None
    return made


@cache
def toy_bin_map() -> BinMap:
    """A bin map with stored paths."""
    with tempfile.TemporaryDirectory() as folder:
        made = bin_scan(None, Path(folder) / "bin.h5", cell="planar-toy", overrides=BIN)
    assert made is not None
    return made
