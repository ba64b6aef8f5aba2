"""The chart of a validation shows the numbers of its summary."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from reachmap.plots.validation import validation_chart
from reachmap.tools.validate import validate
from tests.support.toy_truth import clear_rows, toy_grasps


@pytest.fixture(scope="module")
def validation(toy_map, tmp_path_factory):
    """Thirty toy grasps, some of them wrongly called reachable."""
    path = tmp_path_factory.mktemp("chart") / "toy.json"
    path.write_text(json.dumps(toy_grasps(clear_rows(30, seed=1))))
    return validate(toy_map, [path], top=5).validation


def test_bars_are_measured_means(validation):
    """Three segments for each order of each group; grey where one was not reached."""
    _, bars, _ = validation_chart(validation).axes
    drawn = [p for p in bars.patches if isinstance(p, Rectangle)]
    heights = {
        round(p.get_x() + p.get_width() / 2, 6): 0.0
        for p in drawn
        if p.get_facecolor()[:3] != drawn[0].get_facecolor()[:3]
    }
    coloured = [p for p in drawn if p.get_y() > 0 or p.get_height() < 0.99 *
                bars.get_ylim()[1]]  # fmt: skip
    for patch in coloured:
        place = round(patch.get_x() + patch.get_width() / 2, 6)
        heights[place] = heights.get(place, 0.0) + patch.get_height()
    expected = [
        np.nan_to_num(figures.cost)
        for group in validation.groups
        for figures in group.orders.values()
    ]
    stacked = [heights[place] for place in sorted(heights)]
    np.testing.assert_allclose(stacked, expected)


def test_points_are_grasps(validation):
    """Reached grasps at their costs, the others as crosses on the upper edge."""
    costs, *_ = validation_chart(validation).axes
    (one,) = validation.lists
    reached, missed = (np.asarray(c.get_offsets()) for c in costs.collections)
    both = one.predicted & one.reached
    np.testing.assert_allclose(reached[:, 0], one.predicted_cost[both])
    np.testing.assert_allclose(reached[:, 1], one.cost[both])
    assert len(missed) == validation.overall.confusion.false_positive > 0
    assert (missed[:, 1] == costs.get_ylim()[1]).all()


def test_many_groups_are_cut_short(validation):
    """A page has room for twenty-four quadrants; what is left out is said."""
    many = dataclasses.replace(validation, groups=validation.groups * 10)
    _, bars, _ = validation_chart(many).axes
    assert len(bars.get_xticks()) == 3 * 24
    assert bars.get_title(loc="right") == f"first 24 of {len(many.groups)} groups"


def test_names_of_files_are_no_formulas(validation):
    """A list may be called anything; its name is drawn as it is."""
    (group, *_) = validation.groups
    odd = dataclasses.replace(
        validation, groups=(dataclasses.replace(group, label="a $x_{$ b \n c"),)
    )
    figure = validation_chart(odd)
    figure.canvas.draw()
    assert r"a \$x_{\$ b \n c" in [t.get_text() for t in figure.axes[1].texts]


def test_the_reliability_diagram_shows_each_bin(validation):
    """A point at the mean probability and the frequency of every bin with grasps."""
    diagram = validation_chart(validation).axes[2]
    drawn = [np.asarray(dot.get_offsets())[0] for dot in diagram.collections]
    wanted = [(one.predicted, one.reached.share) for one in validation.diagram.bins]
    np.testing.assert_allclose(drawn, wanted)
