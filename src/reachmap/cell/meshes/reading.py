"""Triangles of mesh files: STL, OBJ, PLY and COLLADA.

Counts, indices and numbers are checked here, so that no engine meets a damaged file:
what is measured against the limits of size, checked for collision and drawn is one
and the same set of triangles.
"""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.meshes.collada import collada_triangles
from reachmap.cell.meshes.ply import ply_triangles
from reachmap.cell.meshes.polygons import MeshError, fan_triangles
from reachmap.cell.model.shapes import TriangleMesh

__all__ = ["MeshError", "read_mesh"]

# Meshes that are kept, and the size of their files: 128 MiB at most. Collision meshes
# of example-robot-data are seldom larger (10 of 171).
KEPT, KEPT_BYTES = 128, 1 << 20
UNSCALED = (1.0, 1.0, 1.0)
_STL_FACET = re.compile(rb"\bfacet\s+normal\b", re.IGNORECASE)
_STL_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_OTHERS = {
    ".glb": "glTF", ".gltf": "glTF", ".step": "STEP", ".stp": "STEP",
    ".iges": "IGES", ".igs": "IGES", ".3ds": "3DS", ".fbx": "FBX", ".usd": "USD",
}  # fmt: skip


def read_mesh(data: bytes, suffix: str, scale: Any = 1.0) -> TriangleMesh:
    """Read the triangles of a mesh file.

    Parameters
    ----------
    data : bytes
        The whole file.
    suffix : str
        ``.stl``, ``.obj``, ``.dae`` or ``.ply``; case does not matter.
    scale : float or array, shape (3,)
        Factor of all vertices, or one for each axis.

    Returns
    -------
    TriangleMesh
        In the file's own unit times the scale; COLLADA states its unit, and is in
        metres. The same object for the same small file and scale.

    Raises
    ------
    MeshError
        The file has no triangles, is truncated, names vertices that it does not have,
        or holds numbers that are not finite.
    """
    factors = tuple(np.broadcast_to(np.asarray(scale, float), 3).tolist())
    read = _kept if len(data) <= KEPT_BYTES else _read
    return read(data, suffix, factors)


def _read(data: bytes, suffix: str, factors: tuple[float, ...]) -> TriangleMesh:
    if factors != UNSCALED:
        return read_mesh(data, suffix).scaled(factors)
    readers: dict[str, Callable[[bytes], tuple[FloatArray, IntArray]]] = {
        ".stl": _stl_triangles,
        ".obj": _obj_triangles,
        ".dae": collada_triangles,
        ".ply": ply_triangles,
    }
    reader = readers.get(suffix.lower())
    if reader is None:
        kind = _OTHERS.get(suffix.lower())
        known = f"{kind} meshes are not read" if kind else f"unknown format {suffix!r}"
        wanted = ", ".join(readers)
        raise MeshError(f"{known}; export it as one of {wanted}")
    if data.startswith(b"version https://git-lfs"):
        raise MeshError("a pointer of Git LFS, not the mesh: `git lfs pull` fetches it")
    try:
        # What overflows is found among the vertices that are not finite.
        with np.errstate(all="ignore"):
            vertices, triangles = reader(data)
    except MeshError:
        raise
    except (ValueError, IndexError, OverflowError, KeyError, MemoryError) as error:
        raise MeshError(f"damaged {suffix.lower()} file: {error}") from None
    return _checked(vertices, triangles)


# The links of an arm are read for its size, for each scene and for pictures.
_kept = lru_cache(maxsize=KEPT)(_read)


def _checked(vertices: FloatArray, triangles: IntArray) -> TriangleMesh:
    """Mesh of the vertices in use, each once."""
    if not len(triangles):
        raise MeshError("the mesh has no triangles")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise MeshError(
            f"a triangle names a vertex that is missing (there are {len(vertices)})"
        )
    used, triangles = np.unique(triangles, return_inverse=True)
    corners = vertices[used]
    if not np.isfinite(corners).all():
        raise MeshError("the mesh has vertices that are not finite")
    # Adding 0.0 makes one of 0.0 and -0.0.
    corners, same = np.unique(corners + 0.0, axis=0, return_inverse=True)
    if len(corners) < 3:
        raise MeshError("the mesh has no size: its vertices coincide")
    triangles = same.reshape(-1)[triangles].reshape(-1, 3)
    mesh = TriangleMesh(vertices=corners, triangles=triangles.astype(np.int64))
    for numbers in (mesh.vertices, mesh.triangles):
        numbers.flags.writeable = False  # others may hold the same mesh
    return mesh


def _stl_triangles(data: bytes) -> tuple[FloatArray, IntArray]:
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    # Some binary files begin with "solid" as text files do, and some have bytes after
    # the last facet; as text, the four bytes of the count make a number past any file.
    if 0 < 84 + 50 * count <= len(data) and count:
        facet = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
        facets = np.frombuffer(data, facet, count=count, offset=84)
        corners = np.asarray(facets["v"].reshape(-1, 3), float)
    elif data.removeprefix(BOM_UTF8).lstrip()[:5].lower() == b"solid":
        corners = _numbers(_STL_VERTEX.findall(data))
        if not len(corners) and b"endsolid" not in data.lower():
            raise MeshError("the STL file is truncated")
        if len(corners) % 3 or len(corners) < 3 * len(_STL_FACET.findall(data)):
            raise MeshError("the STL file is truncated: a facet lacks a vertex")
    elif len(data) >= 84 and not count:
        raise MeshError("the mesh has no triangles")
    else:
        raise MeshError("the STL file is truncated")
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _obj_triangles(data: bytes) -> tuple[FloatArray, IntArray]:
    vertices: list[Sequence[bytes]] = []
    polygons: list[list[int]] = []
    # Comments, and blanks before a keyword, may stand in any line.
    lines = re.sub(rb"\\\r?\n", b" ", data.removeprefix(BOM_UTF8)).splitlines()
    for keyword, *words in filter(None, (x.partition(b"#")[0].split() for x in lines)):
        if keyword == b"v":
            if len(words) < 3:
                raise MeshError("a vertex needs three numbers")
            vertices.append(words[:3])
        elif keyword == b"f":
            corners = [int(word.split(b"/")[0]) for word in words]
            if 0 in corners:
                raise MeshError("a face names vertex 0; they are counted from 1")
            # Negative numbers count backwards from the last vertex so far.
            polygons.append([k - 1 if k > 0 else len(vertices) + k for k in corners])
    return _numbers(vertices), fan_triangles(polygons)


def _numbers(rows: Sequence[Sequence[bytes]]) -> FloatArray:
    return np.array([[float(word) for word in row] for row in rows]).reshape(-1, 3)
