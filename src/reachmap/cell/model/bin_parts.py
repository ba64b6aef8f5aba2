"""The parts of a bin: bottom, walls, rim and the heap in it, in the bin frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.bodies import BinSpec
from reachmap.cell.model.fields import Shape
from reachmap.cell.model.shapes import ConvexBody, Solid

SIDES = (("+x", 0, 1), ("-x", 0, -1), ("+y", 1, 1), ("-y", 1, -1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BinPart:
    """One of the convex parts a bin is made of.

    Attributes
    ----------
    name : str
        ``bin bottom``, ``bin wall +x``, ``bin rim +x``, ``bin heap``, or ``bin shell``
        for a mesh.
    shape : Shape, ConvexBody or TriangleMesh
    centre_m : array, shape (3,)
        Origin of the shape in the bin frame [m].
    """

    name: str
    shape: Solid
    centre_m: FloatArray


@dataclass(frozen=True, slots=True)
class _Slab:
    """A rectangle centred on z that grows linearly from one height to another."""

    low_z: float
    high_z: float
    low: tuple[float, float, float, float]  # from x, to x, from y, to y at low_z
    high: tuple[float, float, float, float]

    def part(self, name: str) -> BinPart:
        corners = np.array(
            [
                [x, y, z]
                for z, (x0, x1, y0, y1) in (
                    (self.low_z, self.low),
                    (self.high_z, self.high),
                )
                for x in (x0, x1)
                for y in (y0, y1)
            ]
        )
        centre = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        if np.allclose(self.low, self.high, rtol=0.0, atol=1e-12):
            x, y, z = np.round(np.ptp(corners, axis=0), 12).tolist()
            return BinPart(name=name, shape=Shape(box=(x, y, z)), centre_m=centre)
        shape = ConvexBody(points=corners - centre)
        return BinPart(name=name, shape=shape, centre_m=centre)


def bin_parts(spec: BinSpec, shell: Solid | None = None) -> tuple[BinPart, ...]:
    """Parts of a bin; the frame's origin is the centre of the inner bottom, z up.

    Upright walls are boxes, walls that lean are convex bodies.

    Parameters
    ----------
    spec : BinSpec
    shell : Solid, optional
        Its mesh, in place of bottom, walls and rim.
    """
    if shell is None:
        return (*_tray(spec), *_rim(spec), *_heap(spec))
    mesh = BinPart(name="bin shell", shape=shell, centre_m=np.zeros(3))
    return (mesh, *_heap(spec))


def inner_at(spec: BinSpec, z: float) -> tuple[float, float]:
    """Half of the inner x and y at a height above the bottom [m]."""
    share = z / spec.inner[2]
    x, y = (
        (low + share * (high - low)) / 2.0
        for low, high in zip(spec.inner, spec.top, strict=False)
    )
    return x, y


def _tray(spec: BinSpec) -> list[BinPart]:
    low_z, high_z = -spec.bottom_m, spec.inner[2]

    def frame(z: float) -> tuple[float, float]:
        return inner_at(spec, z)

    def whole(z: float) -> tuple[float, float, float, float]:
        x, y = frame(z)
        return -x, x, -y, y

    parts = [_Slab(low_z, 0.0, whole(low_z), whole(0.0)).part("bin bottom")]
    for sign, axis, s in SIDES:
        ends = [
            _beside(frame(z), spec.walls, axis, s, thickness=spec.walls[axis])
            for z in (low_z, high_z)
        ]
        parts.append(_Slab(low_z, high_z, *ends).part(f"bin wall {sign}"))
    return parts


def _rim(spec: BinSpec) -> list[BinPart]:
    if spec.rim is None:
        return []
    high_z = spec.inner[2]
    low_z = high_z - spec.rim.height
    # From the outside of the walls, where they are nearest to the middle.
    outside = [
        min(a, b) + wall
        for a, b, wall in zip(
            inner_at(spec, low_z), inner_at(spec, high_z), spec.walls, strict=True
        )
    ]
    reach = [
        half + wall + spec.rim.width
        for half, wall in zip(inner_at(spec, high_z), spec.walls, strict=True)
    ]
    parts = []
    for sign, axis, s in SIDES:
        width = max(reach[axis] - outside[axis], spec.rim.width)
        around = (reach[0] - outside[0], reach[1] - outside[1])
        edges = _beside((outside[0], outside[1]), around, axis, s, thickness=width)
        parts.append(_Slab(low_z, high_z, edges, edges).part(f"bin rim {sign}"))
    return parts


def _heap(spec: BinSpec) -> list[BinPart]:
    if spec.heap == 0:
        return []
    edges = []
    for z in (0.0, spec.heap):
        x, y = inner_at(spec, z)
        edges.append((-x, x, -y, y))
    return [_Slab(0.0, spec.heap, *edges).part("bin heap")]


def _beside(
    half: tuple[float, float],
    around: tuple[float, float],
    axis: int,
    sign: int,
    *,
    thickness: float,
) -> tuple[float, float, float, float]:
    """Edges of a wall beside a rectangle; x walls cover the ends of y walls."""
    x, y = half
    if axis == 0:
        near, far = sorted((sign * x, sign * (x + thickness)))
        return near, far, -(y + around[1]), y + around[1]
    near, far = sorted((sign * y, sign * (y + thickness)))
    return -x, x, near, far
