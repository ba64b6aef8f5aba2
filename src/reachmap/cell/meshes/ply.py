"""Triangles of PLY files, text or binary; anything else they hold is ignored."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.meshes.polygons import MeshError, fan_triangles

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
# A choice against hostile input: a header may claim any number of rows.
MAX_ROWS = 20_000_000
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Element:
    """One element of the header: name, rows, and (name, count type, type) of each."""

    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)


def ply_triangles(data: bytes) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 3) and triangles (m, 3), not checked against each other.

    Raises
    ------
    MeshError, ValueError
        The file is not a PLY file, or truncated.
    """
    head, marker, body = data.partition(b"end_header")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    lines = [words for words in lines if words]
    if not marker or not lines or lines[0] != ["ply"]:
        raise MeshError("not a PLY file")
    kind = next((w[1] for w in lines if w[0] == "format" and len(w) > 1), "")
    if kind not in _ORDERS:
        raise MeshError(f"unknown PLY format {kind[:40]!r}")
    body = body[body.index(b"\n") + 1 :]
    rows = _Text(body) if kind == "ascii" else _Binary(body, _ORDERS[kind])
    vertices, polygons = np.empty((0, 3)), np.empty((0, 3), np.int64)
    for element in _elements(lines):
        names = [name for name, _, _ in element.properties]
        lists = any(count for _, count, _ in element.properties)
        if not lists:
            table = rows.table(element)
            if element.name == "vertex":
                columns = [table[:, names.index(axis)] for axis in "xyz"]
                vertices = np.stack(columns, axis=1)
            continue
        wanted = {"vertex_indices", "vertex_index"} & set(names)
        found = rows.lists(element, names.index(wanted.pop()) if wanted else -1)
        if element.name == "face":
            polygons = fan_triangles(found)
    return vertices, polygons


def _elements(lines: list[list[str]]) -> list[_Element]:
    elements: list[_Element] = []
    for words in lines:
        if words[0] == "element" and len(words) == 3:
            elements.append(_Element(name=words[1], count=int(words[2])))
        elif words[0] == "property" and elements:
            is_list = len(words) == 5 and words[1] == "list"
            types = words[2:4] if is_list else words[1:2]
            if len(words) != (5 if is_list else 3) or set(types) - set(_TYPES):
                raise MeshError(f"unknown property of a PLY {elements[-1].name}")
            count_type = _TYPES[types[0]] if is_list else ""
            elements[-1].properties.append((words[-1], count_type, _TYPES[types[-1]]))
    if not all(0 <= element.count <= MAX_ROWS for element in elements):
        raise MeshError(f"a count of the PLY header is not from 0 to {MAX_ROWS:,}")
    return elements


class _Binary:
    """The body of a binary file, read from the front."""

    def __init__(self, body: bytes, order: str) -> None:
        self._body, self._order, self._at = body, order, 0

    def table(self, element: _Element) -> FloatArray:
        """Rows without lists, (count, properties)."""
        kinds = [(str(k), self._order + t) for k, (_, _, t) in _each(element)]
        raw = self._take(np.dtype(kinds), element.count)
        columns = [np.asarray(raw[name], float) for name, _ in kinds]
        return np.stack(columns, axis=1) if columns else np.empty((element.count, 0))

    def lists(self, element: _Element, wanted: int) -> list[list[int]]:
        """The wanted list of each row."""
        alike = self._lists_alike(element)
        if alike is not None:
            return alike if wanted == 0 else []
        found: list[list[int]] = []
        for _ in range(element.count):
            for k, (_, count_type, kind) in _each(element):
                count = 1
                if count_type:
                    size = self._take(np.dtype(self._order + count_type), 1)
                    count = int(size[0])
                values = self._take(np.dtype(self._order + kind), count)
                if k == wanted:
                    found.append(values.tolist())
        return found

    def _lists_alike(self, element: _Element) -> list[list[int]] | None:
        """All rows at once where each is one list of the same length, as is usual."""
        if len(element.properties) > 1 or not element.count:
            return None
        (_, count_type, kind), start = element.properties[0], self._at
        length = int(self._take(np.dtype(self._order + count_type), 1)[0])
        self._at = start
        row = np.dtype(
            [("n", self._order + count_type), ("v", self._order + kind, (length,))]
        )
        if length < 1 or start + element.count * row.itemsize > len(self._body):
            return None
        rows = np.frombuffer(self._body, row, count=element.count, offset=start)
        if not (rows["n"] == length).all():
            return None
        self._at += element.count * row.itemsize
        values: list[list[int]] = rows["v"].tolist()
        return values

    def _take(self, dtype: np.dtype[Any], count: int) -> npt.NDArray[Any]:
        end = self._at + dtype.itemsize * count
        if count < 0 or end > len(self._body):
            raise MeshError("the PLY file is truncated")
        values = np.frombuffer(self._body, dtype, count=count, offset=self._at)
        self._at = end
        return values


class _Text:
    """The body of a text file, word by word."""

    def __init__(self, body: bytes) -> None:
        self._words = body.split()
        self._at = 0

    def table(self, element: _Element) -> FloatArray:
        """Rows without lists, (count, properties)."""
        width = len(element.properties)
        values = [float(word) for word in self._take(element.count * width)]
        return np.array(values).reshape(element.count, width)

    def lists(self, element: _Element, wanted: int) -> list[list[int]]:
        """The wanted list of each row."""
        found: list[list[int]] = []
        for _ in range(element.count):
            for k, (_, count_type, _) in _each(element):
                count = int(self._take(1)[0]) if count_type else 1
                words = self._take(count)
                if k == wanted:
                    found.append([int(word) for word in words])
        return found

    def _take(self, count: int) -> list[bytes]:
        words = self._words[self._at : self._at + count]
        if count < 0 or len(words) < count:
            raise MeshError("the PLY file is truncated")
        self._at += count
        return words


def _each(element: _Element) -> Iterator[tuple[int, tuple[str, str, str]]]:
    return iter(enumerate(element.properties))
