"""Where the roll is free, the cycle takes the one at which it is quickest."""

from __future__ import annotations

import numpy as np

from reachmap.maps import read_bin_map
from reachmap.runtime.options import RunOptions
from reachmap.tools.bin_scan import bin_scan

# One point in the middle of a container, half full.
SMALL = (
    "bin_scan.grid=[1, 1]",
    "bin_scan.fill=[0.45]",
    "bin_scan.repeats=1",
    "bin_scan.orientations={family: cone, tilts_deg: [20], azimuths: [8], rolls: 1}",
)


def scan(path, *overrides):
    """Scan the deep container with a part and a conveyor."""
    bin_scan(
        None,
        path,
        cell="ur10-deep-conveyor",
        overrides=(*SMALL, *overrides),
        run=RunOptions(quiet=True, workers=1),
    )
    return read_bin_map(path)


def test_a_quicker_roll_is_taken(tmp_path):
    """As listed the wrist takes half a turn there and back; with a free roll, none.

    The ways in stay as they are without a part.
    """
    listed = scan(tmp_path / "listed.h5", "tool.roll=listed")
    free = scan(tmp_path / "free.h5")
    both = np.isfinite(listed.cycle.cycle_time)
    assert both.any()
    saved_s = listed.cycle.cycle_time[both] - free.cycle.cycle_time[both]
    assert (saved_s > 0.5).all()
    assert (np.abs(free.winning_roll[both]) > 0.1).all()
    plain = scan(tmp_path / "plain.h5", "part=null")
    for name in ("status", "path_found", "path_length", "connected"):
        np.testing.assert_array_equal(getattr(free, name), getattr(plain, name))
