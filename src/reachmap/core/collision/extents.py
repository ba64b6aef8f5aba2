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
    """A box around each body, in the frame of its joint in the chain.

    Attributes
    ----------
    body : int array, shape (bodies,)
        Geometry objects that joints of the chain carry.
    joint : int array, shape (bodies,)
        From 0.
    centre, half : array, shape (bodies, 3)
        Of the box [m].
    """

    body: IntArray
    joint: IntArray
    centre: FloatArray
    half: FloatArray

    @classmethod
    def of(cls, chain: SerialChain, model: Any, bodies: BodyGeometry) -> Extents:
        """Extents of the bodies of a cell; ``model`` is that of the chain's joints."""
        frames = chain.joint_rotations(model)
        found = []
        objects = bodies.geometry.geometryObjects
        for k, (body, shape) in enumerate(zip(objects, bodies.shapes, strict=True)):
            joint = int(body.parentJoint) - 1
            if 0 <= joint < chain.dof:
                points = _corners(shape) @ body.placement.rotation.T
                points = (points + body.placement.translation) @ frames[joint]
                found.append((k, joint, points.min(axis=0), points.max(axis=0)))
        low = np.array([row[2] for row in found]).reshape(-1, 3)
        high = np.array([row[3] for row in found]).reshape(-1, 3)
        return cls(
            body=np.array([row[0] for row in found], np.int64),
            joint=np.array([row[1] for row in found], np.int64),
            centre=(low + high) / 2,
            half=(high - low) / 2,
        )

    def boxes(self, T_base_joint: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Low and high corners (n, bodies, 3) at joint frames (n, dof, 4, 4)."""
        T = T_base_joint[:, self.joint]
        R, origin = T[..., :3, :3], T[..., :3, 3]
        middle = (R @ self.centre[..., None])[..., 0] + origin
        room = (np.abs(R) @ self.half[..., None])[..., 0]
        return middle - room, middle + room


def _corners(shape: Solid) -> FloatArray:
    """Corners of the convex body that checks with a wide margin are made with."""
    points = corner_points(shape)
    hull = convex_hull(points)
    return points if hull is None else np.array(hull.points())
