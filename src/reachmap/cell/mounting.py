"""How the arm and the bin stand in the world, read from the cell and its URDF."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from pydantic import ValidationError

from reachmap.cell.files.urdf import UrdfDescription
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.robot import MountSpec
from reachmap.cell.text.data import at
from reachmap.cell.text.yaml_reader import Document
from reachmap.geometry import (
    UPRIGHT_RAD,
    inverse_transform,
    quaternion_wxyz_from_rotation,
    rotation_from_rpy_deg,
    tilt_rad,
)

# Parts slide out of a bin long before; it is a bin that was meant to stand.
MAX_BIN_TILT_DEG = 75.0


def write_out_base_pose(
    document: Document, data: dict[str, Any], robot: UrdfDescription
) -> None:
    """Let the URDF say how the arm hangs, where the cell does not.

    Without ``robot.base_pose`` the world is robot_base. Where fixed joints turn
    robot_base away from the upright, the URDF's root link is the world instead.

    Parameters
    ----------
    document : Document
        The cell as read.
    data : dict
        The cell after defaults; ``robot.base_pose`` is changed.
    robot : UrdfDescription
    """
    frame = data["robot"]["base_frame"]
    if frame is None or at(document.data, "robot", "base_pose") is not None:
        return
    link = frame if frame in robot.links else robot.joints[frame].child
    T_root_base = robot.fixed_to(robot.root).get(link, np.eye(4))
    if tilt_rad(T_root_base[:3, :3]) < UPRIGHT_RAD:
        return
    data["robot"]["base_pose"] = {
        "xyz": T_root_base[:3, 3].tolist(),
        "quaternion_wxyz": quaternion_wxyz_from_rotation(T_root_base[:3, :3]).tolist(),
    }


def write_out_mount(document: Document) -> None:
    """Set ``robot.base_pose`` and a body to what ``robot.mount`` stands for.

    What is wrong with the mount itself is left to validation.
    """
    given = at(document.data, "robot", "mount")
    bodies = at(document.data, "bodies")
    if not isinstance(given, dict) or not isinstance(bodies, list | None):
        return
    try:
        mount = MountSpec.model_validate_json(json.dumps(given), strict=True)
    except (ValidationError, ValueError, RecursionError):
        return
    pose, body = _base_of(mount), _body_of(mount)
    place = ("robot", "base_pose")
    own = at(document.data, *place)
    if place in document.places and own is not None and own != pose:
        document.add(place, "contradicts robot.mount: give one of the two")
    document.data["robot"]["base_pose"] = pose
    if body is not None:
        named = {at(item, "name"): item for item in bodies or []}
        document.data["bodies"] = [*(named | {mount.name: body}).values()]


def _base_of(mount: MountSpec) -> dict[str, Any]:
    """The base pose, as the data of a cell have it."""
    angles = [0.0, mount.lean_deg, mount.yaw_deg]
    return {"xyz": [*mount.at, mount.height], "rpy_deg": angles}


def _body_of(mount: MountSpec) -> dict[str, Any] | None:
    """The body behind the base, None where there is none.

    A pedestal stands upright however the base leans.
    """
    if mount.size is None:
        return None
    length, angles = mount.body_length, [0.0, mount.lean_deg, mount.yaw_deg]
    if mount.kind == "pedestal":
        angles[1] = 0.0
    z_axis = rotation_from_rpy_deg(np.array(angles))[:, 2]
    centre = np.array([*mount.at, mount.height]) - (mount.gap + length / 2) * z_axis
    return {
        "name": mount.name,
        "attach_to": "world",
        "shape": {"box": [*mount.size, length]},
        "pose": {"xyz": (np.round(centre, 9) + 0.0).tolist(), "rpy_deg": angles},
        "touch": list(mount.touch),
    }


def check_bins_stand(document: Document, cell: Cell) -> None:
    """Add a mistake where a bin stands on its side or its head in the world."""
    T_world_base = inverse_transform(cell.T_base_world())
    leans = tilt_rad(T_world_base[:3, :3]) > 0
    for place, spec in cell.every_bin():
        T_world_bin = T_world_base @ cell.T_base_of(spec)
        tilt = float(np.degrees(tilt_rad(T_world_bin[:3, :3])))
        if tilt <= MAX_BIN_TILT_DEG:
            continue
        hint = (
            "robot_base itself is tilted, so give the pose in the world with "
            f"{'.'.join(place)}.frame: world"
            if leans and spec.frame == "robot_base"
            else "its z axis must point up"
        )
        document.add(
            (*place, "pose"),
            f"the bin is tilted {tilt:.0f} deg from upright in the world and would "
            f"spill (allowed: {MAX_BIN_TILT_DEG:g}); {hint}",
        )


def leaning_levels(cell: Cell) -> str:
    """Warning that the levels of the workspace scan are not horizontal, or ""."""
    R_world_grid = cell.robot.base_pose.matrix()[:3, :3] @ cell.T_base_grid()[:3, :3]
    tilt = tilt_rad(R_world_grid)
    lean = float(np.degrees(min(tilt, np.pi - tilt)))
    if lean < np.degrees(UPRIGHT_RAD):
        return ""
    return (
        f"workspace_scan.cubes: the levels are tilted by {lean:.3g} deg, as robot_base "
        "is; workspace_scan.frame: world makes them horizontal"
    )
