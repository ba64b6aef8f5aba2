"""Triangles of the shapes, and the cell that is put together from them."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.cell.model.fields import (
    CapsuleShape,
    CylinderShape,
    Shape,
    SphereShape,
)
from reachmap.cell.model.shapes import triangles_of
from reachmap.core.collision.solids import SolidCell
from reachmap.geometry import inverse_transform
from tests.support.scenes import scene_of


def volume(shape: Shape) -> float:
    """Enclosed volume by the divergence theorem; positive if faces point outwards."""
    surface = triangles_of(shape)
    vertices, triangles = surface.vertices, surface.triangles
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float((np.cross(a, b) * c).sum() / 6.0)


def test_box_encloses_its_volume() -> None:
    """Every face of a box points outwards."""
    assert volume(Shape(box=(0.2, 0.3, 0.5))) == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (Shape(cylinder=CylinderShape(radius=0.1, length=0.4)), np.pi * 0.1**2 * 0.4),
        (
            Shape(capsule=CapsuleShape(radius=0.1, length=0.4)),
            np.pi * 0.1**2 * (0.4 + 4 / 3 * 0.1),
        ),
        (Shape(sphere=SphereShape(radius=0.1)), 4 / 3 * np.pi * 0.1**3),
    ],
    ids=["cylinder", "capsule", "sphere"],
)
def test_round_shapes_enclose_nearly_their_volume(
    shape: Shape, expected: float
) -> None:
    """48 corners lose less than one percent, and nothing is added."""
    assert 0.985 * expected < volume(shape) <= expected


@pytest.mark.parametrize("name", ["planar-toy", "ur5-eye-in-hand"])
def test_solids_stand_where_the_checker_has_them(name: str) -> None:
    """TCP and names agree with kinematics and with the pairs that are checked."""
    scene = scene_of(name)
    cell = SolidCell.build(read_cell(name))
    rng = np.random.default_rng(3)
    for _ in range(5):
        q = rng.uniform(cell.robot.lower_rad, cell.robot.upper_rad)
        assert cell.tcp_pose(q) == pytest.approx(scene.kinematics.forward(q), abs=1e-9)
    checked = {n for pair in scene.checker.body_pairs for n in pair.split(" | ")}
    assert checked <= {solid.name for solid in cell.solids}


def test_the_bin_stands_at_its_pose() -> None:
    """Corners of the five boxes span the bin's outside, in the bin frame."""
    cell = SolidCell.build(read_cell("ur5-eye-in-hand"))
    spec = cell.loaded.cell.bin
    poses = cell.solid_poses(cell.scan_configuration)
    corners = np.concatenate(
        [
            solid.vertices @ T[:3, :3].T + T[:3, 3]
            for solid, T in zip(cell.solids, poses, strict=True)
            if solid.kind == "bin"
        ]
    )
    T_bin_base = inverse_transform(spec.pose.matrix())
    inside = corners @ T_bin_base[:3, :3].T + T_bin_base[:3, 3]
    outer = np.array(spec.inner[:2]) + 2 * spec.wall
    assert np.ptp(inside, axis=0)[:2] == pytest.approx(outer)
    assert inside[:, 2].max() == pytest.approx(spec.inner[2])


def test_camera_looks_at_the_bin() -> None:
    """At the shipped scan configuration the optical axis meets the bin's bottom."""
    cell = SolidCell.build(read_cell("ur5-eye-in-hand"))
    frame = cell.camera_frame()
    assert frame is not None
    joint, T_joint_camera = frame
    T = cell.joint_poses(cell.scan_configuration)[joint] @ T_joint_camera
    bottom = cell.loaded.cell.bin.pose.matrix()[:3, 3]
    along = (bottom[2] - T[2, 3]) / T[2, 2]
    assert along > 0.3
    assert (T[:3, 3] + along * T[:3, 2])[:2] == pytest.approx(bottom[:2], abs=0.05)


def test_kinds_tell_what_moves() -> None:
    """A tool hangs on the arm, a body stands still, the bin is neither."""
    cell = SolidCell.build(read_cell("ur5-eye-in-hand"))
    kinds = {solid.name: solid.kind for solid in cell.solids}
    assert kinds["camera housing"] == "tool"
    assert kinds["pedestal"] == "body"
    assert kinds["forearm_link"] == "link"
    assert kinds["bin wall +x"] == "bin"
