"""Boxes around the bodies that an arm moves, for many configurations at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.shapes import Solid, corner_points
from reachmap.core.collision.shapes import convex_hull

if TYPE_CHECKING:
    from reachmap.core.collision.bodies import BodyGeometry
    from reachmap.core.robot.chain import SerialChain


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Extents:
    """What each body fits into, in the chain's joint frames: a box, and a capsule.

    Turned against the axes, a box has far corners and a capsule has none; along them it
    is the other way round.

    Attributes
    ----------
    body : int array, shape (bodies,)
        Geometry objects that joints of the chain carry.
    joint : int array, shape (bodies,)
        From 0.
    centre, half : array, shape (bodies, 3)
        Of the box [m].
    ends : array, shape (bodies, 2, 3)
        Of the line in the middle of the capsule [m].
    radius : array, shape (bodies,)
        Of the capsule [m].
    corners : tuple of array, shape (n, 3)
        Of the convex hull of each body [m].
    """

    body: IntArray
    joint: IntArray
    centre: FloatArray
    half: FloatArray
    ends: FloatArray
    radius: FloatArray
    corners: tuple[FloatArray, ...]

    @classmethod
    def of(cls, chain: SerialChain, model: Any, bodies: BodyGeometry) -> Extents:
        """Extents of the bodies of a cell; ``model`` is that of the chain's joints."""
        frames = chain.joint_rotations(model)
        found, corners = [], []
        objects = bodies.geometry.geometryObjects
        for k, (body, shape) in enumerate(zip(objects, bodies.shapes, strict=True)):
            joint = int(body.parentJoint) - 1
            if 0 <= joint < chain.dof:
                points = _hull_corners(shape) @ body.placement.rotation.T
                points = (points + body.placement.translation) @ frames[joint]
                found.append((k, joint, *_box(points), *_capsule(points)))
                corners.append(points)
        columns = zip(*found, strict=True) if found else [[] for _ in range(6)]
        body_, joint_, centre, half, ends, radius = (np.array(c) for c in columns)
        return cls(
            body=body_.astype(np.int64),
            joint=joint_.astype(np.int64),
            centre=centre.reshape(-1, 3),
            half=half.reshape(-1, 3),
            ends=ends.reshape(-1, 2, 3),
            radius=radius.astype(float),
            corners=tuple(corners),
        )

    def boxes(self, T_base_joint: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Low and high corners (n, bodies, 3) at joint frames (n, dof, 4, 4)."""
        T = T_base_joint[:, self.joint]
        R, origin = T[..., :3, :3], T[..., :3, 3]
        middle = (R @ self.centre[..., None])[..., 0] + origin
        room = (np.abs(R) @ self.half[..., None])[..., 0]
        ends = R @ np.swapaxes(self.ends, 1, 2) + origin[..., None]
        radius = self.radius[:, None]
        return (
            np.maximum(middle - room, ends.min(axis=-1) - radius),
            np.minimum(middle + room, ends.max(axis=-1) + radius),
        )

    def tight(
        self, T_base_joint: FloatArray, body: int
    ) -> tuple[FloatArray, FloatArray]:
        """The same (n, 3) around the corners of one body, which takes longer."""
        T = T_base_joint[:, self.joint[body]]
        sides = [T[:, axis, :3] @ self.corners[body].T for axis in range(3)]
        origin = T[:, :3, 3]
        low, high = (
            np.stack([bound(side, axis=1) for side in sides], axis=1) + origin
            for bound in (np.min, np.max)
        )
        return low, high


def _hull_corners(shape: Solid) -> FloatArray:
    """Corners of the convex body that checks with a margin are made with."""
    points = corner_points(shape)
    hull = convex_hull(points)
    return points if hull is None else np.array(hull.points())


def _box(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, (high - low) / 2


def _capsule(points: FloatArray) -> tuple[FloatArray, float]:
    """Ends and radius of a capsule along the longest side of the box of some points."""
    centre, half = _box(points)
    axis = np.eye(3)[int(np.argmax(half))]
    offset = points - centre
    along = offset @ axis
    across = float(np.linalg.norm(offset - np.outer(along, axis), axis=1).max())
    reach = max(float(half.max()) - across, 0.0)
    nearest = np.clip(along, -reach, reach)
    radius = float(np.linalg.norm(offset - np.outer(nearest, axis), axis=1).max())
    return np.stack([centre - reach * axis, centre + reach * axis]), radius
