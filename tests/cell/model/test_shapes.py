"""Shapes made smaller, against their sides."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.model.fields import Shape
from reachmap.cell.model.shapes import (
    ConvexBody,
    Solid,
    TriangleMesh,
    corner_points,
    shrunk,
)

RNG = np.random.default_rng(3)
# Away from the origin, and with sides of their own along each axis.
POINTS = RNG.uniform([0.1, -0.3, 0.5], [0.3, 0.1, 0.6], (20, 3))


@pytest.mark.parametrize(
    "shape",
    [
        Shape(box=(0.2, 0.4, 0.1)),
        ConvexBody(points=POINTS),
        TriangleMesh(vertices=POINTS, triangles=RNG.integers(0, 20, (9, 3))),
    ],
    ids=["box", "convex", "mesh"],
)
def test_every_side_is_shorter_by_as_much(shape: Solid) -> None:
    """About the same middle, and by nothing where nothing is asked."""
    before = corner_points(shape)
    assert shrunk(shape, 0) is shape
    after = corner_points(shrunk(shape, 0.02))
    np.testing.assert_allclose(np.ptp(after, axis=0), np.ptp(before, axis=0) - 0.02)
    for side in (before, after):
        middle = (side.min(axis=0) + side.max(axis=0)) / 2
        np.testing.assert_allclose(middle, (before.min(0) + before.max(0)) / 2)
