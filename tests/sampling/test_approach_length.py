"""How long approaches are, and where they begin, against the rim of the bin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.sampling.frames import (
    approach_distance_m,
    below_rim_m,
    bin_test_frames,
)
from reachmap.tools.check import check

CRATE = str(Path(__file__).parents[2] / "benchmarks/hard_cells/crate-ur5.yaml")
CLEAR = "bin_scan.approach_distance_m=clear_rim"


def heights_m(cell):
    """Heights above the bin's bottom at which the approaches begin."""
    T_base_bin = cell.T_base_bin()
    T = bin_test_frames(cell, T_base_bin).T_base_tcp.reshape(-1, 4, 4)
    begin = T[:, :3, 3] - approach_distance_m(cell) * T[:, :3, 2]
    return (begin - T_base_bin[:3, 3]) @ T_base_bin[:3, 2]


@pytest.mark.parametrize("yaw", [0, 35])
def test_clear_rim_begins_above_the_rim(yaw):
    """Every approach of the crate begins above its rim, the deepest just so."""
    turned = f"bin.pose.rpy_deg=[0,0,{yaw}]"
    cell = read_cell(CRATE, [CLEAR, turned]).cell
    assert heights_m(cell).min() == pytest.approx(cell.bin.inner[2] + 0.01, abs=1e-6)
    assert below_rim_m(cell) == pytest.approx(-0.01, abs=1e-6)
    deepest = (0.2 + 0.01 - 0.02) / np.cos(np.deg2rad(5))
    assert approach_distance_m(cell) == pytest.approx(deepest, abs=1e-6)


def test_a_short_approach_is_reported():
    """The crate's own 50 mm end 130 mm below the rim, and check says so."""
    cell = read_cell(CRATE).cell
    depth = cell.bin.inner[2] - heights_m(cell).min()
    assert below_rim_m(cell) == pytest.approx(depth, abs=1e-9)
    assert check(CRATE).below_rim_m == pytest.approx(depth, abs=1e-6)
    assert check(CRATE, [CLEAR]).below_rim_m < 0
