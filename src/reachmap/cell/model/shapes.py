"""Geometry of each kind of shape: sides, corners, triangles, text.

The one place that distinguishes boxes from cylinders; engines and pictures get numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.fields import Shape

# Corners of a circle in triangles: 0.2 % of the radius is cut off.
ROUND_STEPS = 48
_SIGNS: FloatArray = np.stack(
    np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1
).reshape(-1, 3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TriangleMesh:
    """A surface of triangles.

    Attributes
    ----------
    vertices : array, shape (n, 3)
        [m].
    triangles : int array, shape (m, 3)
        Indices of vertices, counter-clockwise seen from outside.
    """

    vertices: FloatArray = field(repr=False)
    triangles: IntArray = field(repr=False)

    def scaled(self, scale: Any) -> TriangleMesh:
        """Multiply all vertices by one factor, or by one for each axis."""
        factors = np.broadcast_to(np.asarray(scale, float), 3)
        # A mirror image would be seen from inside.
        mirrored = bool(np.prod(np.sign(factors)) < 0)
        return TriangleMesh(
            vertices=self.vertices * factors,
            triangles=self.triangles[:, ::-1].copy() if mirrored else self.triangles,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ConvexBody:
    """The convex hull of points.

    Attributes
    ----------
    points : array, shape (n, 3)
        At least four that do not lie in a plane [m].
    """

    points: FloatArray = field(repr=False)


Solid: TypeAlias = Shape | TriangleMesh | ConvexBody


def sides(shape: Solid) -> FloatArray:
    """Full sides of the box around a shape, shape (3,) [m].

    Raises
    ------
    ValueError
        The shape is a mesh that has not been read.
    """
    if not isinstance(shape, Shape):
        return np.asarray(np.ptp(corner_points(shape), axis=0))
    kind, value = shape.kind()
    if kind == "box":
        return np.array(value, float)
    if kind == "mesh":
        raise ValueError(f"{value.file}: the mesh has not been read")
    caps = 0.0 if kind == "cylinder" else 2.0 * value.radius
    length = getattr(value, "length", 0.0) + caps
    return np.array([2.0 * value.radius, 2.0 * value.radius, length])


def corner_points(shape: Solid) -> FloatArray:
    """Points whose convex hull contains the shape, (n, 3) in its own frame [m]."""
    if isinstance(shape, TriangleMesh):
        return shape.vertices
    if isinstance(shape, ConvexBody):
        return shape.points
    return box_corners(sides(shape))


def box_corners(sides_m: FloatArray) -> FloatArray:
    """Corners of a centred box with the full sides (3,) [m], shape (8, 3)."""
    return np.asarray(_SIGNS * sides_m / 2.0)


def shrunk(shape: Solid, by_m: float) -> Solid:
    """A box, mesh or convex body, smaller by this much along each axis."""
    if by_m == 0:
        return shape
    size = sides(shape)
    smaller = np.maximum(size - by_m, 1e-6)
    if isinstance(shape, Shape):
        x, y, z = smaller.tolist()
        return Shape(box=(x, y, z))
    points = corner_points(shape)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    points = middle + (points - middle) * smaller / np.maximum(size, 1e-12)
    if isinstance(shape, ConvexBody):
        return ConvexBody(points=points)
    return TriangleMesh(vertices=points, triangles=shape.triangles)


def triangles_of(shape: Solid) -> TriangleMesh:
    """Surface of a shape; round ones have 48 corners, which lie on the true surface."""
    if isinstance(shape, TriangleMesh):
        return shape
    if isinstance(shape, ConvexBody):
        return _hull(shape.points)
    kind, value = shape.kind()
    if kind == "box":
        return _box(sides(shape))
    half = getattr(value, "length", 0.0) / 2.0
    if kind == "cylinder":
        # Rings that occur twice keep the edges of the caps sharp.
        profile = [(0.0, -half), (value.radius, -half), (value.radius, -half)]
        profile += [(r, -z) for r, z in profile[::-1]]
        return _revolved(np.array(profile))
    angle = np.linspace(0.0, np.pi / 2.0, ROUND_STEPS // 4 + 1)
    cap = value.radius * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    cap[0, 0] = 0.0
    upper = np.array([0.0, half]) + cap
    return _revolved(np.concatenate([upper * [1.0, -1.0], upper[::-1]]))


def shape_text(shape: Shape) -> str:
    """Shape with its size: ``box 0.24 × 0.24 × 0.8 m``."""
    kind, value = shape.kind()
    if kind == "box":
        return "box " + " × ".join(f"{side:g}" for side in value) + " m"
    if kind == "mesh":
        return f"mesh {value.file.rsplit('/', 1)[-1]}"
    length = getattr(value, "length", None)
    return f"{kind} r {value.radius:g} m" + (
        "" if length is None else f", length {length:g} m"
    )


def _box(sides_m: FloatArray) -> TriangleMesh:
    """Centred box; faces share no corners, so that edges stay sharp in pictures."""
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    faces = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            face = np.empty((4, 3))
            face[:, axis] = sign
            # Running backwards turns the face to the other side.
            face[:, [(axis + 1) % 3, (axis + 2) % 3]] = square[:: int(sign)]
            faces.append(face)
    corner = 4 * np.arange(6)[:, None, None]
    triangles = (corner + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return TriangleMesh(
        vertices=np.concatenate(faces) * sides_m / 2.0, triangles=triangles
    )


def _hull(points: FloatArray) -> TriangleMesh:
    """Surface of a convex hull; triangles share no corners: edges stay sharp."""
    # Imported here: it takes long, and most shapes are boxes and cylinders.
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normal * hull.equations[:, :3]).sum(axis=1) < 0
    corners[inward] = corners[inward][:, ::-1]
    return TriangleMesh(
        vertices=corners.reshape(-1, 3),
        triangles=np.arange(3 * len(corners)).reshape(-1, 3),
    )


def _revolved(profile: FloatArray) -> TriangleMesh:
    """Surface of revolution about z.

    Parameters
    ----------
    profile : array, shape (n, 2)
        Radius and height of points from the lower end to the upper one [m]; the first
        and the last lie on the axis.
    """
    steps = ROUND_STEPS
    angle = np.linspace(0.0, 2.0 * np.pi, steps, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(steps)], axis=-1)
    up = np.array([0.0, 0.0, 1.0])
    vertices = np.concatenate([r * ring + z * up for r, z in profile])
    here = np.arange(steps)
    there = (here + 1) % steps
    strips = []
    for low in range(len(profile) - 1):
        a, b = steps * low, steps * (low + 1)
        if profile[low, 0] > 0:
            strips.append(np.stack([a + here, a + there, b + there], axis=-1))
        if profile[low + 1, 0] > 0:
            strips.append(np.stack([a + here, b + there, b + here], axis=-1))
    return TriangleMesh(vertices=vertices, triangles=np.concatenate(strips))
