"""A unit of a real bin scan that kills its workers."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.errors import IncompleteError
from reachmap.maps import Status, read_bin_map
from reachmap.runtime.options import RunOptions
from reachmap.scans.bin_scan import GRASPS_PER_UNIT
from reachmap.tools import bin_scan as tool
from tests.support import poisoned_bin

FEW = ("bin_scan.grid=[3,2]", "bin_scan.repeats=1", "bin_scan.approach_distance_m=0")


@pytest.mark.slow
def test_everything_but_the_poisoned_unit_is_there(tmp_path, monkeypatch):
    """It is marked as an error; the same command without the poison completes it."""
    cell, path = "ur5-eye-in-hand", tmp_path / "b.h5"
    tool.bin_scan(None, tmp_path / "whole.h5", cell=cell, overrides=FEW)
    whole = read_bin_map(tmp_path / "whole.h5")
    run = RunOptions(workers=2)
    with monkeypatch.context() as poison:
        poison.setattr(tool, "bin_work", poisoned_bin.bin_work)
        with pytest.raises(IncompleteError, match=r"b\.h5") as failure:
            tool.bin_scan(None, path, cell=cell, overrides=FEW, run=run)
    assert failure.value.exit_code == 3
    part = read_bin_map(path)
    lost = np.zeros(whole.status.shape, bool)
    first = poisoned_bin.POISONED * GRASPS_PER_UNIT
    lost.flat[first : first + GRASPS_PER_UNIT] = True
    assert lost.sum() == GRASPS_PER_UNIT
    assert (part.status[lost] == Status.ERROR).all()
    np.testing.assert_array_equal(part.status[~lost], whole.status[~lost])
    np.testing.assert_array_equal(part.path_length[~lost], whole.path_length[~lost])
    tool.bin_scan(None, path, cell=cell, overrides=FEW, run=run)
    assert read_bin_map(path).stamp.content_sha256 == whole.stamp.content_sha256
