"""Reading the files a cell refers to: URDF or xacro, SRDF, limits, meshes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from reachmap._typing import FloatArray
from reachmap.cell.bins.shorthand import bin_places
from reachmap.cell.files.collisions import mesh_scales
from reachmap.cell.files.joint_limits import MoveItLimits, parse_joint_limits
from reachmap.cell.files.resources import NotFoundError, Resolver
from reachmap.cell.files.robot_text import robot_text
from reachmap.cell.files.srdf import SrdfDescription, parse_srdf
from reachmap.cell.files.urdf import UrdfDescription, parse_urdf
from reachmap.cell.files.xacro import Expansion
from reachmap.cell.meshes.reading import MeshError, read_mesh
from reachmap.cell.model.shapes import sides
from reachmap.cell.pick_cycle import part_places
from reachmap.cell.text.data import at, entries, text_at
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_reader import (
    MAX_TEXT_BYTES,
    Document,
    Location,
    read_bytes,
    read_text,
)
from reachmap.disk import is_folder
from reachmap.errors import CellError

# A choice against hostile input: the largest mesh of example-robot-data has 29 MB.
MAX_MESH_BYTES = 100_000_000


@dataclass(slots=True, kw_only=True)
class CellFiles:
    """Texts and files found; None or empty where a mistake was recorded."""

    resolver: Resolver
    urdf: str = ""
    urdf_folder: Path | None = None
    urdf_root: Path | None = None
    robot: UrdfDescription | None = None
    srdf: str = ""
    srdf_description: SrdfDescription | None = None
    joint_limits: dict[str, MoveItLimits] = field(default_factory=dict)
    mesh_paths: dict[str, Path] = field(default_factory=dict)
    files_sha256: dict[str, str] = field(default_factory=dict)
    mesh_sizes: dict[str, FloatArray] = field(default_factory=dict)
    expansions: list[Expansion] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add_mesh(self, key: str, path: Path) -> None:
        """Record a mesh by its key, with its size and the sha256 of its bytes."""
        data = read_bytes(path, limit=MAX_MESH_BYTES)
        self.mesh_paths[key] = path
        self.files_sha256[key] = hashlib.sha256(data).hexdigest()
        try:
            self.mesh_sizes[key] = sides(read_mesh(data, path.suffix))
        except MeshError as error:
            raise CellError(f"mesh {path}: {error}") from None


def read_files(document: Document, directory: Path) -> CellFiles:
    """Find and read everything the data of a cell refers to.

    Every failure becomes a mistake at the place of the reference.
    """
    packages = at(document.data, "resources", "packages")
    named = packages if isinstance(packages, dict) else {}
    folders = {k: v for k, v in named.items() if isinstance(v, str)}
    for name, folder in folders.items():
        if not is_folder(directory / folder):
            document.add(
                ("resources", "packages", name), f"no such folder: {directory / folder}"
            )
    files = CellFiles(resolver=Resolver(directory=directory, packages=folders))
    _read_urdf(document, files)
    _read_srdf(document, files)
    _check_xacro_args(document, files)
    _read_joint_limits(document, files)
    _find_urdf_meshes(document, files)
    _find_body_meshes(document, files)
    return files


def stored_files(document: Document, *, urdf: str, srdf: str) -> CellFiles:
    """Files of a cell from an artefact: texts as stored, meshes from this machine."""
    packages = at(document.data, "resources", "packages") or {}
    files = CellFiles(resolver=Resolver(directory=Path.cwd(), packages=packages))
    files.urdf, files.srdf = urdf, srdf
    try:
        files.robot = parse_urdf(urdf, "stored URDF")
        if srdf:
            files.srdf_description = parse_srdf(srdf, "stored SRDF", files.robot)
    except CellError as error:
        _add(document, ("robot", "urdf"), error)
        return files
    try:
        reference = text_at(document.data, "robot", "urdf") or ""
        path, root = files.resolver.resolve_robot(reference)
        files.urdf_folder, files.urdf_root = path.parent, root
        files.resolver = replace(files.resolver, urdf_folder=path.parent)
    except NotFoundError:
        # The text is at hand; only meshes relative to it would be missing.
        files.urdf_folder = files.urdf_root = Path.cwd()
    _find_urdf_meshes(document, files)
    _find_body_meshes(document, files)
    return files


def compare_hashes(
    document: Document, files: CellFiles, expected: Mapping[str, str]
) -> None:
    """Add a mistake for each mesh whose bytes are not the expected ones."""
    for key, digest in expected.items():
        found = files.files_sha256.get(key)
        if found is not None and found != digest:
            path = files.mesh_paths[key]
            document.add(
                (),
                f"mesh {key!r} has changed since: {path} has sha256 {found[:12]}…, "
                f"expected {digest[:12]}…",
            )


def body_key(name: str, reference: str) -> str:
    """Key of a body's mesh in ``files_sha256``: the same on every machine."""
    return f"body {name}: {reference.rsplit('/', 1)[-1]}"


