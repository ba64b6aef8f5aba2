"""From the frame of a grasp list to robot_base, with the frames of the bin map."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.errors import GraspListError, MapFileError
from reachmap.geometry import (
    inverse_transform,
    rotation_from_quaternion_wxyz,
    rotation_from_rpy_deg,
    transform_from_parts,
)
from reachmap.maps.records import BinMap
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lookup.approach import tcp_rotation


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedGrasps:
    """Grasps in robot_base, orientations as those of the TCP.

    Attributes
    ----------
    points : array, shape (n, 3)
    directions : array, shape (n, 3)
    rotations : array, shape (n, 3, 3)
        NaN where the grasp has a direction only.
    """

    points: FloatArray
    directions: FloatArray
    rotations: FloatArray


def frames_of(bin_map: BinMap) -> dict[str, FloatArray]:
    """Frames that stand still in the cell, as poses in robot_base, (4, 4) each.

    ``bin``, ``robot_base``, ``world``, and the bodies fixed to the world or the base.
    What moves with the arm, the camera for one, has no place without a configuration
    and is not among them.
    """
    try:
        cell = json.loads(bin_map.provenance.cell_resolved_json or "{}")
        frames = _standing_frames(cell)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise MapFileError(f"the cell in the bin map is unreadable: {error}") from None
    return {**frames, "bin": bin_map.bin_pose}


def _standing_frames(cell: Mapping[str, Any]) -> dict[str, FloatArray]:
    base_pose = cell.get("robot", {}).get("base_pose")
    T_base_world = inverse_transform(pose_matrix(base_pose))
    parents = {"world": T_base_world, "robot_base": np.eye(4)}
    frames = {
        str(body["name"]): parents[body["attach_to"]] @ pose_matrix(body["pose"])
        for body in cell.get("bodies", [])
        if body["attach_to"] in parents
    }
    return {**frames, **parents}


def place_grasps(
    grasps: GraspList,
    frames: Mapping[str, FloatArray],
    tcp_axis: str,
    T_base_frame: FloatArray | None = None,
) -> PlacedGrasps:
    """Express grasps in robot_base, for the bin where the map has it.

    Parameters
    ----------
    grasps : GraspList
        With ``T_frame_bin``, the grasps keep their place in the bin and move with it
        from where it was to where it is; their frame may then have any name.
    frames : mapping
        Poses in robot_base, as :func:`frames_of` returns them.
    tcp_axis : str
        TCP axis that approaches, as the map has it.
    T_base_frame : array, shape (4, 4), optional
        Pose of the grasps' frame in robot_base, for frames the cell does not know.

    Raises
    ------
    GraspListError
        The frame is unknown, or it is stated twice and differently.
    """
    T = _frame_pose(grasps, frames, T_base_frame)
    R = T[:3, :3]
    return PlacedGrasps(
        points=grasps.points @ R.T + T[:3, 3],
        directions=grasps.directions @ R.T,
        rotations=tcp_rotation(R @ grasps.rotations, grasps.approach_axis, tcp_axis),
    )


def _frame_pose(
    grasps: GraspList,
    frames: Mapping[str, FloatArray],
    T_base_frame: FloatArray | None,
) -> FloatArray:
    if grasps.T_frame_bin is not None:
        if T_base_frame is not None:
            raise GraspListError(
                f"{grasps.source}: the list has a bin_pose, which places it; a pose of "
                "its frame besides would contradict it"
            )
        is_bin = grasps.frame == "bin"
        if is_bin and not np.allclose(grasps.T_frame_bin, np.eye(4), atol=1e-9):
            raise GraspListError(
                f"{grasps.source}: bin_pose: in the frame 'bin' the bin is at the "
                "origin; name the frame the bin_pose was measured in, or leave it out"
            )
        return frames["bin"] @ inverse_transform(grasps.T_frame_bin)
    if T_base_frame is not None:
        return T_base_frame
    if grasps.frame not in frames:
        known = ", ".join(sorted(frames))
        raise GraspListError(
            f"{grasps.source}: frame: {grasps.frame!a} is none of those that stand "
            f"still in the map's cell ({known}); give its pose with --frame-pose, or "
            "the list a bin_pose"
        )
    return frames[grasps.frame]


def pose_matrix(pose: Mapping[str, Any] | None) -> FloatArray:
    """Read a pose of the resolved cell, shape (4, 4)."""
    if not pose:
        return np.eye(4)
    if pose.get("quaternion_wxyz") is not None:
        R = rotation_from_quaternion_wxyz(np.array(pose["quaternion_wxyz"], float))
    else:
        R = rotation_from_rpy_deg(np.array(pose.get("rpy_deg") or (0, 0, 0), float))
    return transform_from_parts(R, np.array(pose.get("xyz", (0, 0, 0)), float))
