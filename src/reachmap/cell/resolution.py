"""Writing a cell out in full, so that it needs fewer files and no folder."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from reachmap.cell.bins.support import with_bins_on_supports
from reachmap.cell.files.files import CellFiles
from reachmap.cell.files.joint_limits import tighten_limits
from reachmap.cell.files.resources import SCHEME, SHIPPED, Resolver, shipped_folder
from reachmap.cell.model.cell import Cell
from reachmap.cell.mounting import check_bins_stand, write_out_base_pose
from reachmap.cell.pick_cycle import joint_value_places
from reachmap.cell.references import moving_joints
from reachmap.cell.text.data import at
from reachmap.cell.text.messages import add_validation_errors
from reachmap.cell.text.yaml_reader import Document


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
    check_bins_stand(document, resolved)
    resolved = with_bins_on_supports(document, resolved)
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
        values = srdf.states[given["group_state"]]
        missing = [name for name in moving if name not in values]
        if missing:
            location = (*place, "group_state")
            document.add(location, f"the state lacks joints: {', '.join(missing)}")
        given["q_rad"] = {name: values[name] for name in moving if name in values}
        given["group_state"] = None
    document.raise_mistakes()
