"""Text of a robot description: URDF or SRDF, xacro expanded; other formats refused."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from reachmap.cell.files.resources import Resolver
from reachmap.cell.files.xacro import Expansion, expand_xacro
from reachmap.cell.files.xml_text import parse_xml, read_xml
from reachmap.errors import CellError

MAX_URDF_BYTES = 20_000_000
DEFINITIONS = ("xacro:arg", "xacro:property", "xacro:macro")
# Suffixes of files that people take for robot descriptions, and what they are.
OTHER_FILES = {
    ".usd": "USD",
    ".usda": "USD",
    ".usdc": "USD",
    ".usdz": "USD",
    ".sdf": "SDF",
    ".world": "SDF",
    ".mjcf": "MJCF",
    ".mjb": "MJCF",
    ".gltf": "glTF",
    ".glb": "glTF",
    ".step": "STEP",
    ".stp": "STEP",
    ".stl": "a mesh",
    ".dae": "a mesh",
    ".obj": "a mesh",
    ".ply": "a mesh",
    ".proto": "a Webots PROTO",
    ".zip": "an archive",
}


def robot_text(
    path: Path, arguments: Mapping[str, str], resolver: Resolver
) -> Expansion:
    """Text of a URDF or SRDF file, xacro expanded.

    Raises
    ------
    CellError
        The file is of another kind, cannot be read, or does not expand.
    """
    kind = OTHER_FILES.get(path.suffix.lower())
    if kind is not None:
        raise CellError(
            f"{path}: {kind} is not read; export the robot as URDF from the tool that "
            "made it, or take the maker's URDF or xacro"
        )
    if path.suffix == ".xacro":
        return expand_xacro(path, arguments, resolver)
    text = read_xml(path, limit=MAX_URDF_BYTES)
    if "<xacro:" in text or "${" in text:
        _refuse_xacro(text, path)
    return Expansion(text=text, arguments=(), packages={}, warnings=())


def _refuse_xacro(text: str, path: Path) -> None:
    """Refuse a text that needs xacro; macro definitions alone are harmless."""
    todo = [parse_xml(text, path.name)]
    while todo:
        element = todo.pop()
        if element.tag in DEFINITIONS:
            continue
        todo += element
        found = [
            f"{value[:40]!r}" for value in element.attrib.values() if "${" in value
        ]
        if element.tag.startswith("xacro:"):
            found.insert(0, f"<{element.tag}>")
        if found:
            raise CellError(
                f"{path}: has {found[0]}, which xacro must expand; rename the file to "
                f"{path.name}.xacro"
            )
