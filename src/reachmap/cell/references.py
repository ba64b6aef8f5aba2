"""Check that the frames, joints, links and bodies a cell names exist.

Works on the plain data of the file, not on the validated model, so that a missing
mesh is reported together with a misspelt key.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection
from pathlib import Path
from typing import Any

from reachmap.cell.bins.shell import place_doubt, size_doubt
from reachmap.cell.bins.shorthand import bin_places
from reachmap.cell.files.collisions import mesh_scales
from reachmap.cell.files.files import CellFiles, body_key
from reachmap.cell.files.srdf import SrdfDescription
from reachmap.cell.files.urdf import UrdfDescription
from reachmap.cell.meshes.reading import read_mesh
from reachmap.cell.model.bodies import BinSpec
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.fields import MAX_LENGTH_M
from reachmap.cell.model.shapes import sides
from reachmap.cell.pick_cycle import check_cycle_names, joint_value_places
from reachmap.cell.text.data import at, entries, text_at
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_reader import Document, Location

WORLD = ("world", "robot_base")


def check_names(
    document: Document, robot: UrdfDescription, srdf: SrdfDescription | None
) -> None:
    """Add a mistake for every frame, joint, group or body that does not exist."""
    _check_frames(document, robot)
    _check_body_names(document, robot)
    _check_bin_names(document, robot)
    _check_touch(document, robot)
    check_cycle_names(document, robot)
    _check_srdf_names(document, srdf)
    moving: tuple[str, ...] | None = moving_joints(document.data, robot, srdf)
    unsure = any(m.location[:1] == ("robot",) for m in document.mistakes)
    if not moving and not unsure:
        location = ("robot", "tcp", "parent")
        document.add(location, "no joint moves between the base and the TCP")
    if not moving:
        moving = None
    _check_joints(document, robot, moving)
    given = entries(document.data, "robot", "joints")
    # Otherwise what follows from a wrong chain would bury the cause.
    if moving is not None and len(moving) >= len(given):
        for place in joint_value_places(document.data):
            _check_joint_values(document, place, moving)


def moving_joints(
    data: Any, robot: UrdfDescription, srdf: SrdfDescription | None
) -> tuple[str, ...]:
    """Joints that move: given, of the SRDF group, or of the chain base to TCP."""
    given = at(data, "robot", "joints")
    if isinstance(given, list):
        return tuple(name for name in given if name in robot.joints)
    group = text_at(data, "robot", "group")
    if group is not None and srdf is not None and group in srdf.groups:
        names = srdf.groups[group]
    else:
        base = text_at(data, "robot", "base_frame") or robot.root
        tip = text_at(data, "robot", "tcp", "parent") or robot.root
        names = robot.chain(base, tip)
    locked = at(data, "robot", "locked_joints_deg")
    locked = locked if isinstance(locked, dict) else {}
    return tuple(name for name in names if name not in locked)


def _frames(robot: UrdfDescription) -> list[str]:
    return [*robot.links, *robot.joints]


def _check_frames(document: Document, robot: UrdfDescription) -> None:
    frames = _frames(robot)
    places: list[tuple[Location, list[str]]] = [
        (("robot", "tcp", "parent"), frames),
        (("robot", "base_frame"), frames),
        (("camera", "parent"), [*WORLD, *frames, *_body_names(document)]),
    ]
    for index in range(len(entries(document.data, "bodies"))):
        places.append((("bodies", index, "attach_to"), [*WORLD, *frames]))
    for location, known in places:
        name = text_at(document.data, *location)
        if name is not None and name not in known:
            hint = did_you_mean(name, known)
            document.add(location, f"no frame {name!r} in the URDF; {hint}")


def _body_names(document: Document) -> list[str]:
    names = [text_at(body, "name") for body in entries(document.data, "bodies")]
    return [name for name in names if name]


def _check_body_names(document: Document, robot: UrdfDescription) -> None:
    """Check that no body shares its name with a link or a wall of the bin."""
    for index, body in enumerate(entries(document.data, "bodies")):
        name = text_at(body, "name")
        if name is None:
            continue
        if name in robot.links or name in WORLD or name.split(" ")[0] == "bin":
            message = f"{name!r} is the name of a link, a frame or the bin"
            document.add(("bodies", index, "name"), message)


def _check_bin_names(document: Document, robot: UrdfDescription) -> None:
    """Check that no bin shares its name with something else."""
    taken = {*robot.links, *WORLD, *_body_names(document), "bin"}
    for name in _bin_names(document):
        if name in taken:
            message = f"{name!r} is the name of a link, a frame or a body"
            document.add(("bins", name), message, of_key=True)


def _bin_names(document: Document) -> list[str]:
    """Names of the bins, that of the bin to pick from last."""
    names = [str(place[-1]) for _, place in bin_places(document.data)[1:]]
    own = text_at(document.data, "bin", "name")
    return names if own is None else [*names, own]


def _check_touch(document: Document, robot: UrdfDescription) -> None:
    bodies = entries(document.data, "bodies")
    names = [text_at(body, "name") or "" for body in bodies]
    places = bin_places(document.data)
    bins = ["bin", *_bin_names(document)]
    known = [*robot.links, *(name for name in names if name), *bins]
    lists: list[Location] = [("bodies", i, "touch") for i in range(len(bodies))]
    for location in [*lists, *((*place, "touch") for _, place in places)]:
        for index, name in enumerate(entries(document.data, *location)):
            if isinstance(name, str) and name not in known:
                message = f"no link or body {name!r}; {did_you_mean(name, known)}"
                document.add((*location, index), message)


def _check_joints(
    document: Document, robot: UrdfDescription, moving: tuple[str, ...] | None
) -> None:
    every = [name for name, joint in robot.joints.items() if joint.type != "fixed"]
    data = document.data
    for index, name in enumerate(entries(data, "robot", "joints")):
        if not isinstance(name, str):
            continue
        if name not in every:
            hint = did_you_mean(name, every)
            document.add(
                ("robot", "joints", index), f"no moving joint {name!r}; {hint}"
            )
        elif not robot.joints[name].moves:
            kind = "mimic" if robot.joints[name].mimics else robot.joints[name].type
            document.add(
                ("robot", "joints", index),
                f"joint {name!r} ({kind}) cannot be planned for",
            )
    tables: list[tuple[Location, Collection[str] | None]] = [
        (("robot", "locked_joints_deg"), every),
        (("robot", "limits", "velocity_rad_s"), moving),
        (("robot", "limits", "acceleration_rad_s2"), moving),
        (("robot", "limits", "position_deg"), moving),
    ]
    for location, known in tables:
        table = at(data, *location)
        if known is not None and isinstance(table, dict):
            _check_keys(document, location, known)
    if moving is None:
        return
    redundant = text_at(data, "robot", "ik", "redundant_joint")
    if redundant is not None and redundant not in moving:
        hint = did_you_mean(redundant, moving)
        document.add(
            ("robot", "ik", "redundant_joint"),
            f"{redundant!r} is not a joint that moves; {hint}",
        )


def _check_keys(document: Document, location: Location, known: Collection[str]) -> None:
    """Add a mistake for every key of a table that is not one of the joints."""
    locked = at(document.data, "robot", "locked_joints_deg")
    locked = locked if isinstance(locked, dict) else {}
    for name in at(document.data, *location):
        if name in known:
            continue
        hint = (
            "it is held by robot.locked_joints_deg"
            if name in locked and location != ("robot", "locked_joints_deg")
            else did_you_mean(name, known)
        )
        document.add((*location, name), f"not a joint that moves; {hint}", of_key=True)


def _check_srdf_names(document: Document, srdf: SrdfDescription | None) -> None:
    places: list[tuple[Location, str]] = [(("robot", "group"), "group")]
    for place in joint_value_places(document.data):
        places.append(((*place, "group_state"), "group_state"))
    for location, kind in places:
        name = text_at(document.data, *location)
        if name is None:
            continue
        if text_at(document.data, "robot", "srdf") is None:
            document.add(location, f"a {kind} needs robot.srdf")
        elif srdf is not None:
            known = list(srdf.groups if kind == "group" else srdf.states)
            if name not in known:
                hint = did_you_mean(name, known) or "it has none"
                document.add(location, f"no {kind} {name!r} in the SRDF; {hint}")


def _check_joint_values(
    document: Document, place: Location, moving: tuple[str, ...]
) -> None:
    for key in ("q_deg", "q_rad"):
        location = (*place, key)
        table = at(document.data, *location)
        if not isinstance(table, dict):
            continue
        _check_keys(document, location, moving)
        unknown = [name for name in table if name not in moving]
        missing = [
            name
            for name in moving
            if name not in table and not difflib.get_close_matches(name, unknown)
        ]
        if missing:
            document.add(location, f"joints are missing: {', '.join(missing)}")


# No part of a cell is larger or smaller; files in millimetres or inches are.
LARGE_M = 10.0
TINY_M = 1e-3
# Below it, areas and volumes are lost in the rounding of coordinates.
NO_SIZE_M = 1e-9


def find_warnings(document: Document, cell: Cell, files: CellFiles) -> tuple[str, ...]:
    """Sentences about links that cannot collide, and sizes above 10 m or below 1 mm.

    A mesh larger than 100 m, or of no size, is a mistake of the document rather than a
    warning.
    """
    warnings: list[str] = []
    for index, body in enumerate(cell.bodies):
        location: Location = ("bodies", index, "shape")
        mesh = body.shape.mesh
        if mesh is not None:
            key, label = body_key(body.name, mesh.file), f"mesh of body {body.name!r}"
            scale = mesh.factors
            warnings += _mesh_warnings(document, files, key, label, scale, location)
        elif (side := float(sides(body.shape).max())) > LARGE_M:
            warnings.append(_large(document, location, f"body {body.name!r}", side))
    warnings += _part_warnings(document, cell, files)
    warnings += _bin_warnings(document, cell, files)
    warnings += _levels_in_heap(document, cell)
    if files.robot is not None:
        warnings += _links_unchecked(document, cell, files.robot)
        for name, scale in mesh_scales(files.robot.collisions).items():
            label = f"URDF mesh {name.rsplit('/', 1)[-1]!r}"
            location = ("robot", "urdf")
            warnings += _mesh_warnings(document, files, name, label, scale, location)
    return tuple(warnings)


def _bin_warnings(document: Document, cell: Cell, files: CellFiles) -> list[str]:
    warnings = []
    places = bin_places(document.data)
    for (name, place), (_, spec) in zip(places, cell.every_bin(), strict=True):
        which = "the bin" if name == "bin" else f"bin {place[-1]!r}"
        if (side := max(spec.inner)) > LARGE_M:
            warnings.append(_large(document, (*place, "inner"), which, side))
        if spec.mesh is None:
            continue
        key = body_key(name, spec.mesh.file)
        label, scale, where = f"mesh of {which}", spec.mesh.factors, (*place, "mesh")
        found = _mesh_warnings(document, files, key, label, scale, where)
        if not found and key in files.mesh_paths:
            found = _shell_warnings(document, spec, files.mesh_paths[key], place)
        warnings += found
    return warnings


def _levels_in_heap(document: Document, cell: Cell) -> list[str]:
    """Name the levels of test grasps that lie within the parts in the bin."""
    spec = cell.bin_scan
    below = [f"{1e3 * z:.3g}" for z in spec.layers if z <= cell.bin.heap]
    if not below or not cell.bin.heap:
        return []
    keys = ("fill", "fill_heights_m")
    key = next((key for key in keys if getattr(spec, key) is not None), "layers")
    return [
        f"{document.place(('bin_scan', key))}: grasps {', '.join(below)} mm above the "
        f"bottom lie within the parts of the bin's heap, {1e3 * cell.bin.heap:.3g} mm "
        "high, which are in the way of the tool"
    ]


def _shell_warnings(
    document: Document, spec: BinSpec, path: Path, place: Location
) -> list[str]:
    """Doubts about the mesh of a bin; what puts it into its support is a mistake."""
    factors = spec.mesh.factors if spec.mesh is not None else 1.0
    mesh = read_mesh(path.read_bytes(), path.suffix, factors)
    label = f"mesh {path.name}"
    if (side := float(sides(mesh).max())) > MAX_LENGTH_M or side < NO_SIZE_M:
        return []
    misplaced = place_doubt(spec, mesh)
    doubt = misplaced or size_doubt(spec, mesh)
    if not doubt:
        return []
    if spec.on is not None and not misplaced:
        document.add((*place, "on"), f"{label}: {doubt}")
        return []
    return [f"{document.place((*place, 'mesh'))}: {label}: {doubt}"]


def _part_warnings(document: Document, cell: Cell, files: CellFiles) -> list[str]:
    held = cell.held()
    if held is None:
        given = [n for n in ("lift", "drop_off", "cycle") if at(document.data, n)]
        return [
            f"{document.place((name,))}: {name} has no effect without part"
            for name in given
        ]
    key, part = held
    location: Location = ("part",) if key == "part" else ("parts", key[5:])
    mesh, label = part.shape.mesh, "mesh of the part"
    if mesh is not None:
        file_key = body_key(key, mesh.file)
        return _mesh_warnings(document, files, file_key, label, mesh.factors, location)
    side = float(sides(part.shape).max())
    return [_large(document, location, "the part", side)] if side > LARGE_M else []


def _links_unchecked(
    document: Document, cell: Cell, robot: UrdfDescription
) -> list[str]:
    """Name links that can be seen and have no collision shape, or an arm of none."""
    unseen = robot.links_without_collision
    shown = ", ".join(unseen[:12]) + (", …" if len(unseen) > 12 else "")
    location = ("robot", "urdf")
    still = {*WORLD, *robot.fixed_to(robot.root)}
    carried = {*(c.link for c in robot.collisions), *(b.attach_to for b in cell.bodies)}
    if carried <= still:
        visual = f" ({shown}: <visual> only)" if unseen else ""
        return [
            f"{document.place(location)}: NOTHING OF THE ARM IS CHECKED for collision: "
            f"no link that moves has a <collision> element{visual}; "
            "add such elements, or bodies attached to the links"
        ]
    if not unseen:
        return []
    return [
        f"{document.place(location)}: no <collision> element, so never checked: {shown}"
    ]


def _mesh_warnings(
    document: Document,
    files: CellFiles,
    key: str,
    label: str,
    scale: tuple[float, float, float],
    location: Location,
) -> list[str]:
    if key not in files.mesh_sizes:
        return []
    sides = files.mesh_sizes[key] * scale
    side = float(max(sides))
    if side < NO_SIZE_M:
        document.add(location, f"{label} has no size ({side:.3g} m); check its scale")
        return []
    if not side <= MAX_LENGTH_M:
        document.add(
            location,
            f"{label} is {side:,.4g} m large; is it in millimetres? (scale: 0.001)",
        )
        return []
    if side > LARGE_M:
        return [_large(document, location, label, side)]
    if side < TINY_M:
        place = document.place(location)
        return [f"{place}: {label} is only {side:.3g} m large; is its scale right?"]
    return []


def _large(document: Document, location: Location, label: str, side: float) -> str:
    place = document.place(location)
    return f"{place}: {label} is {side:.4g} m large; lengths are in metres"
