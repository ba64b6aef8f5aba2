"""Two maps side by side: values, signed change, and what is more than chance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from reachmap.plots.albums import comparison_album
from reachmap.plots.comparison import MapChange, draw_change_sheet, draw_comparison


def make_change(levels: int = 3, **changes: Any) -> MapChange:
    """A map that gained 20 points at one corner of the last level."""
    before = np.full((levels, 3, 4), 40.0)
    after = before.copy()
    after[-1, 0, 0] += 20.0
    after[-1, 2, 3] -= 7.0
    fields: dict[str, Any] = {
        "x": 0.1 * np.arange(4),
        "y": 0.1 * np.arange(3),
        "z": 0.1 * np.arange(levels),
        "before": before,
        "after": after,
        "significant": np.abs(after - before) > 10.0,
        "names": ("wide housing", "slim housing"),
        "headline": "+1.1 points",
    }
    return MapChange(**{**fields, **changes})


def test_three_panels_show_before_after_and_change() -> None:
    """On the level that changed most, with the numbers at their places."""
    maps = make_change()
    assert maps.most_changed() == 2
    axes = draw_comparison(maps).axes
    corner, far = (0.0, 0.0), (0.3, 0.2)
    expected = (("40", "40"), ("60", "33"), ("+20", "−7"))
    for panel, (first, last) in zip(axes[:3], expected, strict=True):
        shown = {text.get_position(): text.get_text() for text in panel.texts}
        assert shown[corner] == first
        assert next(v for k, v in shown.items() if k == pytest.approx(far)) == last
    titles = [panel.get_title(loc="left") for panel in axes[:3]]
    assert titles == [
        "wide housing · mean 40.0 %",
        "slim housing · mean 41.1 %",
        "change · +1.1 points",
    ]


def test_only_significant_squares_are_framed() -> None:
    """The frame lies in the square of the corner that gained."""
    panel = draw_comparison(make_change()).axes[2]
    (frame,) = panel.patches
    assert isinstance(frame, Rectangle)
    left, low = frame.get_xy()
    assert -0.05 < left < 0.0 < left + frame.get_width() < 0.05
    assert -0.05 < low < 0.0 < low + frame.get_height() < 0.05


@pytest.mark.parametrize(
    ("largest", "limit"), [(0.0, 10.0), (9.0, 10.0), (12.0, 25.0), (60.0, 100.0)]
)
def test_scale_of_the_change_is_symmetric(largest: float, limit: float) -> None:
    """Zero is always the middle of the colours."""
    after = np.full((1, 3, 4), 40.0)
    after[0, 0, 0] -= largest / 2.0
    after[0, 1, 1] += largest
    maps = make_change(1, after=after)
    assert (maps.scale().vmin, maps.scale().vmax) == (-limit, limit)


def test_sheet_shows_every_level() -> None:
    """One panel per level, and the means of both maps."""
    figure = draw_change_sheet(make_change(5))
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles[:4] == [f"z = +0.{k}0 m · +0.0 points" for k in range(4)]
    assert titles[4] == "z = +0.40 m · +1.1 points"
    means = next(a for a in figure.axes if a.get_title(loc="left") == "means [%]")
    before, after = (np.asarray(line.get_xdata(), float) for line in means.lines[:2])
    np.testing.assert_allclose(before, 40.0)
    assert after.max() == pytest.approx(40.0 + 13.0 / 12.0)


def test_squares_without_attempts_have_no_change() -> None:
    """What one of the maps did not try is a dash, and counts in no mean."""
    before = np.full((1, 3, 4), 40.0)
    before[0, 1, 1] = np.nan
    maps = make_change(1, before=before, significant=np.zeros((1, 3, 4), bool))
    panel = draw_comparison(maps).axes[2]
    assert "–" in {text.get_text() for text in panel.texts}
    nothing = make_change(1, before=np.full((1, 3, 4), np.nan))
    assert "not attempted" in draw_comparison(nothing).axes[2].get_title(loc="left")


def test_album_has_a_sheet_only_for_several_levels() -> None:
    """A bin map of one layer needs no sheet."""
    assert [item.name for item in comparison_album(make_change(1))] == ["comparison"]
    assert [item.name for item in comparison_album(make_change(2))] == [
        "comparison",
        "comparison_overview",
    ]
