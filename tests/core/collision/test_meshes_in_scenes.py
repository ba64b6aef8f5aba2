"""Meshes of every form in the collision engine, flat ones included."""

from __future__ import annotations

import struct
from pathlib import Path

import coal
import numpy as np
import pytest

from reachmap.cell.files.resources import data_folder
from reachmap.cell.meshes.reading import read_mesh
from reachmap.cell.model.fields import Shape
from reachmap.cell.model.shapes import triangles_of
from reachmap.core.collision.shapes import coal_shape, convex_hull
from reachmap.core.scene import Scene
from reachmap.errors import CellError
from tests.support.small_cells import joint, link, load, robot

ARM = robot(
    link("base"),
    link("l1", 'xyz="0.2 0 0" rpy="0 1.5707963267948966 0"|'
         '<cylinder radius="0.01" length="0.4"/>'),
    joint("j1", "base", "l1", more='<axis xyz="0 1 0"/>'),
)  # fmt: skip


def stl(*triangles: list[list[float]]) -> bytes:
    """Binary STL of triangles."""
    data = bytes(80) + struct.pack("<I", len(triangles))
    for corners in triangles:
        flat = [value for corner in corners for value in corner]
        data += struct.pack("<12fH", 0, 0, 0, *flat, 0)
    return data


def scene(folder: Path, mesh: bytes, *, scale: str = "1") -> Scene:
    """Arm that turns about y, with a mesh that stands in the world."""
    (folder / "m.stl").write_bytes(mesh)
    body = f"bodies=[{{name: m, shape: {{mesh: {{file: m.stl, scale: {scale}}}}}}}]"
    return Scene.build(load(folder, ARM, "l1", ["j1"], [body]))


FLOOR = stl([[-1, -1, -0.1], [1, -1, -0.1], [1, 1, -0.1]],
            [[-1, -1, -0.1], [1, 1, -0.1], [-1, 1, -0.1]])  # fmt: skip


def test_a_flat_mesh_is_an_obstacle(tmp_path: Path) -> None:
    """A floor of two triangles: the arm meets it where its tip is too low."""
    checker = scene(tmp_path, FLOOR).checker
    assert "l1 | m" in checker.body_pairs
    for angle in np.linspace(-1.5, 1.5, 61):
        lowest = -0.4 * np.sin(angle) - 0.01 * np.cos(angle)
        if abs(lowest - (-0.098)) > 1e-4:
            assert checker.is_free(np.array([angle])) == (lowest > -0.098)


@pytest.mark.parametrize("thickness", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_nearly_flat_meshes_crash_nothing(tmp_path: Path, thickness: float) -> None:
    """Between a sheet and a solid nothing is lost, and nothing breaks."""
    surface = triangles_of(Shape(box=(1.0, 1.0, 1.0)))
    thin = surface.scaled((1.0, 1.0, max(thickness, 1e-300)))
    corners = (thin.vertices - [0, 0, 0.1])[thin.triangles].tolist()
    checker = scene(tmp_path, stl(*corners)).checker
    assert checker.is_free(np.array([-0.3]))
    assert not checker.is_free(np.array([0.6]))


def test_a_mesh_on_one_line_crashes_nothing(tmp_path: Path) -> None:
    """Triangles without area are met like a wire, or not at all."""
    line = stl([[0.3, 0, -0.1], [0.3, 0, -0.2], [0.3, 0, -0.3]])
    checker = scene(tmp_path, line).checker
    assert checker.is_free(np.array([-1.0]))
    assert not checker.is_free(np.array([np.arctan2(0.2, 0.3)]))


@pytest.mark.parametrize(
    ("scale", "said"),
    [("1e-12", "has no size"), ("1e300", "m large"), ("0", "greater than 0|> 0")],
)
def test_sizes_that_no_body_has_are_refused(
    tmp_path: Path, scale: str, said: str
) -> None:
    """Before an engine sees them."""
    with pytest.raises(CellError, match=said):
        scene(tmp_path, FLOOR, scale=scale)


def test_hulls_are_those_of_the_collision_library() -> None:
    """The same answers as coal's own hull gives, for real meshes at random poses."""
    folder = data_folder()
    assert folder is not None
    meshes = folder / "example-robot-data/robots/ur_description/meshes/ur5/collision"
    rng = np.random.default_rng(3)
    probe = coal.Box(0.05, 0.08, 0.1)
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    for name in ("forearm", "wrist1"):
        mesh = read_mesh((meshes / f"{name}.stl").read_bytes(), ".stl")
        points = coal.StdVec_Vec3s()
        points.extend(list(mesh.vertices))
        theirs = coal.Convex.convexHull(points, True, "Qt")
        ours = convex_hull(mesh.vertices)
        low, high = mesh.vertices.min(axis=0) - 0.1, mesh.vertices.max(axis=0) + 0.1
        still, hits = coal.Transform3s.Identity(), 0
        for _ in range(400):
            R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            R *= np.sign(np.linalg.det(R))
            place = coal.Transform3s(R, rng.uniform(low, high))
            answers = []
            for hull in (ours, theirs, coal_shape(mesh)):
                result.clear()
                hit = coal.collide(hull, still, probe, place, request, result)
                answers.append(bool(hit))
            assert answers[0] == answers[1]
            assert answers[0] or not answers[2]
            hits += answers[0]
        assert 40 < hits < 360
