"""Triangles of mesh files: right ones, or a sentence."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import coal
import numpy as np
import pytest
import trimesh

from reachmap.cell.files.resources import data_folder
from reachmap.cell.meshes.reading import MeshError, read_mesh
from reachmap.cell.model.fields import MAX_LENGTH_M, Shape
from reachmap.cell.model.shapes import TriangleMesh, sides, triangles_of
from reachmap.cell.references import NO_SIZE_M
from reachmap.core.collision.shapes import coal_shape, convex_hull

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 2], [0, 3, 0]])


TEXT_STL = b"solid x\n" + 2 * (
    b"facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0\n"
)


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
    "upper.stl": b"SOLID X\n"
    + b"".join(b"VERTEX %E %E %E\n" % tuple(row) for row in TRIANGLE)
    + b"ENDSOLID X\n",
    "a.obj": b"# x\nvn 9 9 9\nv 0 0 0\nv 1 0 2 1.0\n v 0 3 0\nf 1 2 3\n",
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
        ("a.stl", b"", "truncated"),
        ("a.STL", b"version https://git-lfs.github.com/spec/v1\noid", "git lfs pull"),
        ("a.dae", b"version https://git-lfs.github.com/spec/v1\noid", "git lfs pull"),
        ("a.stl", b"x" + binary_stl()[1:-1], "truncated"),
        ("a.stl", binary_stl()[:-1], "truncated"),
        ("a.stl", TEXT_STL[: -len(b"vertex 0 1 0\n")], "a facet lacks a vertex"),
        ("a.stl", b"solid x\nendsolid x\n", "no triangles"),
        ("a.stl", b"solid x\n" + b"vertex 1 2 nan\n" * 3, "not finite"),
        ("a.stl", b"solid x\nvertex 1 2 x\n", "could not convert"),
        ("a.obj", b"o nothing\n", "no triangles"),
        ("a.ply", b"ply\n", "not a PLY file"),
        ("a.ply", ply("binary_big_endian")[:-40], "truncated"),
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


def area(mesh: TriangleMesh) -> float:
    """Area of all triangles [m²]."""
    a, b, c = np.swapaxes(mesh.vertices[mesh.triangles], 0, 1)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def coal_mesh(path: Path) -> TriangleMesh:
    """The same file as the collision library reads it, which knows no units."""
    mesh = coal.MeshLoader().load(str(path), np.ones(3))
    corners = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    return TriangleMesh(
        vertices=np.asarray(mesh.vertices(), float),
        triangles=np.array([[t[0], t[1], t[2]] for t in corners]),
    )


def centroids(mesh: TriangleMesh) -> np.ndarray:
    """Middles of all triangles, in one order for all readers, shape (n, 3)."""
    middles = mesh.vertices[mesh.triangles].mean(axis=1).round(5) + 0.0
    return np.asarray(middles[np.lexsort(middles.T)])


@pytest.mark.parametrize(
    "name",
    [
        "ur_description/meshes/ur5/collision/wrist2.stl",
        "panda_description/meshes/collision/link3.stl",
        "tiago_description/meshes/torso/torso_lift_collision.dae",
        "romeo_description/meshes/V1/collision/LWristYaw.dae",
        "kinova_description/meshes/hand_2finger.dae",
        "laikago_description/meshes/calf.obj",
    ],
)
def test_triangles_are_those_of_another_reader(name: str) -> None:
    """Real files, against the collision library's own reader."""
    folder = data_folder()
    assert folder is not None
    path = folder / "example-robot-data" / "robots" / name
    ours, theirs = read_mesh(path.read_bytes(), path.suffix), coal_mesh(path)
    assert area(ours) == pytest.approx(area(theirs), rel=1e-5)
    np.testing.assert_allclose(np.ptp(ours.vertices, axis=0), sides(theirs), rtol=1e-5)
    if path.suffix == ".stl":
        np.testing.assert_allclose(centroids(ours), centroids(theirs), atol=2e-5)


