"""Where the bin may stand: intersections, fixed values, and clear refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reachmap.cell.model.scans import PlacementSpec
from reachmap.errors import SettingsError
from reachmap.placement.predicted.region import AXES, region_of

LATTICE = {
    "x": np.linspace(0.0, 1.0, 11),
    "y": np.linspace(-0.8, 0.8, 9),
    "z": np.linspace(-0.4, 0.6, 11),
}


def test_the_map_is_the_region_where_nothing_else_is_said():
    """Without limits the bin may stand wherever there is a map, at any angle."""
    region = region_of(PlacementSpec(), LATTICE)
    assert np.allclose(region.low, [0.0, -0.8, -0.4, 0.0])
    assert np.allclose(region.high, [1.0, 0.8, 0.6, np.pi])
    assert not any(region.fixed(name) for name in AXES)


def test_cell_and_user_are_intersected():
    """The narrower limit of the cell and the user counts on each side."""
    region = region_of(
        PlacementSpec(x=(0.2, 0.7)), LATTICE, limits={"x": (0.1, 0.5), "y": (0.0, 2.0)}
    )
    assert (region.low[0], region.high[0]) == (0.2, 0.5)
    assert (region.low[1], region.high[1]) == (0.0, 0.8)


def test_a_fixed_value_leaves_the_others():
    """--fix pins one value and nothing else."""
    region = region_of(PlacementSpec(), LATTICE, fixed={"z": 0.05})
    assert [region.fixed(name) for name in AXES] == [False, False, True, False]
    assert region.low[2] == region.high[2] == 0.05


@pytest.mark.parametrize(
    ("limits", "fixed", "words"),
    [
        ({"x": (2.0, 3.0)}, {}, r"x from 2 to 3.*only from 0 to 1"),
        ({"y": (0.5, 0.1)}, {}, r"y from 0\.5 to 0\.1"),
        ({}, {"z": 5.0}, r"z = 5.*only from -0\.4 to 0\.6"),
        ({"x": (0.2, 0.8)}, {"x": 0.9}, r"x = 0\.9.*only from 0\.2 to 0\.8"),
    ],
)
def test_nothing_left_is_refused_with_the_numbers(limits, fixed, words):
    """A region outside the map, turned round or contradicted names both ranges."""
    with pytest.raises(SettingsError, match=words):
        region_of(PlacementSpec(), LATTICE, limits=limits, fixed=fixed)


@given(
    yaw=st.floats(-10.0, 10.0),
    low=st.floats(0.0, 90.0),
    width=st.floats(0.0, 90.0),
)
def test_half_a_turn_is_the_same_bin(yaw, low, width):
    """A yaw is inside if any number of half turns brings it into the range."""
    region = region_of(PlacementSpec(yaw_deg=(low, low + width)), LATTICE)
    turned = yaw + np.pi * np.arange(-12, 13)
    inside = (turned >= region.low[3]) & (turned <= region.high[3])
    near = np.abs(turned[:, None] - [region.low[3], region.high[3]]).min() < 1e-6
    outside = region.outside(np.array([0.5, 0.0, 0.0, yaw]))
    assert near or (outside == "") == bool(inside.any())


def test_the_first_value_outside_is_named():
    """A pose outside in several values is blamed on the first."""
    region = region_of(PlacementSpec(), LATTICE)
    assert region.outside(np.array([0.5, 0.0, 0.0, 0.0])) == ""
    assert region.outside(np.array([0.5, 0.9, 0.9, 0.0])) == "y"