def _add(document: Document, location: Location, error: Exception) -> None:
    lines = error.lines if isinstance(error, CellError) else (str(error),)
    for line in lines:
        document.add(location, line)


def _read_urdf(document: Document, files: CellFiles) -> None:
    location = ("robot", "urdf")
    reference = text_at(document.data, *location)
    if not reference:
        return
    try:
        path, root = files.resolver.resolve_robot(reference)
        files.resolver = replace(files.resolver, urdf_folder=path.parent)
        files.urdf = _text(path, document, files)
        files.urdf_folder, files.urdf_root = path.parent, root
        files.robot = parse_urdf(files.urdf, path.name)
        files.notes += files.robot.notes
    except (NotFoundError, CellError) as error:
        _add(document, location, error)


def _text(path: Path, document: Document, files: CellFiles) -> str:
    expansion = robot_text(path, _xacro_args(document), files.resolver)
    files.expansions.append(expansion)
    return expansion.text


def _check_xacro_args(document: Document, files: CellFiles) -> None:
    """Add a mistake for every argument that no file declares or uses."""
    if files.robot is None:
        return
    known = [name for e in files.expansions for name in e.arguments]
    for name in _xacro_args(document):
        if name not in known:
            hint = did_you_mean(name, known) or "the URDF takes none"
            location = ("robot", "xacro_args", name)
            document.add(location, f"no such argument; {hint}", of_key=True)


def _xacro_args(document: Document) -> Mapping[str, str]:
    given = at(document.data, "robot", "xacro_args")
    if not isinstance(given, dict):
        return {}
    return {
        key: str(value).lower() if isinstance(value, bool) else str(value)
        for key, value in given.items()
    }


def _read_srdf(document: Document, files: CellFiles) -> None:
    location = ("robot", "srdf")
    reference = text_at(document.data, *location)
    if reference is None or files.robot is None:
        return
    try:
        path = files.resolver.resolve(reference)
        files.srdf = _text(path, document, files)
        files.srdf_description = parse_srdf(files.srdf, path.name, files.robot)
        files.notes += files.srdf_description.notes
    except (NotFoundError, CellError) as error:
        _add(document, location, error)


def _read_joint_limits(document: Document, files: CellFiles) -> None:
    location = ("robot", "joint_limits")
    reference = text_at(document.data, *location)
    if reference is None:
        return
    try:
        path = files.resolver.resolve(reference)
        text = read_text(path, limit=MAX_TEXT_BYTES)
        limits = parse_joint_limits(text, path.name, files.robot)
        files.joint_limits = limits.joints
        files.notes += limits.notes
    except (NotFoundError, CellError) as error:
        _add(document, location, error)


def _find_urdf_meshes(document: Document, files: CellFiles) -> None:
    if files.robot is None or files.urdf_folder is None or files.urdf_root is None:
        return
    for reference in mesh_scales(files.robot.collisions):
        try:
            path = files.resolver.resolve_from_urdf(
                reference, files.urdf_folder, files.urdf_root
            )
            files.add_mesh(reference, path)
        except (NotFoundError, CellError) as error:
            _add(document, ("robot", "urdf"), error)


def _find_body_meshes(document: Document, files: CellFiles) -> None:
    owners: list[tuple[str, Location]] = [
        (text_at(body, "name") or str(index), ("bodies", index, "shape", "mesh"))
        for index, body in enumerate(entries(document.data, "bodies"))
    ]
    owners += [
        (name, (*place, "shape", "mesh")) for name, place in part_places(document.data)
    ]
    owners += [(name, (*place, "mesh")) for name, place in bin_places(document.data)]
    for name, location in owners:
        reference = text_at(document.data, *location, "file")
        if not reference:
            continue
        try:
            path = files.resolver.resolve(reference)
            files.add_mesh(body_key(name, reference), path)
        except (NotFoundError, CellError) as error:
            _add(document, (*location, "file"), error)
