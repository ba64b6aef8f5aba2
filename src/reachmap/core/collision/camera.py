"""Visibility: whether a body occludes what the camera looks at."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import coal
import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import Cell
from reachmap.core.collision.bodies import ROOT, build_geometry
from reachmap.core.collision.shapes import convex_hull
from reachmap.core.collision.static_bodies import (
    PlacedBodies,
    PlacedBody,
    bodies_at,
)
from reachmap.core.trace import Trace
from reachmap.geometry import inverse_transform, transform_from_parts

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.core.robot.model import RobotModel
    from reachmap.core.scene import Scene

# A choice: a body that reaches into this sphere is the camera's housing or a cover.
LENS_RADIUS_M = 0.001


def camera_placement(robot: RobotModel, cell: Cell) -> tuple[int, FloatArray]:
    """Joint that carries a cell's camera (0: it stands), and T_joint_camera (4, 4)."""
    assert cell.camera is not None
    parent, T_parent = cell.camera.parent, np.eye(4)
    for body in cell.bodies:
        if body.name == parent:
            parent, T_parent = body.attach_to, body.pose.matrix()
            break
    joint, T_joint_frame = robot.frame_placement(parent)
    return joint, np.asarray(T_joint_frame @ T_parent @ cell.camera.matrix())


class Camera:
    """A cell's camera, and the bodies that may occlude its view.

    Parameters
    ----------
    robot : RobotModel
    loaded : LoadedCell
        With a camera; its bin is among the bodies.

    Attributes
    ----------
    is_carried : bool
        Whether it moves with the TCP.
    stands : bool
        Whether no joint moves it.
    T_tcp_camera : array, shape (4, 4)
        Optical frame in the TCP's, for a camera that is carried.
    """

    def __init__(self, robot: RobotModel, loaded: LoadedCell) -> None:
        spec = loaded.cell.camera
        if spec is None:
            raise ValueError("this cell has no camera")
        self._robot = robot
        self._bodies = build_geometry(robot, loaded, with_bin=True)
        self._joint, self._T_joint_camera = camera_placement(robot, loaded.cell)
        self.stands = self._joint == ROOT
        self.is_carried = self._joint == robot.tcp_joint
        self.T_tcp_camera = inverse_transform(robot.T_joint_tcp) @ self._T_joint_camera
        self._around_lens = self._bodies_around_lens()

    def T_base_camera(self, q: FloatArray) -> FloatArray:  # noqa: N802
        """Optical frame in robot_base with the arm at q, shape (4, 4)."""
        data = self._robot.model.createData()
        pin.forwardKinematics(self._robot.model, data, q)
        T_root_joint = np.array(data.oMi[self._joint].homogeneous)
        return np.asarray(self._robot.T_base_root @ T_root_joint @ self._T_joint_camera)

    def hidden_by(
        self, q: FloatArray, T_base_camera: FloatArray, corners: FloatArray
    ) -> str:
        """Name of a body that hides part of a convex volume, or "".

        All lines of sight to the volume lie in the convex hull of its corners and
        the lens, so one collision check answers for all of them. Bodies that the
        lens itself is inside of, such as its housing, are taken to have a window.

        Parameters
        ----------
        q : array, shape (dof,)
        T_base_camera : array, shape (4, 4)
            Of this configuration.
        corners : array, shape (n, 3)
            robot_base [m].
        """
        found = self._hidden_by(q, T_base_camera, corners)
        if Trace.current is not None:
            Trace.current.note_other(_hidden_in, found, q, T_base_camera, corners)
        return found

    def _hidden_by(
        self, q: FloatArray, T_base_camera: FloatArray, corners: FloatArray
    ) -> str:
        lens = T_base_camera[:3, 3]
        cone = convex_hull(np.vstack([lens, corners]))
        bodies = [
            body
            for index, body in enumerate(bodies_at(self._robot, self._bodies, q))
            if index not in self._around_lens
        ]
        placed = PlacedBodies(bodies)
        hit = placed.first_touched(cone, np.eye(4))
        return placed.bodies[hit].name if hit >= 0 else ""

    def _bodies_around_lens(self) -> set[int]:
        lens = coal.Sphere(LENS_RADIUS_M)
        found = set()
        for index, body in enumerate(self._bodies.geometry.geometryObjects):
            if int(body.parentJoint) != self._joint:
                continue
            T_body_camera = (
                inverse_transform(np.array(body.placement.homogeneous))
                @ self._T_joint_camera
            )
            place = transform_from_parts(np.eye(3), T_body_camera[:3, 3])
            if _solid(body.geometry).first_touched(lens, place) >= 0:
                found.add(index)
        return found


def _hidden_in(scene: Scene) -> Callable[..., Any]:
    return Camera(scene.robot, scene.loaded).hidden_by


def _solid(shape: object) -> PlacedBodies:
    """One body at the origin; a mesh, which is a surface, as its convex hull."""
    if isinstance(shape, coal.BVHModelBase):
        shape = convex_hull(np.asarray(shape.vertices(), float)) or shape
    return PlacedBodies([PlacedBody(name="", joint=0, shape=shape, T=np.eye(4))])
