"""Bounding boxes of mesh files, to tell millimetres from metres before planning.

Reads no more than the vertices of STL, OBJ, PLY and COLLADA files, and finds
truncated or empty files before a mesh library has to.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np

from reachmap._typing import FloatArray

SUFFIXES = (".stl", ".obj", ".dae", ".ply")
_STL_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")
_OBJ_VERTEX = re.compile(rb"^v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)
_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip


class MeshError(ValueError):
    """A mesh file is damaged or of an unknown format."""


def mesh_size(data: bytes, suffix: str) -> FloatArray:
    """Sides of the bounding box in the file's own unit.

    Parameters
    ----------
    data : bytes
        The whole file.
    suffix : str
        ``.stl``, ``.obj``, ``.dae`` or ``.ply``; case does not matter.

    Returns
    -------
    array, shape (3,)

    Raises
    ------
    MeshError
        The file has no vertices, is cut short or holds numbers that are not finite.
    """
    readers: dict[str, Callable[[bytes], FloatArray]] = {
        ".stl": _stl_vertices,
        ".obj": _obj_vertices,
        ".dae": _dae_vertices,
        ".ply": _ply_vertices,
    }
    reader = readers.get(suffix.lower())
    if reader is None:
        raise MeshError(
            f"unknown mesh format {suffix!r} (expected {', '.join(SUFFIXES)})"
        )
    try:
        vertices = reader(data)
    except (ValueError, IndexError, OverflowError) as error:
        raise MeshError(str(error) or "damaged mesh file") from None
    if not len(vertices):
        raise MeshError("the mesh has no vertices")
    if not np.isfinite(vertices).all():
        raise MeshError("the mesh has vertices that are not finite")
    return np.asarray(vertices.max(axis=0) - vertices.min(axis=0), float)


def _stl_vertices(data: bytes) -> FloatArray:
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if data[:5].lower() == b"solid" and len(data) != 84 + 50 * count:
        return _triples(_STL_VERTEX.findall(data))
    if len(data) < 84 + 50 * max(count, 0) or count < 0:
        raise MeshError("the STL file is cut short")
    facet = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    facets = np.frombuffer(data, facet, count=count, offset=84)
    return np.asarray(facets["v"].reshape(-1, 3), float)


def _obj_vertices(data: bytes) -> FloatArray:
    return _triples(_OBJ_VERTEX.findall(data))


def _triples(found: list[tuple[bytes, ...]]) -> FloatArray:
    return np.array([[float(word) for word in row] for row in found]).reshape(-1, 3)


def _dae_vertices(data: bytes) -> FloatArray:
    """Positions of a COLLADA file in metres; node transforms are not followed."""
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise MeshError("document type declarations are not accepted")
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise MeshError(f"not valid XML: {error}") from None
    unit = root.find(".//{*}asset/{*}unit")
    metres = float(unit.get("meter", "1")) if unit is not None else 1.0
    wanted = {
        str(item.get("source", "")).removeprefix("#")
        for item in root.iterfind(".//{*}vertices/{*}input[@semantic='POSITION']")
    }
    values = [
        np.array((array.text or "").split(), float)
        for source in root.iter()
        if source.tag.endswith("}source") and source.get("id") in wanted
        for array in source.iterfind("{*}float_array")
    ]
    if not values:
        return np.empty((0, 3))
    flat = np.concatenate(values)
    return np.asarray(flat[: len(flat) // 3 * 3].reshape(-1, 3) * metres)


def _ply_vertices(data: bytes) -> FloatArray:
    head, marker, body = data.partition(b"end_header")
    lines = head.decode("ascii", "replace").split("\n")
    words = [line.split() for line in lines if line.strip()]
    if not marker or not words or words[0] != ["ply"]:
        raise MeshError("not a PLY file")
    body = body[body.index(b"\n") + 1 :]
    kind = next((w[1] for w in words if w[0] == "format" and len(w) > 1), "")
    elements = [i for i, w in enumerate(words) if w[0] == "element"]
    if not elements or words[elements[0]][1] != "vertex":
        raise MeshError("the PLY file does not start with its vertices")
    count = int(words[elements[0]][2])
    end = elements[1] if len(elements) > 1 else len(words)
    properties = [w for w in words[elements[0] : end] if w[0] == "property"]
    if any(len(w) != 3 or w[1] not in _PLY_TYPES for w in properties):
        raise MeshError("unknown property of a PLY vertex")
    names = [w[2] for w in properties]
    if kind == "ascii":
        rows = body.split(b"\n")[:count]
        table = np.array([[float(x) for x in row.split()] for row in rows])
        columns = [table[:, names.index(axis)] for axis in "xyz"]
        return np.stack(columns, axis=1)
    order = "<" if kind == "binary_little_endian" else ">"
    dtype = np.dtype([(w[2], order + _PLY_TYPES[w[1]]) for w in properties])
    if len(body) < count * dtype.itemsize or count < 0:
        raise MeshError("the PLY file is cut short")
    vertices = np.frombuffer(body, dtype, count=count)
    return np.stack([np.asarray(vertices[axis], float) for axis in "xyz"], axis=1)
