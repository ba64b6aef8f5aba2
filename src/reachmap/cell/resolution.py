"""Writing a cell out in full, so that it needs fewer files and no folder.

Shorthand of what carries the arm, names of the SRDF and limits of MoveIt give way to
what they stand for, and paths become absolute.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from reachmap.cell.bins.support import with_standing_bins
from reachmap.cell.files.files import CellFiles
from reachmap.cell.files.joint_limits import tighten_limits
from reachmap.cell.files.resources import SCHEME, SHIPPED, Resolver, shipped_folder
from reachmap.cell.files.urdf import UrdfDescription
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.robot import MountSpec
from reachmap.cell.pick_cycle import joint_value_places
from reachmap.cell.references import moving_joints
from reachmap.cell.text.data import at
from reachmap.cell.text.messages import add_validation_errors
from reachmap.cell.text.yaml_reader import Document
from reachmap.geometry import (
    UPRIGHT_RAD,
    quaternion_wxyz_from_rotation,
    rotation_from_rpy_deg,
    tilt_rad,
)


def validated(document: Document) -> Cell | None:
    """Validate the document's data; None, with mistakes added, if it is wrong."""
    try:
        return cell_from_data(document.data)
    except ValidationError as error:
        add_validation_errors(document, error, Cell)
    except (ValueError, OverflowError, RecursionError) as error:
        document.add((), f"cannot be read: {error}")
    return None


def cell_from_data(data: Any) -> Cell:
    """Cell of plain data; pydantic's ValidationError if it is wrong."""
    # Strict, and through JSON: quoted numbers and booleans in number fields are
    # mistakes, while lists may still become tuples.
    return Cell.model_validate_json(json.dumps(data), strict=True)


def resolved_cell(
    document: Document, cell: Cell, files: CellFiles, directory: Path
) -> Cell:
    """Write out SRDF names and MoveIt limits, and make paths absolute.

    Raises
    ------
    CellError
        A group or group state does not fit the arm, or limits leave no range.
    """
    data = cell.model_dump(mode="json")
    robot = data["robot"]
    data["resources"]["packages"] = {
        name: os.path.normpath((directory / folder).absolute())
        for name, folder in data["resources"]["packages"].items()
    }
    for key in ("urdf", "srdf"):
        if robot[key]:
            robot[key] = _portable(robot[key], files.resolver)
    solids = [*data["bodies"], *data["parts"].values()]
    solids += [data["part"]] if isinstance(data["part"], dict) else []
    trays = [data["bin"], *data["bins"].values()]
    meshes = [
        *(solid["shape"]["mesh"] for solid in solids),
        *(t["mesh"] for t in trays),
    ]
    for mesh in meshes:
        if mesh:
            mesh["file"] = _portable(mesh["file"], files.resolver)
    _write_out_srdf(document, data, files)
    if files.robot is not None:
        if files.joint_limits:
            moving = moving_joints(data, files.robot, files.srdf_description)
            for problem in tighten_limits(
                robot["limits"], files.joint_limits, files.robot, moving
            ):
                document.add(("robot", "joint_limits"), problem)
            document.raise_mistakes()
        robot["joint_limits"] = None
        write_out_base_pose(document, data, files.robot)
    try:
        resolved = cell_from_data(data)
    except ValidationError as error:
        add_validation_errors(document, error, Cell)
        document.raise_mistakes()
        raise
    resolved = with_standing_bins(document, resolved)
    document.raise_mistakes()
    return resolved


def _portable(reference: str, resolver: Resolver) -> str:
    """Make a reference usable from another folder: package:// or absolute."""
    if reference.startswith(SCHEME):
        return reference
    path = resolver.resolve(reference)
    shipped = shipped_folder()
    if path.is_relative_to(shipped):
        return f"{SCHEME}{SHIPPED}/{path.relative_to(shipped).as_posix()}"
    return str(path)


def _write_out_srdf(document: Document, data: dict[str, Any], files: CellFiles) -> None:
    """Replace group and group_state by the joints and positions they stand for."""
    srdf, robot = files.srdf_description, files.robot
    if srdf is None or robot is None:
        return
    cell_robot = data["robot"]
    if cell_robot["group"] is not None:
        locked = cell_robot["locked_joints_deg"]
        names = [n for n in srdf.groups[cell_robot["group"]] if n not in locked]
        if not names:
            document.add(("robot", "group"), "the group has no joint that moves")
        cell_robot["joints"] = cell_robot["joints"] or names
        cell_robot["group"] = None
    moving = moving_joints(data, robot, srdf)
    for place in joint_value_places(data):
        given = at(data, *place)
        if given["group_state"] is None:
            continue
        state = given["group_state"]
        values, broken = srdf.states[state], srdf.broken.get(state, {})
        missing = [name for name in moving if name not in values]
        unsaid = [name for name in missing if name not in broken]
        faults = [broken[name] for name in missing if name in broken]
        if unsaid:
            faults.append(f"the state lacks joints: {', '.join(unsaid)}")
        for fault in faults:
            document.add((*place, "group_state"), fault)
        given["q_rad"] = {name: values[name] for name in moving if name in values}
        given["group_state"] = None
    document.raise_mistakes()


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
