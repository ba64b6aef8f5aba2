"""Triangles of COLLADA files in metres, as RViz shows them.

The file's unit counts and node transforms are followed; the up axis is not: RViz
leaves it alone, and the URDF's ``<origin>`` is written for what RViz shows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.meshes.polygons import MeshError, fan_triangles
from reachmap.geometry import rotation_from_quaternion_wxyz, transform_points

Element = ElementTree.Element
# A few nodes that name each other can ask for any number of copies.
MAX_INSTANCES = 10_000
# A choice against hostile input, which bounds the memory as MAX_MESH_BYTES does not.
MAX_TRIANGLES = 5_000_000


def collada_triangles(data: bytes) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 3) [m] and triangles (m, 3), not checked against each other.

    Raises
    ------
    MeshError, ValueError
        The file is not COLLADA, or names parts that it does not have.
    """
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise MeshError("document type declarations are not accepted")
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise MeshError(f"not valid XML: {error}") from None
    unit = root.find("{*}asset/{*}unit")
    metres = _unit_m("1" if unit is None else unit.get("meter", "1"))
    document = _Document(root)
    vertices, triangles, count, total = [], [], 0, 0
    for T, geometry in document.instances():
        for points, corners in document.meshes(geometry):
            vertices.append(transform_points(T, points))
            triangles.append(corners + count)
            count += len(points)
            total += len(corners)
            if total > MAX_TRIANGLES:
                raise MeshError(f"more than {MAX_TRIANGLES:,} triangles")
    if not triangles:
        return np.empty((0, 3)), np.empty((0, 3), np.int64)
    return metres * np.concatenate(vertices), np.concatenate(triangles)


def _unit_m(text: str) -> float:
    try:
        metres = float(text)
    except ValueError:
        metres = math.nan
    if not (math.isfinite(metres) and metres > 0):
        raise MeshError(f"<unit meter>: expected a number > 0 (got {text[:40]!r})")
    return metres


