"""Margins as terms of J: told apart by hand, and without effect unless asked for."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from reachmap.errors import SettingsError
from reachmap.maps.records import BinMap
from reachmap.ranking import Ranker
from reachmap.ranking.lookup.settings import MARGINS
from tests.support.optional import present
from tests.support.ranking_maps import make_bin_map
from tests.support.synthetic_maps import synthetic_bin_map
from tests.support.synthetic_parts import bin_with_parts

DOWN = np.array([[0.0, 0.0, -1.0]])


def with_margins() -> BinMap:
    """A map whose every test grasp has margins and a best path."""
    return bin_with_parts(synthetic_bin_map())


def on_test_points(bin_map: BinMap) -> tuple[np.ndarray, np.ndarray]:
    """Points and quaternions of the test grasps that are reached."""
    reached = np.argwhere(present(bin_map.best).row >= 0)
    points = bin_map.position[tuple(reached[:, :3].T)]
    return points, bin_map.quaternion_wxyz[tuple(reached.T)]


@pytest.mark.parametrize("name", MARGINS)
def test_a_margin_orders_grasps_as_the_values_in_the_map_do(name):
    """With one margin alone, test grasps come in the order of its values by hand."""
    bin_map = with_margins()
    points, quaternions = on_test_points(bin_map)
    ranking = Ranker(bin_map).rank(
        points,
        quaternions_wxyz=quaternions,
        weights=(0, 0, 0),
        margins={name: 2.0},
        roll="fixed",
    )
    reached = present(bin_map.best).row >= 0
    if name == "wind_up":
        values = wound_by_hand(bin_map)[reached]
        expected = values / np.quantile(values, 0.95)
    else:
        margins = present(bin_map.margins)
        stored = {
            "clearance": margins.clearance,
            "joint_margin": margins.joint_margin,
            "singularity": margins.smallest_singular_value,
        }[name]
        values = stored[reached]
        expected = np.maximum(1 - values / np.quantile(values, 0.95), 0)
    np.testing.assert_allclose(ranking.cost, 2.0 * expected, atol=1e-12)
    assert ranking.term_names[-1] == name


def wound_by_hand(bin_map: BinMap) -> np.ndarray:
    """Furthest turn of the last joint on the best path and the stages, in loops."""
    best, stage = present(bin_map.best).row, present(bin_map.paths.stage)
    wound = np.full(best.shape, np.nan)
    start = np.concatenate([[0], np.cumsum(bin_map.paths.row_size)])
    for k, index in enumerate(bin_map.paths.index.tolist()):
        place = tuple(index[:4])
        if stage[k] == 0 and best[place] != k:
            continue
        path = bin_map.paths.configuration[start[k] : start[k + 1], -1]
        turned = float(np.abs(path - bin_map.scan_configuration[-1]).max())
        wound[place] = np.nanmax([wound[place], turned])
    return wound


def test_without_weights_margins_change_nothing():
    """The terms of the paper stay what they are, to the last bit."""
    bin_map = with_margins()
    points, quaternions = on_test_points(bin_map)
    ranker = Ranker(bin_map)
    plain = ranker.rank(points, quaternions_wxyz=quaternions)
    zero = ranker.rank(
        points, quaternions_wxyz=quaternions, margins=dict.fromkeys(MARGINS, 0.0)
    )
    np.testing.assert_array_equal(plain.cost, zero.cost)
    assert plain.terms.shape == zero.terms.shape == (len(points), 4)
    both = ranker.rank(points, quaternions_wxyz=quaternions, margins={"clearance": 1.0})
    np.testing.assert_array_equal(both.terms[:, :4], plain.terms)


def test_a_pair_that_is_never_checked_costs_nothing():
    """Where no pair of bodies is checked, clearance is unknown, and no reproach."""
    bin_map = with_margins()
    margins = dataclasses.replace(
        present(bin_map.margins), clearance=np.full(bin_map.status.shape, np.nan)
    )
    ranker = Ranker(dataclasses.replace(bin_map, margins=margins))
    points, quaternions = on_test_points(bin_map)
    ranking = ranker.rank(
        points, quaternions_wxyz=quaternions, margins={"clearance": 1.0}
    )
    assert (ranking.terms[:, -1] == 0.0).all()


def test_margins_of_a_map_without_them_are_refused():
    """A map of format 1.0 has none, and an unknown name is no margin."""
    ranker = Ranker(make_bin_map())
    point = ranker.table.points[:1]
    with pytest.raises(SettingsError, match="clearance: the map has no margins"):
        ranker.rank(point, DOWN, margins={"clearance": 1.0})
    with pytest.raises(SettingsError, match="margins are clearance, joint_margin"):
        ranker.rank(point, DOWN, margins={"clarity": 1.0})
    with pytest.raises(SettingsError, match="weight wind_up must be between 0"):
        ranker.rank(point, DOWN, margins={"wind_up": -1.0})
