"""Bounding boxes of mesh files."""

from __future__ import annotations

import struct
from pathlib import Path

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reachmap.cell.files.resources import data_folder
from reachmap.cell.meshes.reading import MeshError, read_mesh
from reachmap.cell.model.shapes import sides

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 2], [0, 3, 0]])


def binary_stl() -> bytes:
    """One facet."""
    values = [0.0] * 3 + list(TRIANGLE.ravel())
    return b"solid but binary".ljust(80) + struct.pack("<I12fH", 1, *values, 0)


def ply(kind: str) -> bytes:
    """One triangle in a PLY file with a colour at each vertex."""
    head = f"""ply
format {kind} 1.0
comment made by hand
element vertex 3
property double x
property double y
property double z
property uchar red
element face 1
property list uchar int vertex_indices
end_header
"""
    if kind == "ascii":
        rows = "\n".join(" ".join(map(str, row)) + " 255" for row in TRIANGLE)
        return (head + rows + "\n3 0 1 2\n").encode()
    order = "<" if kind == "binary_little_endian" else ">"
    rows_b = b"".join(struct.pack(f"{order}3dB", *row, 255) for row in TRIANGLE)
    return head.encode() + rows_b + struct.pack(f"{order}B3i", 3, 0, 1, 2)


DAE = b"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
<asset><unit meter="0.001"/></asset>
<library_geometries><geometry><mesh>
<source id="p"><float_array>0 0 0 1000 0 2000 0 3000 0</float_array></source>
<source id="n"><float_array>9 9 9 9e9 9 9</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="NORMAL" source="#n" offset="1"/><p>0 0 1 1 2 0</p></triangles>
</mesh></geometry></library_geometries></COLLADA>"""
FILES = {
    "binary.stl": binary_stl(),
    "ascii.STL": b"solid x\n"
    + b"".join(b"vertex %f %f %f\n" % tuple(row) for row in TRIANGLE)
    + b"endsolid\n",
    "a.obj": b"# x\nvn 9 9 9\nv 0 0 0\nv 1 0 2 1.0\n v 8 8 8\nv 0 3 0\nf 1 2 3\n",
    "ascii.ply": ply("ascii"),
    "little.ply": ply("binary_little_endian"),
    "big.ply": ply("binary_big_endian"),
    "a.dae": DAE,
}


@pytest.mark.parametrize("name", FILES)
def test_sizes_of_all_formats(name: str) -> None:
    """The same triangle in each format has the same box."""
    size = sides(read_mesh(FILES[name], Path(name).suffix))
    assert np.allclose(size, [1.0, 3.0, 2.0])


@pytest.mark.parametrize("link", ["base", "forearm", "wrist1"])
def test_sizes_agree_with_coal(link: str) -> None:
    """Real meshes: the box is the one the collision library computes."""
    folder = data_folder()
    assert folder is not None
    meshes = folder / "example-robot-data/robots/ur_description/meshes/ur5/collision"
    path = meshes / f"{link}.stl"
    mesh = coal.MeshLoader().load(str(path), np.ones(3))
    mesh.computeLocalAABB()
    box = mesh.aabb_local.max_ - mesh.aabb_local.min_
    assert np.allclose(sides(read_mesh(path.read_bytes(), ".stl")), box, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.stl", b"", "cut short"),
        ("a.stl", b"x" + binary_stl()[1:-1], "cut short"),
        ("a.stl", binary_stl()[:-1], "cut short"),
        ("a.stl", b"solid x\nendsolid x\n", "no triangles"),
        ("a.stl", b"solid x\n" + b"vertex 1 2 nan\n" * 3, "not finite"),
        ("a.stl", b"solid x\nvertex 1 2 x\n", "could not convert"),
        ("a.obj", b"o nothing\n", "no triangles"),
        ("a.ply", b"ply\n", "not a PLY file"),
        ("a.ply", ply("binary_big_endian")[:-40], "cut short"),
        ("a.ply", ply("ascii").replace(b"vertex 3", b"vertex x"), "invalid literal"),
        ("a.ply", ply("ascii").replace(b"double x", b"list x"), "unknown property"),
        ("a.dae", b"<COLLADA>", "not valid XML"),
        ("a.dae", b"<!DOCTYPE a><COLLADA/>", "document type"),
        ("a.dae", b"<COLLADA/>", "no triangles"),
        ("a.glb", b"glTF", "glTF meshes are not read"),
    ],
)
def test_damaged_meshes_are_refused(name: str, data: bytes, message: str) -> None:
    """Each with a sentence."""
    with pytest.raises(MeshError, match=message):
        read_mesh(data, Path(name).suffix)


@settings(max_examples=150, deadline=None)
@given(
    name=st.sampled_from(sorted(FILES)),
    cut=st.integers(0, 700),
    flips=st.lists(st.tuples(st.integers(0, 2000), st.integers(0, 255)), max_size=6),
)
def test_mutated_meshes_end_in_a_size_or_a_mesh_error(
    name: str, cut: int, flips: list[tuple[int, int]]
) -> None:
    """Nothing else, whatever the bytes are."""
    data = bytearray(FILES[name])
    for position, value in flips:
        data[position % len(data)] = value
    try:
        kept = bytes(data[: len(data) - cut % len(data)])
        size = sides(read_mesh(kept, Path(name).suffix))
    except MeshError:
        return
    assert np.isfinite(size).all()
    assert (size >= 0).all()