class _Document:
    def __init__(self, root: Element) -> None:
        self._root = root
        self._by_id = {e.get("id"): e for e in root.iter() if e.get("id")}
        self._meshes: dict[Element, list[tuple[FloatArray, IntArray]]] = {}
        self._visits = 0

    def _named(self, reference: str | None) -> Element:
        found = self._by_id.get((reference or "").removeprefix("#"))
        if found is None:
            raise MeshError(f"names {reference!r}, which is not in the file")
        return found

    def instances(self) -> Iterator[tuple[FloatArray, Element]]:
        """Each geometry with its pose; without a scene, each once where it is."""
        scene = self._root.find("{*}scene/{*}instance_visual_scene")
        if scene is None:
            for geometry in self._root.iterfind("{*}library_geometries/{*}geometry"):
                yield np.eye(4), geometry
            return
        for node in self._named(scene.get("url")).iterfind("{*}node"):
            yield from self._below(node, np.eye(4), 0)

    def _below(
        self, node: Element, T_parent: FloatArray, depth: int
    ) -> Iterator[tuple[FloatArray, Element]]:
        self._visits += 1
        if depth > 100 or self._visits > MAX_INSTANCES:
            raise MeshError("too many nodes, or nodes that contain themselves")
        T = T_parent
        for child in node:
            T = T @ _transform(child)
        for child in node:
            tag = _tag(child)
            if tag == "node":
                yield from self._below(child, T, depth + 1)
            elif tag == "instance_node":
                yield from self._below(self._named(child.get("url")), T, depth + 1)
            elif tag == "instance_geometry":
                yield T, self._named(child.get("url"))
            elif tag == "instance_controller":
                skin = self._named(child.get("url")).find("{*}skin")
                if skin is None:
                    raise MeshError("controllers other than <skin> are not read")
                yield T, self._named(skin.get("source"))

    def meshes(self, geometry: Element) -> list[tuple[FloatArray, IntArray]]:
        """Vertices and triangles of each primitive of a geometry."""
        if geometry not in self._meshes:
            self._meshes[geometry] = [
                self._primitive(element)
                for element in geometry.iterfind("{*}mesh/*")
                if _tag(element) in _POLYGONS
            ]
        return self._meshes[geometry]

    def _primitive(self, element: Element) -> tuple[FloatArray, IntArray]:
        inputs = element.findall("{*}input")
        stride = max((int(i.get("offset", "0")) for i in inputs), default=0) + 1
        place = next((i for i in inputs if i.get("semantic") == "VERTEX"), None)
        if place is None or stride < 1:
            raise MeshError(f"<{_tag(element)}> has no vertices")
        points = self._positions(self._named(place.get("source")))
        offset = int(place.get("offset", "0"))
        lists = [
            np.array((p.text or "").split(), np.int64)[offset::stride]
            for p in element.iter()
            if _tag(p) == "p"
        ]
        counts = element.find("{*}vcount")
        sizes = [] if counts is None else [int(n) for n in (counts.text or "").split()]
        return points, fan_triangles(_POLYGONS[_tag(element)](lists, sizes))

    def _positions(self, vertices: Element) -> FloatArray:
        place = vertices.find("{*}input[@semantic='POSITION']")
        if place is None:
            raise MeshError("<vertices> without positions")
        source = self._named(place.get("source"))
        array = source.find("{*}float_array")
        accessor = source.find("{*}technique_common/{*}accessor")
        stride, offset = 3, 0
        if accessor is not None:
            stride = int(accessor.get("stride", "3"))
            offset = int(accessor.get("offset", "0"))
            # Positions may be kept in the array of another source.
            array = self._by_id.get(accessor.get("source", "").removeprefix("#"), array)
        values = np.array(
            (array.text or "").split() if array is not None else [], float
        )
        if stride < 3 or offset < 0:
            raise MeshError("positions need three numbers each")
        values = values[offset:]
        rows = values[: len(values) // stride * stride].reshape(-1, stride)
        return np.asarray(rows[:, :3])


Lists = list[IntArray]


def _by_three(lists: Lists, sizes: list[int]) -> list[list[int]]:
    del sizes
    if any(len(p) % 3 for p in lists):
        raise MeshError("<triangles> is truncated")
    return [list(p[k : k + 3]) for p in lists for k in range(0, len(p), 3)]


def _by_count(lists: Lists, sizes: list[int]) -> list[list[int]]:
    corners = np.concatenate(lists) if lists else np.empty(0, np.int64)
    if min(sizes, default=0) < 0 or sum(sizes) != len(corners):
        raise MeshError("<polylist>: <vcount> and <p> do not fit")
    ends = np.cumsum(sizes, dtype=np.int64)
    return [list(corners[e - n : e]) for n, e in zip(sizes, ends, strict=True)]


def _one_each(lists: Lists, sizes: list[int]) -> list[list[int]]:
    del sizes
    return [list(p) for p in lists]


def _strips(lists: Lists, sizes: list[int]) -> list[list[int]]:
    del sizes
    # Every second triangle of a strip runs the other way round.
    return [
        list(p[k : k + 3])[:: -1 if k % 2 else 1]
        for p in lists
        for k in range(len(p) - 2)
    ]


_POLYGONS = {
    "triangles": _by_three,
    "polylist": _by_count,
    "polygons": _one_each,
    "trifans": _one_each,
    "tristrips": _strips,
}


def _tag(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _transform(element: Element) -> FloatArray:
    """Matrix (4, 4) of a transform element; the identity for any other."""
    T = np.eye(4)
    tag = _tag(element)
    if tag in ("skew", "lookat"):
        raise MeshError(f"<{tag}> transforms are not read")
    count = {"matrix": 16, "translate": 3, "scale": 3, "rotate": 4}.get(tag)
    if count is None:
        return T
    values = np.array((element.text or "").split(), float)
    if len(values) != count or not np.isfinite(values).all():
        raise MeshError(f"<{tag}>: expected {count} finite numbers")
    if tag == "matrix":
        return values.reshape(4, 4)
    if tag == "translate":
        T[:3, 3] = values
    elif tag == "scale":
        T[:3, :3] = np.diag(values)
    elif values[:3].any():
        half = math.radians(values[3]) / 2
        axis = values[:3] / np.linalg.norm(values[:3])
        quaternion = np.array([math.cos(half), *(math.sin(half) * axis)])
        T[:3, :3] = rotation_from_quaternion_wxyz(quaternion)
    return T