BOX_DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
<asset><unit meter="{unit}"/><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="f" count="15">0 0 0 1 0 0 1 2 0 0 2 0 0 0 3
</float_array><technique_common><accessor source="#f" stride="3" count="5">
<param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="2"><input semantic="VERTEX" source="#v" offset="0"/>
<vcount>4 3</vcount><p>0 1 2 3 0 1 4</p></polylist></mesh></geometry>
</library_geometries>
<library_visual_scenes><visual_scene id="s"><node>{moves}
<node><translate>0 0 1</translate><instance_geometry url="#g"/></node></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def test_meshes_of_several_parts_are_whole() -> None:
    """The collision library joins their triangles wrongly; trimesh does not."""
    folder = data_folder()
    assert folder is not None
    robots = folder / "example-robot-data" / "robots"
    path = robots / "laikago_description" / "meshes" / "trunk.obj"
    ours = read_mesh(path.read_bytes(), ".obj")
    assert area(ours) == pytest.approx(trimesh.load_mesh(path).area, rel=1e-6)
    assert area(coal_mesh(path)) > 2 * area(ours)  # why it does not read files here


@pytest.mark.parametrize("up", ["Y_UP", "Z_UP", "X_UP"])
@pytest.mark.parametrize("unit", ["1", "0.001", "0.0254"])
def test_collada_is_read_as_rviz_reads_it(unit: str, up: str) -> None:
    """Nodes are followed, the unit holds for all of it, the up axis for none."""
    moves = "<rotate>0 0 1 90</rotate><scale>2 2 2</scale><translate>5 0 0</translate>"
    text = BOX_DAE.format(unit=unit, up=up, moves=moves)
    mesh = read_mesh(text.encode(), ".dae")
    file_points = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0], [0, 0, 3.0]])
    moved = 2 * (file_points + np.array([5.0, 0.0, 1.0]))
    expected = float(unit) * np.stack([-moved[:, 1], moved[:, 0], moved[:, 2]], 1)
    np.testing.assert_allclose(
        mesh.vertices, expected[np.lexsort(expected.T[::-1])], atol=1e-12
    )
    # A rectangle 1 × 2 and a triangle 1 × 3, twice the size in either direction.
    assert area(mesh) == pytest.approx(4 * 3.5 * float(unit) ** 2)


def test_collada_nodes_agree_with_the_collision_library(tmp_path: Path) -> None:
    """In metres both readers follow the same nodes to the same triangles."""
    moves = "<matrix>0 -1 0 5 1 0 0 6 0 0 3 7 0 0 0 1</matrix>"
    path = tmp_path / "a.dae"
    path.write_text(BOX_DAE.format(unit="1", up="Z_UP", moves=moves))
    ours, theirs = read_mesh(path.read_bytes(), ".dae"), coal_mesh(path)
    np.testing.assert_allclose(centroids(ours), centroids(theirs), atol=1e-5)


def test_collada_positions_are_in_the_array_that_is_named() -> None:
    """An accessor may read the array of another source."""
    text = """<COLLADA><library_geometries><geometry><mesh>
    <source id="p"><float_array id="a">0 0 0 9 0 0 0 9 0</float_array>
    <technique_common><accessor source="#b" stride="3"/></technique_common></source>
    <source id="q"><float_array id="b">0 0 0 1 0 0 0 1 0</float_array></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
    </mesh></geometry></library_geometries></COLLADA>"""
    assert area(read_mesh(text.encode(), ".dae")) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("kind", "corners"),
    [
        ("tristrips", "0 1 2 3"), ("trifans", "0 1 3 2"), ("polygons", "0 1 3 2"),
    ],
)  # fmt: skip
def test_collada_primitives_cover_the_same_square(kind: str, corners: str) -> None:
    """Four corners in the order that each kind wants."""
    text = f"""<COLLADA><library_geometries><geometry><mesh>
    <source id="p"><float_array>0 0 0 1 0 0 0 1 0 1 1 0</float_array></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <{kind}><input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p></{kind}>
    </mesh></geometry></library_geometries></COLLADA>"""
    mesh = read_mesh(text.encode(), ".dae")
    assert area(mesh) == pytest.approx(1.0)
    a, b, c = np.swapaxes(mesh.vertices[mesh.triangles], 0, 1)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('meter="1"', 'meter="0"', "expected a number > 0"),
        ('meter="1"', 'meter="-1"', "expected a number > 0"),
        ('meter="1"', 'meter="nan"', "expected a number > 0"),
        ('meter="1"', 'meter="0,001"', "<unit meter>: .*got '0,001'"),
        ("0 1 2 3 0 1 4", "0 1 2 3 0 1 9", "a vertex that is missing .there are 5"),
        ("0 1 2 3 0 1 4", "0 1 2 3 0 1 -1", "a vertex that is missing"),
        ("0 1 2 3 0 1 4", "0 1 2", "<polylist>: <vcount> and <p> do not fit"),
        ("0 1 2 3 0 1 4", "0 1 2 3 0 1 4 0", "<vcount> and <p> do not fit"),
        ('url="#g"', 'url="#h"', "names '#h', which is not in the file"),
        ('instance_geometry url="#g"', 'instance_node url="#n"', "nodes that contain"),
        ("0 0 1</translate>", "0 0 x</translate>", "damaged .dae file"),
        ("0 0 1</translate>", "0 0</translate>", "expected 3 finite numbers"),
        ("2 0 0 0 3", "2 0 0 0 inf", "not finite"),
    ],
)
def test_damaged_collada_is_refused(old: str, new: str, said: str) -> None:
    """With a sentence each; nodes that contain themselves come to an end."""
    text = BOX_DAE.format(unit="1", up="Z_UP", moves="").replace(old, new)
    text = text.replace("<node><translate>", '<node id="n"><translate>')
    with pytest.raises(MeshError, match=said):
        read_mesh(text.encode(), ".dae")


