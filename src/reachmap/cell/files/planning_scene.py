"""Bodies of MoveIt planning scenes: ``.scene`` texts, and messages as YAML."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.text.data import at, entries, text_at
from reachmap.cell.text.yaml_reader import MAX_TEXT_BYTES, parse_yaml, read_text
from reachmap.errors import CellError
from reachmap.geometry import rotation_from_quaternion_wxyz, transform_from_parts

# shape_msgs/SolidPrimitive: 1 box, 2 sphere, 3 cylinder.
PRIMITIVES = {1: "box", 2: "sphere", 3: "cylinder"}
SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2, "plane": 4}


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneBody:
    """One shape of a planning scene.

    Attributes
    ----------
    name : str
    frame : str
        Link that the pose is in; "" for the root of the robot.
    shape : dict
        As in a cell's body: ``{"box": [x, y, z]}``.
    T_frame_body : array, shape (4, 4)
    """

    name: str
    frame: str
    shape: dict[str, Any]
    T_frame_body: FloatArray


def read_scene(path: Path) -> tuple[list[SceneBody], list[str]]:
    """Read the bodies of a file, and report those that cannot be used.

    A YAML file that is not a planning scene has no bodies.

    Raises
    ------
    CellError
        A ``.scene`` file is truncated or holds something other than numbers.
    """
    try:
        text = read_text(path, limit=MAX_TEXT_BYTES)
        if path.suffix != ".scene":
            return _of_message(parse_yaml(text, path.name).data, path.name)
    except CellError:
        if path.suffix != ".scene":
            return [], []  # a file of some other kind
        raise
    try:
        return _of_text(text.split("\n"), path.name)
    except (StopIteration, ValueError, IndexError, RuntimeError):
        raise CellError(f"{path}: not a MoveIt scene, or truncated") from None


def _of_text(lines: list[str], label: str) -> tuple[list[SceneBody], list[str]]:
    """Read objects as MoveIt writes them: ``* name``, pose, shapes with their poses."""
    bodies: list[SceneBody] = []
    notes: list[str] = []
    rows = iter(line.strip() for line in lines[1:])
    for line in rows:
        if line == ".":
            break
        if not line.startswith("*"):
            continue
        name, T = line[1:].strip(), np.eye(4)
        first = next(rows)
        if len(first.split()) == 3:  # since MoveIt 1.1 an object has a pose
            T = _pose(first, next(rows))
            first = next(rows)
        for k in range(int(first)):
            shape, kind = _shape(rows)
            T_body = T @ _pose(next(rows), next(rows))
            next(rows)  # colour
            whole = name if int(first) == 1 else f"{name}_{k + 1}"
            if shape is None:
                notes.append(_left_out(label, whole, kind))
            else:
                bodies.append(
                    SceneBody(name=whole, frame="", shape=shape, T_frame_body=T_body)
                )
    return bodies, notes


def _shape(rows: Iterator[str]) -> tuple[dict[str, Any] | None, str]:
    kind = next(rows)
    if kind == "mesh":
        vertices, triangles = (int(word) for word in next(rows).split())
        for _ in range(vertices + triangles):
            next(rows)
        return None, kind
    return _primitive(kind, [float(word) for word in next(rows).split()]), kind


def _primitive(kind: str, sizes: list[float]) -> dict[str, Any] | None:
    """Shape of a cell's body; None for kinds that cells do not support.

    ValueError if a kind has other numbers than it should.
    """
    if len(sizes) < SIZES.get(kind, 0) or not all(np.isfinite(sizes)):
        raise ValueError(kind)
    if kind == "box":
        return {"box": sizes[:3]}
    if kind == "sphere":
        return {"sphere": {"radius": sizes[0]}}
    if kind == "cylinder":
        return {"cylinder": {"radius": sizes[0], "length": sizes[1]}}
    return None


def _pose(position: str, quaternion_xyzw: str) -> FloatArray:
    p = np.array([float(word) for word in position.split()])
    q = np.array([float(word) for word in quaternion_xyzw.split()])
    return transform_from_parts(rotation_from_quaternion_wxyz(q[[3, 0, 1, 2]]), p)


def _of_message(data: Any, label: str) -> tuple[list[SceneBody], list[str]]:
    """Read collision objects of a PlanningScene or PlanningSceneWorld message."""
    bodies: list[SceneBody] = []
    notes: list[str] = []
    if not isinstance(data, dict):
        return [], []
    objects = [*entries(data, "world", "collision_objects")]
    objects += entries(data, "collision_objects")
    for item in objects:
        name = text_at(item, "id") or "object"
        frame = text_at(item, "header", "frame_id") or ""
        T = _message_pose(at(item, "pose"))
        shapes = list(entries(item, "primitives"))
        poses = list(entries(item, "primitive_poses"))
        for k, shape in enumerate(shapes):
            whole = name if len(shapes) == 1 else f"{name}_{k + 1}"
            kind = _kind(at(shape, "type"))
            try:
                sizes = [float(value) for value in entries(shape, "dimensions")]
                if kind == "cylinder":  # the message has the height first
                    sizes = sizes[::-1]
                made = _primitive(kind, sizes)
            except (TypeError, ValueError):
                made = None
            if made is None:
                notes.append(_left_out(label, whole, kind))
                continue
            T_body = T @ _message_pose(poses[k] if k < len(poses) else None)
            bodies.append(
                SceneBody(name=whole, frame=frame, shape=made, T_frame_body=T_body)
            )
        notes += [_left_out(label, name, "mesh") for _ in entries(item, "meshes")]
    return bodies, notes


def _kind(given: Any) -> str:
    """Name of a primitive that is given by its number or its name."""
    if isinstance(given, int):
        return PRIMITIVES.get(given, "cone")
    return given.lower() if isinstance(given, str) else "shape without a type"


def _message_pose(pose: Any) -> FloatArray:
    def numbers(key: str, names: str, default: float) -> list[float]:
        given = at(pose, key)
        if isinstance(given, list):
            return [float(value) for value in given]
        table = given if isinstance(given, dict) else {}
        return [float(table.get(n, default if n == "w" else 0.0)) for n in names]

    p, q = numbers("position", "xyz", 0.0), numbers("orientation", "xyzw", 1.0)
    if not any(q):  # an empty message; MoveIt takes it for the identity
        q = [0.0, 0.0, 0.0, 1.0]
    R = rotation_from_quaternion_wxyz(np.array(q)[[3, 0, 1, 2]])
    return transform_from_parts(R, np.array(p))


def _left_out(label: str, name: str, kind: str) -> str:
    return f"{label}: {name!r} is a {kind} and is left out; add it as a body by hand"
