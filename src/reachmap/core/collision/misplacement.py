"""Errors in the poses of bin and tool: their bodies moved, and how far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.model.shapes import corner_points
from reachmap.core.collision.bodies import BodyGeometry
from reachmap.core.robot.model import RobotModel
from reachmap.geometry import inverse_transform, transform_points

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Misplacement:
    """Actual poses of bin and tool, which differ from those of the cell.

    Attributes
    ----------
    T_base_bin : array, shape (4, 4)
        The bin as it stands.
    T_mount_tool : array, shape (4, 4)
        How the tool is turned and shifted in the frame that it is mounted to,
        ``robot.tcp.parent``; the identity where it is not.
    """

    T_base_bin: FloatArray
    T_mount_tool: FloatArray


class MovableBodies:
    """Bodies of a cell, some of which belong to its bin and some to its tool.

    The tool is all that moves with the TCP but for the link that the last joint ends
    in.

    Parameters
    ----------
    robot : RobotModel
    loaded : LoadedCell
    bodies : BodyGeometry
        Of the cell, with its bin.

    Attributes
    ----------
    is_bin, is_tool : bool array, shape (bodies,)
    """

    def __init__(
        self, robot: RobotModel, loaded: LoadedCell, bodies: BodyGeometry
    ) -> None:
        self._robot, self._bodies = robot, bodies
        self._T_base_bin = loaded.cell.T_base_bin()
        _, self._T_joint_mount = robot.frame_placement(loaded.cell.robot.tcp.parent)
        flange = loaded.robot.joints[robot.joint_names[robot.tcp_joint - 1]].child
        joints = [int(body.parentJoint) for body in bodies.geometry.geometryObjects]
        self.is_bin = np.array([name.startswith("bin ") for name in bodies.names], bool)
        self.is_tool = np.array(
            [
                joint == robot.tcp_joint and name != flange
                for joint, name in zip(joints, bodies.names, strict=True)
            ],
            bool,
        )

    def moved(self, misplacement: Misplacement) -> BodyGeometry:
        """The same bodies where a misplacement puts them."""
        robot, geometry = self._robot, self._bodies.geometry.copy()
        T_root_moved = (
            robot.T_root_base
            @ misplacement.T_base_bin
            @ inverse_transform(self._T_base_bin)
            @ robot.T_base_root
        )
        T_mount = self._T_joint_mount
        T_joint_moved = T_mount @ misplacement.T_mount_tool @ inverse_transform(T_mount)
        for mask, T in ((self.is_bin, T_root_moved), (self.is_tool, T_joint_moved)):
            for k in np.flatnonzero(mask).tolist():
                body = geometry.geometryObjects[k]
                placement = T @ body.placement.homogeneous
                body.placement = pin.SE3(np.ascontiguousarray(placement))
        return BodyGeometry(
            geometry=geometry, names=self._bodies.names, shapes=self._bodies.shapes
        )

    def bin_reach_m(self, T_base_frame: FloatArray) -> float:
        """Greatest distance of a point of the bin from a frame's origin [m]."""
        T_base_root = self._robot.T_base_root
        origin = (inverse_transform(T_base_root) @ T_base_frame)[:3, 3]
        return self._reach_m(self.is_bin, origin)

    def tool_reach_m(self) -> float:
        """Greatest distance of a point of the tool from its mount [m]."""
        return self._reach_m(self.is_tool, self._T_joint_mount[:3, 3])

    def _reach_m(self, mask: BoolArray, origin: FloatArray) -> float:
        reach = [0.0]
        for k in np.flatnonzero(mask).tolist():
            T = self._bodies.geometry.geometryObjects[k].placement.homogeneous
            points = transform_points(T, corner_points(self._bodies.shapes[k]))
            reach.append(float(np.linalg.norm(points - origin, axis=1).max()))
        return max(reach)