@pytest.mark.parametrize("head", [b"solid by SomeCAD", b"COLOR=", bytes(10)])
@pytest.mark.parametrize("tail", [b"", b"\0", b"endsolid" * 30])
def test_binary_stl_may_say_solid_and_have_a_tail(head: bytes, tail: bytes) -> None:
    """The count decides; bytes after the last facet are nobody's."""
    data = head.ljust(80) + binary_stl()[80:] + tail
    mesh = read_mesh(data, ".stl")
    assert len(mesh.triangles) == 1
    np.testing.assert_allclose(sides(mesh), [1.0, 3.0, 2.0])


@pytest.mark.parametrize(
    "text",
    [
        "  v 0 0 0\n\tv 1 0 0\n v 0 1 0\n v 0 0 1\n f 1 2 3\n  f 1 2 4\n",
        "v 0 0 0 # a\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3#b\n#f 2 3 4\nf 1 2 4 # c\n",
        "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nv 0 0 1\r\nf 1 2 \\\r\n 3\r\nf 1 2 4\r\n",
        "\ufeffv 0 0 0\rv 1 0 0\rv 0 1 0\rv 0 0 1\rf 1 2 3\rf 1 2 4\r",
    ],
)
def test_obj_lines_may_be_written_in_many_ways(text: str) -> None:
    """Indented, with comments, continued, ended as on any system: nothing is lost."""
    mesh = read_mesh(text.encode(), ".obj")
    assert len(mesh.triangles) == 2
    assert area(mesh) == pytest.approx(1.0)


def test_obj_faces_count_from_either_end() -> None:
    """Quads become two triangles, with textures and normals passed over."""
    data = b"v 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 0\nf 1/1/1 2//7 -2 \\\n 4\n"
    assert area(read_mesh(data, ".obj")) == pytest.approx(6.0)
    for face in (b"f 1 2 5\n", b"f -9 2 3\n", b"f 0 1 2\n"):
        with pytest.raises(MeshError, match="vertex"):
            read_mesh(data + face, ".obj")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("faces", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3]],
                                   [[0, 1, 2, 3], [0, 1, 2]], [[0, 1, 2], [0, 1, 2, 3]],
                                   []])  # fmt: skip
def test_binary_ply_faces_of_any_size(order: str, faces: list[list[int]]) -> None:
    """All of one size are read at once, others one by one, to the same area."""
    name = "little" if order == "<" else "big"
    data = f"""ply
format binary_{name}_endian 1.0
element face {len(faces)}
property list uchar ushort vertex_indices
element vertex 4
property float x
property float y
property float z
end_header
""".encode()
    for face in faces:
        data += struct.pack(f"{order}B{len(face)}H", len(face), *face)
    for corner in ([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]):
        data += struct.pack(f"{order}3f", *corner)
    if not faces:
        with pytest.raises(MeshError, match="no triangles"):
            read_mesh(data, ".ply")
        return
    expected = sum(len(face) - 2 for face in faces) / 2
    assert area(read_mesh(data, ".ply")) == pytest.approx(expected)


