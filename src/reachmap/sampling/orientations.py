"""Families of tool orientations as rotation matrices.

They are about the z axis of a reference frame, which is the world's vertical unless a
family names another.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.orientations import ConeFamily, ListFamily
from reachmap.geometry import AXES, rotation_from_rpy_deg, upright_rotation


def orientation_set(
    family: ConeFamily | ListFamily, approach_axis: str = "+z"
) -> FloatArray:
    """Every TCP orientation of a family, in the family's own order.

    Cones run ring → azimuth → roll, the last fastest.

    Parameters
    ----------
    family : ConeFamily or ListFamily
    approach_axis : {"+x", "-x", "+y", "-y", "+z", "-z"}
        Axis of the TCP that points into the object. A list ignores it: its
        orientations are those of the TCP itself.

    Returns
    -------
    array, shape (m, 3, 3)
        R_reference_tcp.
    """
    if isinstance(family, ListFamily):
        return rotation_from_rpy_deg(np.array(family.rpy_deg))
    upright = straight_down_orientation(approach_axis)
    blocks = []
    for ring in family.rings():
        rolls_deg = ring.roll_offset_deg + (
            np.arange(ring.rolls) * family.roll_span_deg / ring.rolls
        )
        azimuths_deg = np.arange(ring.azimuths) * 360.0 / ring.azimuths
        for azimuth_deg in family.azimuth_offset_deg + azimuths_deg:
            tilt = _tilt_rotation(ring.tilt_deg, azimuth_deg)
            approach = -tilt[:, 2]
            roll = Rotation.from_rotvec(np.outer(np.radians(rolls_deg), approach))
            blocks.append(roll.as_matrix() @ (tilt @ upright))
    return np.concatenate(blocks)


def reference_rotation(
    family: ConeFamily | ListFamily,
    cell: Cell,
    R_base_own: FloatArray,
    R_base_bin: FloatArray,
) -> FloatArray:
    """R_base_reference of a family, shape (3, 3).

    Parameters
    ----------
    family : ConeFamily or ListFamily
    cell : Cell
    R_base_own : array, shape (3, 3)
        What is scanned, in robot_base: the identity for the workspace, the bin for the
        bin. A family about the world's vertical takes its heading from it.
    R_base_bin : array, shape (3, 3)
    """
    if family.reference == "robot_base":
        return np.eye(3)
    if family.reference == "bin":
        return R_base_bin
    if family.reference is None:
        return R_base_own
    R_world_base = cell.robot.base_pose.matrix()[:3, :3]
    return R_base_own @ upright_rotation(R_world_base @ R_base_own)


def straight_down_orientation(approach_axis: str) -> FloatArray:
    """R_reference_tcp of a tool that points straight down, shape (3, 3).

    The approach axis lies along reference -z, and the next axis of the TCP in cyclic
    order (x → y → z → x) along reference +x.
    """
    axis, sign = AXES[approach_axis]
    R = np.zeros((3, 3))
    R[2, axis] = -sign
    R[0, (axis + 1) % 3] = 1.0
    # The third column completes a right-handed frame.
    R[:, (axis + 2) % 3] = np.cross(R[:, axis], R[:, (axis + 1) % 3])
    return R + 0.0


def _tilt_rotation(tilt_deg: float, azimuth_deg: float) -> FloatArray:
    """Smallest rotation from straight down to the tilted direction, (3, 3).

    The direction is (sin t cos φ, sin t sin φ, -cos t), so the axis is horizontal and
    square to the azimuth.
    """
    azimuth = np.radians(azimuth_deg)
    axis = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    return np.asarray(Rotation.from_rotvec(np.radians(tilt_deg) * axis).as_matrix())
