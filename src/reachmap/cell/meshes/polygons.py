"""Shared by the readers of mesh files: their error, and triangulation of polygons."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reachmap._typing import IntArray


class MeshError(ValueError):
    """A mesh file is damaged or of an unknown format."""


def fan_triangles(polygons: Sequence[Sequence[int]]) -> IntArray:
    """Triangles of polygons, each as a fan about its first corner, shape (n, 3).

    That is exact for convex polygons; of others the fan reaches into the hollows.
    """
    triangles = [
        (corners[0], corners[k], corners[k + 1])
        for corners in polygons
        for k in range(1, len(corners) - 1)
    ]
    return np.array(triangles, np.int64).reshape(-1, 3)
