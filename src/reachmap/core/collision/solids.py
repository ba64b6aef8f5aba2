"""The cell as named triangle meshes, for pictures: what is shown is what is checked.

The shapes are the collision shapes, of links and of bodies alike, so a picture
of two bodies in contact shows why a configuration was refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.shapes import triangles_of
from reachmap.core.collision.bodies import build_geometry
from reachmap.core.collision.camera import camera_placement
from reachmap.core.robot.model import RobotModel

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
        for name, body, shape in zip(
            bodies.names, bodies.geometry.geometryObjects, bodies.shapes, strict=True
        ):
            surface = triangles_of(shape)
            solids.append(
                Solid(
                    name=name,
                    kind=_kind(name, int(body.parentJoint), own),
                    joint=int(body.parentJoint),
                    T_joint_solid=np.array(body.placement.homogeneous),
                    vertices=surface.vertices,
                    triangles=surface.triangles,
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
        """Poses of all joints in robot_base, shape (joints + 1, 4, 4); 0 is the root.

        First those of the arm, then those that follow them.
        """
        model = self.robot.body_model
        data = model.createData()
        q_bodies = self.robot.body_configuration(np.asarray(q, float))
        pin.forwardKinematics(model, data, q_bodies)
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
        return camera_placement(self.robot, self.loaded.cell)


def _kind(name: str, joint: int, own: set[str]) -> Kind:
    if name in own:
        return "tool" if joint else "body"
    if joint == 0 and " bin " in f" {name}":
        return "bin" if name.startswith("bin ") else "body"
    return "link"
