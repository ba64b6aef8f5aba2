"""Where the number of a square stands: in the middle, or beside lines through it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from matplotlib.path import Path
from matplotlib.transforms import Bbox

from reachmap._typing import FloatArray

POINTS_PER_INCH = 72.0
# Size of a digit in units of the font size (DejaVu Sans), without room around it.
DIGIT_WIDTH, DIGIT_HEIGHT = 0.64, 0.76
# Room between a number and a line, and on both axes to the edge of its square [pt].
LINE_ROOM, EDGE_ROOM = 2.2, np.array([1.0, 3.2])


def _effort(step: tuple[float, ...]) -> tuple[float, int]:
    """How far a step goes, and the number of axes it goes along."""
    return max(abs(part) for part in step), sum(part != 0.0 for part in step)


# Places to try, in parts of the room on either side of the middle.
STEPS = sorted(product((0.0, 0.4, -0.4, 0.7, -0.7, 1.0, -1.0), repeat=2), key=_effort)


def closed_path(polygon: FloatArray) -> Path:
    """Path of a polygon, shape (n, 2), not closed."""
    corners = np.vstack([polygon, polygon[:1]])
    return Path(corners)


def number_place(
    square: FloatArray,
    characters: int,
    *,
    font_size: float,
    scale_in: float,
    lines: Sequence[Path],
) -> tuple[float, float]:
    """Middle of a number in its square: clear of the lines, where that is possible.

    Parameters
    ----------
    square : array, shape (2, 2)
        Lower and upper corner [m].
    characters : int
    font_size : float
        [pt].
    scale_in : float
        Inches per metre of the picture.
    lines : sequence of Path
        Lines to keep clear of [m].

    Returns
    -------
    (float, float)
        The square's own middle if no line crosses the number there, or if every
        other place is crossed, too.
    """
    middle = square.mean(axis=0)
    metre = scale_in * POINTS_PER_INCH
    half = np.array([DIGIT_WIDTH * characters, DIGIT_HEIGHT]) * font_size / 2.0
    reach = (square[1] - square[0]) / 2.0 - (half + EDGE_ROOM) / metre
    room, half = np.maximum(reach, 0.0), (half + LINE_ROOM) / metre
    for step in STEPS:
        place = middle + room * step
        box = Bbox([place - half, place + half])
        if not any(line.intersects_bbox(box, filled=False) for line in lines):
            return float(place[0]), float(place[1])
    return float(middle[0]), float(middle[1])
