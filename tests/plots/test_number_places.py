"""Numbers stand beside the outlines that cross their squares."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.path import Path

from reachmap.plots.parts.squares import number_place

SQUARE = np.array([[0.0, 0.0], [0.2, 0.2]])
TEXT = {"font_size": 8.0, "scale_in": 4.0}


def level_line(y: float) -> Path:
    """A line through the square, along x."""
    return Path([[-1.0, y], [1.0, y]])


def test_a_free_number_stands_in_the_middle() -> None:
    """Also where lines pass beside the square."""
    lines = [level_line(0.3), level_line(-0.1)]
    assert number_place(SQUARE, 3, lines=lines, **TEXT) == pytest.approx((0.1, 0.1))


@pytest.mark.parametrize("y", [0.08, 0.1, 0.12])
def test_a_crossed_number_moves_off_the_line(y: float) -> None:
    """It stays in its square, and its height [m] is clear of the line."""
    place = number_place(SQUARE, 3, lines=[level_line(y)], **TEXT)
    half = 0.5 * 0.76 * 8.0 / (4.0 * 72.0)
    assert place[0] == pytest.approx(0.1)
    assert abs(place[1] - y) > half
    assert half < place[1] < 0.2 - half


def test_a_number_without_a_free_place_stays() -> None:
    """Lines everywhere are worse for the eye than one in the middle."""
    lines = [level_line(y) for y in np.linspace(0.0, 0.2, 40)]
    assert number_place(SQUARE, 3, lines=lines, **TEXT) == pytest.approx((0.1, 0.1))
