"""Shapes for the collision engine, which trusts the numbers that it is given."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import coal
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.model.shapes import ConvexBody, Solid, TriangleMesh

# A hundredth of what a safety margin usually is.
FLAT_M = 1e-5
# Coal counts the neighbours of a corner in a byte, of which it needs some values.
MOST_NEIGHBOURS = 250


def coal_shape(shape: Solid) -> Any:
    """Collision geometry of a shape; a mesh is a surface, with nothing inside."""
    if isinstance(shape, TriangleMesh):
        return _surface(shape)
    if isinstance(shape, ConvexBody):
        return convex_hull(shape.points)
    kind, value = shape.kind()
    if kind == "box":
        return coal.Box(*value)
    if kind == "sphere":
        return coal.Sphere(value.radius)
    if kind == "cylinder":
        return coal.Cylinder(value.radius, value.length)
    if kind == "capsule":
        return coal.Capsule(value.radius, value.length)
    raise ValueError(f"{value.file}: the mesh has not been read")


@lru_cache(maxsize=64)
def _surface(mesh: TriangleMesh) -> Any:
    """Surface of a mesh, built once: engines only read it."""
    vertices = mesh.vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    if (high - low).min() < FLAT_M:
        # The broadphase passes over boxes without volume: two corners that no
        # triangle uses give this one some.
        vertices = np.vstack([vertices, low - FLAT_M, high + FLAT_M])
    surface = coal.BVHModelOBBRSS()
    surface.beginModel(len(mesh.triangles), len(vertices))
    surface.addVertices(np.ascontiguousarray(vertices, float))
    surface.addTriangles(np.ascontiguousarray(mesh.triangles, np.int64))
    surface.endModel()
    return surface


def convex_hull(points: FloatArray) -> Any:
    """Convex body around points (n, 3); None where they lie in a plane.

    The hull is scipy's: coal's own is a segmentation fault where there is none. Where
    a corner has more neighbours than coal can count (the tip of a fine cone), every
    second of them is left out and the rest inflated until it contains all points.
    """
    points = np.ascontiguousarray(points, float)
    return _hull(points.tobytes())


@lru_cache(maxsize=128)
def _hull(data: bytes) -> Any:
    """Hull of points (n, 3) given as bytes, built once: engines only read it."""
    points = np.frombuffer(data).reshape(-1, 3)
    # Below a millionth of the size a body has no inside that an engine could use.
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if len(points) < 4 or spread[2] < 1e-6 * spread[0]:
        return None
    try:
        hull = ConvexHull(points)
        while (left_out := _excess_neighbours(hull)).any():
            hull = ConvexHull(_inflated(hull, ~left_out, points))
    except QhullError:
        return None
    points = hull.points
    corners = np.unique(hull.simplices, return_inverse=True)
    vertices, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    vertices.extend(list(points[corners[0]]))
    triangles.extend(
        [coal.Triangle(*map(int, row)) for row in corners[1].reshape(-1, 3)]
    )
    return coal.Convex(vertices, triangles)


def _excess_neighbours(hull: ConvexHull) -> BoolArray:
    """Hull points to drop: every second neighbour of a point that has too many."""
    edges = np.unique(
        hull.simplices[:, [0, 1, 1, 2, 2, 0, 1, 0, 2, 1, 0, 2]].reshape(-1, 2), axis=0
    )
    left_out = np.zeros(len(hull.points), bool)
    count = np.bincount(edges[:, 0])
    if count.max() > MOST_NEIGHBOURS:
        left_out[edges[edges[:, 0] == count.argmax(), 1][::2]] = True
        left_out[count > MOST_NEIGHBOURS] = False
    return left_out


def _inflated(hull: ConvexHull, kept: BoolArray, points: FloatArray) -> FloatArray:
    """Some corners of a hull, scaled until their hull contains all points."""
    corners = hull.points[np.intersect1d(np.flatnonzero(kept), hull.vertices)]
    centre = corners.mean(axis=0)
    normal, offset = np.split(ConvexHull(corners - centre).equations, [3], axis=1)
    beyond = (points - centre) @ normal.T / -offset.T
    return np.asarray(centre + (corners - centre) * float(beyond.max()))
