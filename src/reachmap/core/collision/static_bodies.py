"""Bodies at fixed poses, and shapes that are checked against them one by one.

Where everything but one shape is static, moving that shape costs microseconds: only
bodies whose boxes it overlaps are checked.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.collision.bodies import BodyGeometry
from reachmap.core.robot.model import RobotModel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedBody:
    """A body at a fixed place.

    Attributes
    ----------
    name : str
    joint : int
        Index of the joint that carries it, 0 for what stands still.
    shape : coal.CollisionGeometry
    T : array, shape (4, 4)
        Pose of the shape, in the frame that the bodies are collected in.
    """

    name: str
    joint: int
    shape: Any
    T: FloatArray


class PlacedBodies:
    """Bodies among which shapes are tried.

    Parameters
    ----------
    bodies : iterable of PlacedBody
    margin_m : float
        A shape closer than this counts as touching.
    """

    def __init__(self, bodies: Iterable[PlacedBody], margin_m: float = 0.0) -> None:
        self.bodies = tuple(bodies)
        self._transforms = [_transform(body.T) for body in self.bodies]
        boxes = [box_around(body.shape, body.T) for body in self.bodies]
        self._low = np.array([low for low, _ in boxes]).reshape(-1, 3) - margin_m
        self._high = np.array([high for _, high in boxes]).reshape(-1, 3) + margin_m
        self._request = coal.CollisionRequest()
        self._request.security_margin = margin_m
        self._result = coal.CollisionResult()

    def near(self, low: FloatArray, high: FloatArray) -> list[int]:
        """Bodies whose boxes meet the box between two corners (3,)."""
        return np.flatnonzero(self.near_many(low, high)).tolist()

    def near_many(self, low: FloatArray, high: FloatArray) -> BoolArray:
        """Whether boxes between corners (..., 3) meet those of the bodies, (..., n)."""
        below, above = low[..., None, :], high[..., None, :]
        return np.asarray(((self._low <= above) & (self._high >= below)).all(axis=-1))

    def touching(self, shape: Any, T: FloatArray, among: Sequence[int]) -> int:
        """First body of ``among`` that a shape at T touches, or -1."""
        if not among:
            return -1
        place = _transform(T)
        for k in among:
            self._result.clear()
            if coal.collide(
                shape,
                place,
                self.bodies[k].shape,
                self._transforms[k],
                self._request,
                self._result,
            ):
                return k
        return -1

    def first_touched(self, shape: Any, T: FloatArray) -> int:
        """First body that a shape at T touches, or -1."""
        return self.touching(shape, T, self.near(*box_around(shape, T)))


def bodies_at(
    robot: RobotModel, bodies: BodyGeometry, q: FloatArray
) -> list[PlacedBody]:
    """Every body of a cell with the arm at q, in robot_base."""
    model, q_bodies = robot.body_model, robot.body_configuration(q)
    data, placed = model.createData(), bodies.geometry.createData()
    pin.updateGeometryPlacements(model, data, bodies.geometry, placed, q_bodies)
    return [
        PlacedBody(
            name=name,
            joint=int(body.parentJoint),
            shape=body.geometry,
            T=robot.T_base_root @ np.array(place.homogeneous),
        )
        for name, body, place in zip(
            bodies.names, bodies.geometry.geometryObjects, placed.oMg, strict=True
        )
    ]


def box_around(shape: Any, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Corners (..., 3) of the boxes around a shape at poses T (..., 4, 4)."""
    shape.computeLocalAABB()
    low, high = np.array(shape.aabb_local.min_), np.array(shape.aabb_local.max_)
    centre = T[..., :3, :3] @ ((low + high) / 2) + T[..., :3, 3]
    half = np.abs(T[..., :3, :3]) @ ((high - low) / 2)
    return centre - half, centre + half


def _transform(T: FloatArray) -> Any:
    return coal.Transform3s(
        np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3])
    )
