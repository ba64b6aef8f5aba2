"""Whether a bin leaves room where parts are put down."""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import DropOffSpec
from reachmap.core.collision.bin_fit import ToolFit
from reachmap.core.scene import Scene
from reachmap.geometry import axis_vector, inverse_transform
from reachmap.scans.cycle.places import drop_off_poses


class DropOffRoom:
    """The tool with the part at the drop-offs of a cell.

    A bin leaves room where the tool can be at each drop-off, and where its straight
    approach begins, in one of the equivalent poses. The arm is left out: how it gets
    there is for the cycle to say. A drop-off in the bin itself moves with it, and one
    in a bin that is not there yet has no place.

    Parameters
    ----------
    scene : Scene
        Without the bin.
    """

    def __init__(self, scene: Scene) -> None:
        cell = scene.loaded.cell
        self._tool = ToolFit(scene.robot, scene.loaded, load="carried", whole=True)
        still = {"world", "robot_base", *cell.bins, *(b.name for b in cell.bodies)}
        self._poses = {
            spec.name: _poses(scene, spec)
            for spec in cell.drop_offs
            if spec.pose is None or spec.frame in still
        }

    def taken(self, T_base_bin: FloatArray) -> str:
        """Name of the first drop-off that a bin at a pose (4, 4) takes up, or ""."""
        T_bin_base = inverse_transform(T_base_bin)
        for name, T in self._poses.items():
            blocked = self._tool.blocked((T_bin_base @ T).reshape(-1, 4, 4))
            if blocked.reshape(T.shape[:2]).any(axis=1).all():
                return name
        return ""


def _poses(scene: Scene, spec: DropOffSpec) -> FloatArray:
    """T_base_tcp when the part is released and before, shape (equivalent, 2, 4, 4)."""
    cell = scene.loaded.cell
    if spec.pose is None:
        values = scene.loaded.joint_values_rad(spec)
        q = scene.robot.configuration(values, f"drop_off {spec.name}")
        released = scene.kinematics.forward(q)[None]
    else:
        released = drop_off_poses(cell, spec)
    before = np.eye(4)
    axis = axis_vector(cell.robot.tcp.approach_axis)
    before[:3, 3] = -spec.approach_distance_m * axis
    return np.stack([released, released @ before], axis=1)
