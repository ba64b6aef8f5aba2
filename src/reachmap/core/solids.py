"""The cell as triangles with names, for pictures: what is shown is what is checked.

The shapes are the collision shapes, of links and of bodies alike, so a picture
of two bodies in contact shows why a configuration was refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from reachmap._typing import FloatArray, IntArray
from reachmap.core.bodies import build_geometry
from reachmap.core.robot import RobotModel
from reachmap.core.tessellation import (
    Triangles,
    box_triangles,
    capsule_triangles,
    cylinder_triangles,
)

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

Kind: TypeAlias = Literal["link", "tool", "body", "bin"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """One rigid shape.

    Attributes
    ----------
    name : str
        As in ``body_pairs``; a link with several shapes has several solids.
    kind : {"link", "tool", "body", "bin"}
        A tool is a body that the arm carries, a body stands still.
    joint : int
        Joint that carries it, 0 for what stands still.
    T_joint_solid : array, shape (4, 4)
    vertices : array, shape (n, 3)
        In the solid's own frame [m].
    triangles : int array, shape (m, 3)
    """

    name: str
    kind: Kind
    joint: int
    T_joint_solid: FloatArray
    vertices: FloatArray = field(repr=False)
    triangles: IntArray = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolidCell:
    """All solids of a cell, and where they are at a configuration.

    Attributes
    ----------
    loaded : LoadedCell
    robot : RobotModel
    solids : tuple of Solid
    scan_configuration : array, shape (dof,)
        [rad].
    """

    loaded: LoadedCell = field(repr=False)
    robot: RobotModel
    solids: tuple[Solid, ...]
    scan_configuration: FloatArray

    @classmethod
    def build(cls, loaded: LoadedCell) -> SolidCell:
        """Load the shapes of a cell, bin included.

        Raises
        ------
        SceneError
            A frame, joint or mesh cannot be used.
        """
        robot = RobotModel.from_cell(loaded)
        bodies = build_geometry(robot, loaded, with_bin=True)
        own = {body.name for body in loaded.cell.bodies}
        solids = []
        for name, shape in zip(
            bodies.names, bodies.geometry.geometryObjects, strict=True
        ):
            vertices, triangles = _triangles_of(shape.geometry)
            solids.append(
                Solid(
                    name=name,
                    kind=_kind(name, int(shape.parentJoint), own),
                    joint=int(shape.parentJoint),
                    T_joint_solid=np.array(shape.placement.homogeneous),
                    vertices=vertices,
                    triangles=triangles,
                )
            )
        return cls(
            loaded=loaded,
            robot=robot,
            solids=tuple(solids),
            scan_configuration=robot.configuration(
                loaded.scan_configuration_rad, "scan_configuration"
            ),
        )

    def joint_poses(self, q: FloatArray) -> FloatArray:
        """Poses of all joints in robot_base, shape (dof + 1, 4, 4); 0 is the root."""
        data = self.robot.model.createData()
        pin.forwardKinematics(self.robot.model, data, np.asarray(q, float))
        poses = np.array([placement.homogeneous for placement in data.oMi])
        return np.asarray(self.robot.T_base_root @ poses)

    def solid_poses(self, q: FloatArray) -> FloatArray:
        """Poses of all solids in robot_base, shape (solids, 4, 4)."""
        joints = self.joint_poses(q)
        return np.array([joints[s.joint] @ s.T_joint_solid for s in self.solids])

    def tcp_pose(self, q: FloatArray) -> FloatArray:
        """T_base_tcp, shape (4, 4)."""
        joint = self.joint_poses(q)[self.robot.tcp_joint]
        return np.asarray(joint @ self.robot.T_joint_tcp)

    def camera_frame(self) -> tuple[int, FloatArray] | None:
        """Joint that carries the camera, and its optical frame there (4, 4)."""
        camera = self.loaded.cell.camera
        if camera is None:
            return None
        joint, T_joint_parent = self.robot.frame_placement(camera.parent)
        return joint, T_joint_parent @ camera.matrix()


def _kind(name: str, joint: int, own: set[str]) -> Kind:
    if name in own:
        return "tool" if joint else "body"
    return "bin" if name.startswith("bin ") and joint == 0 else "link"


def _triangles_of(shape: Any) -> Triangles:
    if isinstance(shape, coal.BVHModelBase):
        corners = [shape.tri_indices(k) for k in range(shape.num_tris)]
        triangles = np.array([[t[0], t[1], t[2]] for t in corners], np.int64)
        return np.asarray(shape.vertices(), float), triangles.reshape(-1, 3)
    if isinstance(shape, coal.Box):
        return box_triangles(2.0 * np.asarray(shape.halfSide).ravel())
    if isinstance(shape, coal.Cylinder):
        return cylinder_triangles(shape.radius, 2.0 * shape.halfLength)
    if isinstance(shape, coal.Capsule):
        return capsule_triangles(shape.radius, 2.0 * shape.halfLength)
    if isinstance(shape, coal.Sphere):
        return capsule_triangles(shape.radius, 0.0)
    if isinstance(shape, coal.ConvexBase):
        points = np.array([shape.point(k) for k in range(shape.num_points)], float)
        return points, np.asarray(ConvexHull(points).simplices, np.int64)
    return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
