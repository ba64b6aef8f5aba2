"""The chart of costs shows the means it is given."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.errors import SettingsError
from reachmap.plots.ranking import CostGroup, ranking_chart
from reachmap.ranking.lookup.table import TERMS


def group(label, supplied):
    """A group whose re-ranked order is by total cost, unreachable last."""
    supplied = np.array(supplied, float)
    order = np.argsort(supplied.sum(axis=1), kind="stable")
    return CostGroup(label=label, supplied=supplied, ranked=supplied[order])


def bars(figure):
    """Bottom, height and colour of every bar."""
    (axes,) = figure.axes
    return [(p.get_y(), p.get_height(), p.get_facecolor()) for p in axes.patches]


def texts(figure):
    """Everything written on the axes."""
    return [text.get_text() for text in figure.axes[0].texts]


def test_bars_are_stacked_means():
    """Three segments a bar, one on the other, whose heights are the mean terms."""
    terms = [[0.4, 0.2, 0.1], [0.2, 0.2, 0.3], [0.9, 0.9, 0.9]]
    figure = ranking_chart([group("NE", terms)], TERMS, top=2)
    drawn = bars(figure)
    assert len(drawn) == 6
    np.testing.assert_allclose([h for _, h, _ in drawn[:3]], [0.3, 0.2, 0.2])
    np.testing.assert_allclose([b for b, _, _ in drawn[:3]], [0.0, 0.3, 0.5])
    assert "0.70" in texts(figure)


def test_unreachable_grasps_are_counted_and_grey():
    """A mean over an unreachable grasp is infinite: grey to the top, with the count."""
    terms = [[0.4, 0.2, 0.1], [np.nan] * 3, [0.2, 0.2, 0.3]]
    figure = ranking_chart([group("SW", terms)], TERMS, top=2)
    drawn = bars(figure)
    assert len(drawn) == 7
    assert drawn[0][1] == pytest.approx(figure.axes[0].get_ylim()[1])
    assert len(set(drawn[0][2][:3])) == 1
    assert "1 of 2\nunreachable" in texts(figure)
    assert "0.70" in texts(figure)


def test_a_group_without_reachable_grasps():
    """Nothing is averaged and nothing divided by zero."""
    figure = ranking_chart(
        [group("NW", [[np.nan] * 4] * 3)], (*TERMS, "clearance"), top=10
    )
    assert texts(figure).count("3 of 3\nunreachable") == 2
    assert "NW (only 3)" in texts(figure)


def test_charts_that_cannot_be_drawn():
    """No grasps, no top, or too many groups are refused."""
    one = group("NE", [[0.1, 0.1, 0.1]])
    for groups, top, message in [
        ([], 10, "a chart needs grasps"),
        ([one], 0, "a top of 1 or more"),
        ([one] * 25, 10, "25 groups; a chart takes 24"),
    ]:
        with pytest.raises(SettingsError, match=message):
            ranking_chart(groups, TERMS, top)