@pytest.mark.parametrize("index", [77777777, 3, -1])
@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_ply_faces_may_not_name_missing_vertices(kind: str, index: int) -> None:
    """An engine would read the memory beside its own."""
    data = ply(kind)
    if kind == "ascii":
        data = data.replace(b"3 0 1 2", f"3 0 1 {index}".encode())
    else:
        data = data[:-4] + struct.pack("<i", index)
    with pytest.raises(MeshError, match="names a vertex that is missing"):
        read_mesh(data, ".ply")


def test_ply_elements_come_in_any_order_with_anything_else() -> None:
    """Faces of different sizes, and elements that are no mesh."""
    text = """ply
format ascii 1.0
element edge 1
property int v
element face 2
property uchar red
property list uchar uint vertex_index
element vertex 4
property float x
property float y
property float z
end_header
7
255 4 0 1 2 3
255 3 0 1 2
0 0 0 1 0 0 1 1 0 0 1 0
"""
    assert area(read_mesh(text.encode(), ".ply")) == pytest.approx(1.5)


def test_a_mirrored_mesh_is_seen_from_outside() -> None:
    """Negative scales turn the triangles round, an even number of them does not."""
    mesh = triangles_of(Shape(box=(1.0, 1.0, 1.0)))
    for scale in ((-1, 1, 1), (-2, -1, 1), (0.5, 1, -3)):
        scaled = mesh.scaled(scale)
        a, b, c = np.swapaxes(scaled.vertices[scaled.triangles], 0, 1)
        assert ((np.cross(b - a, c - a) * (a + b + c)).sum(axis=1) > 0).all()
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(
            abs(np.prod(scale))
        )


def mutated(count: int) -> Iterator[tuple[str, bytes]]:
    """Files with bytes changed, taken out, doubled or cut off."""
    rng = np.random.default_rng(16)
    names = sorted(FILES)
    for number in range(count):
        name = names[number % len(names)]
        data = bytearray(FILES[name])
        for _ in range(int(rng.integers(1, 6))):
            at = int(rng.integers(len(data)))
            change = int(rng.integers(5))
            if change == 0:
                data[at] = int(rng.integers(256))
            elif change == 1:
                data[at] ^= 1 << int(rng.integers(8))
            elif change == 2:
                del data[at : at + int(rng.integers(1, 9))]
            elif change == 3:
                data[at:at] = data[max(0, at - 12) : at]
            else:
                data[at:at] = rng.choice([b"-1", b"1e999", b"nan", b"99999999"])
            if len(data) < 2:
                break
        yield name, bytes(data)


def use(mesh: TriangleMesh) -> None:
    """All that the engine does with a mesh."""
    shape = coal_shape(mesh)
    hull = convex_hull(mesh.vertices)
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.security_margin = 0.002
    place = coal.Transform3s.Identity()
    for body in (shape, hull):
        if body is not None:
            coal.collide(body, place, coal.Box(1, 1, 1), place, request, result)


@pytest.mark.parametrize("count", [200, pytest.param(3000, marks=pytest.mark.slow)])
def test_mutated_meshes_crash_nothing(count: int) -> None:
    """Each ends in triangles that the engine can use, or in a mesh error."""
    read = 0
    for name, data in mutated(count):
        try:
            mesh = read_mesh(data, Path(name).suffix)
        except MeshError:
            continue
        assert np.isfinite(mesh.vertices).all()
        assert mesh.triangles.max() < len(mesh.vertices)
        read += 1
        if NO_SIZE_M < float(sides(mesh).max()) <= MAX_LENGTH_M:  # as the loader asks
            use(mesh)
    assert 0 < read < count


def test_a_mesh_is_read_once_and_changed_by_nobody() -> None:
    """The same bytes are the same mesh; its numbers are not to be written to."""
    mesh = read_mesh(binary_stl(), ".stl")
    assert read_mesh(binary_stl(), ".stl") is mesh
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1.0
    assert sides(mesh.scaled(2.0)) == pytest.approx(2.0 * sides(mesh))
    for _ in range(2):
        with pytest.raises(MeshError):
            read_mesh(b"solid", ".stl")
