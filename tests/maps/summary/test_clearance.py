"""What is left of a map where paths must keep a distance, against a count."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from reachmap.cli.text.info import info_text
from reachmap.maps import write_bin_map
from reachmap.maps.parts import Margins
from reachmap.maps.summary.bin import clearance_shares
from reachmap.tools.info import info
from tests.support.synthetic_maps import synthetic_bin_map


def a_map(clearance):
    """A map of test grasps (nl, ny, nx, no) with a clearance each, NaN: no path."""
    record = synthetic_bin_map(np.isfinite(clearance)[..., None])
    values = np.where(np.isfinite(clearance), 0.5, np.nan)
    margins = Margins(
        clearance=clearance,
        clearance_pair=np.where(np.isfinite(clearance), 0, -1),
        joint_margin=values,
        smallest_singular_value=values,
    )
    return dataclasses.replace(record, margins=margins)


def test_shares_are_of_all_test_grasps(tmp_path):
    """Grasps without a path have no room, and the text says what is left."""
    clearance = np.full((1, 2, 2, 5), np.nan)
    clearance.flat[:9] = np.array([2, 3, 4, 4.9, 5, 6, 9, 10, 40]) / 1e3
    shares = clearance_shares(a_map(clearance))
    assert [share.frames for share in shares] == pytest.approx([45.0, 25.0, 10.0])
    write_bin_map(tmp_path / "bin.h5", a_map(clearance))
    text = info_text(info(tmp_path / "bin.h5"))
    assert "   5 mm  25.0 %" in text


def test_maps_without_clearance_say_nothing():
    """Files of version 1.0 hold no margins."""
    assert clearance_shares(synthetic_bin_map(np.ones((1, 2, 2, 3, 1), bool))) == ()
