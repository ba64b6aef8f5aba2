"""Hulls of points for an engine that counts neighbours in a byte."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from reachmap.core.collision.shapes import convex_hull


def ring(count: int, z: float) -> np.ndarray:
    """Points on a circle of radius 1."""
    angle = np.arange(count) * 2 * np.pi / count
    return np.column_stack([np.cos(angle), np.sin(angle), np.full(count, z)])


@pytest.mark.parametrize("count", [100, 255, 300, 1000])
@pytest.mark.parametrize("kind", ["cone", "disc", "spindle"])
def test_fine_cones_and_discs_are_around_their_points(count: int, kind: str) -> None:
    """Every point is inside, and the volume is larger by half a percent at most."""
    tips: dict[str, np.ndarray] = {
        "cone": np.array([[0.0, 0.0, 1.0]]),
        "disc": ring(count, 0.1),
        "spindle": np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]),
    }
    points = np.vstack([ring(count, 0.0), tips[kind]])
    body = convex_hull(points)
    corners = np.array([body.point(k) for k in range(body.num_points)])
    found, true = ConvexHull(corners), ConvexHull(points)
    normal, offset = found.equations[:, :3], found.equations[:, 3]
    assert (points @ normal.T + offset).max() < 1e-9
    assert true.volume - 1e-9 <= found.volume <= 1.005 * true.volume
