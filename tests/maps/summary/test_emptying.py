"""What stays in a bin, against counts on bins whose columns are known."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.maps.summary.emptying import emptying_of, volume_left
from reachmap.plots.curves.emptying import draw_emptying
from tests.support.optional import present
from tests.support.synthetic_maps import synthetic_bin_map


def a_map(reached):
    """A map of points (nl, ny, nx) that are reached from one of three directions."""
    found = np.zeros((*reached.shape, 3, 1), bool)
    found[..., 1, 0] = reached
    status = np.where(found[..., 0], 1, 4)
    return synthetic_bin_map(found, status=status)


def test_a_part_below_one_that_cannot_be_picked_stays():
    """Columns of 150 mm in slices of 75, 50 and 25 mm, by brute force."""
    layer, depth = np.array([0.05, 0.1, 0.15]), 0.15
    rng = np.random.default_rng(3)
    stuck = rng.random((3, 7, 5)) < 0.3
    left = volume_left(stuck, layer, depth)
    slices = np.array([0.075, 0.05, 0.025])
    for y in range(7):
        for x in range(5):
            stays = 0.0
            for k in (2, 1, 0):
                if stays or stuck[k, y, x]:
                    stays += slices[k] / depth
            assert left[y, x] == pytest.approx(stays)


def test_what_stays_is_named_by_its_wall():
    """Robot at +y of the bin: the low rows of y lie at the far wall."""
    reached = np.ones((3, 6, 8), bool)
    found = present(emptying_of(a_map(reached)))
    assert found.left == 0
    assert found.sentence == "empties to 50 mm, the lowest level, everywhere"
    for rows, wall in ((0, "far"), (-1, "near")):
        reached = np.ones((3, 6, 8), bool)
        reached[0, rows] = False
        found = present(emptying_of(a_map(reached)))
        # One row of six, the lower half of its depth.
        assert found.left == pytest.approx(100 / 6 * 0.5)
        assert found.empties_to_m == pytest.approx(0.1)
        assert found.sentence == (
            f"empties to 100 mm; the last 8 % remain along the {wall} wall"
        )
        assert [level.points for level in found.levels] == pytest.approx(
            [100 * 5 / 6, 100, 100]
        )
        assert [level.directions for level in found.levels] == pytest.approx(
            [100 * 5 / 18, 100 / 3, 100 / 3]
        )
    reached = np.ones((3, 6, 8), bool)
    reached[0, :, 0] = reached[0, :, -1] = False
    assert present(emptying_of(a_map(reached))).where == "along the +x and -x walls"
    reached = np.ones((3, 6, 8), bool)
    reached[:, 1:-1, 1:-1] = True
    reached[0, 0], reached[0, -1], reached[0, :, 0], reached[0, :, -1] = (False,) * 4
    assert present(emptying_of(a_map(reached))).where == "around the walls"
    assert present(emptying_of(a_map(np.zeros((3, 6, 8), bool)))).left == 100


@pytest.mark.parametrize("points", [(4, 5), (6, 8)])
def test_what_stays_everywhere_is_not_at_the_walls(points):
    """A lowest level that is lost whole, on grids with most points beside a wall."""
    reached = np.ones((2, *points), bool)
    reached[0] = False
    found = present(emptying_of(a_map(reached)))
    assert found.where == "all over the bin"
    assert found.empties_to_m == pytest.approx(0.1)


def test_a_full_bin_that_cannot_be_picked_everywhere_says_so():
    """There is no height that it empties to."""
    reached = np.ones((2, 4, 4), bool)
    reached[1, 0, 0] = False
    found = present(emptying_of(a_map(reached)))
    assert found.empties_to_m is None
    assert found.left == pytest.approx(100 / 16)
    assert found.sentence.startswith("no level can be picked everywhere; the last 6 %")


def test_a_single_layer_has_no_curve_and_several_have_a_picture():
    """Its points are the percentages, from full to empty."""
    assert emptying_of(a_map(np.ones((1, 4, 4), bool))) is None
    unfinished = np.zeros((2, 4, 4, 3, 1), bool)
    assert emptying_of(synthetic_bin_map(unfinished, status=unfinished[..., 0])) is None
    reached = np.ones((3, 6, 8), bool)
    reached[0, 0] = False
    record = a_map(reached)
    figure = draw_emptying(record, present(emptying_of(record)))
    axes = figure.axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    line = lines["points, from at least one direction"]
    assert line.get_xdata() == pytest.approx([50, 100, 150])
    assert line.get_ydata() == pytest.approx([100 * 5 / 6, 100, 100])
    assert axes.get_xlim()[0] > axes.get_xlim()[1]
