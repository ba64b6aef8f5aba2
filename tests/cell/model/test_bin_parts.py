"""Parts of a bin against the solid they are cut from."""

from __future__ import annotations

import coal
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from reachmap.cell.loading import cell_from_text, read_cell
from reachmap.cell.model.bin_parts import bin_parts
from reachmap.cell.model.bodies import BinSpec, RimSpec
from reachmap.cell.model.shapes import corner_points, triangles_of
from reachmap.core.collision.shapes import coal_shape
from reachmap.core.scene import Scene
from reachmap.geometry import inverse_transform
from reachmap.sampling.frames import bin_test_frames
from tests.support.optional import present

SPECS = {
    "upright": BinSpec(inner=(0.4, 0.3, 0.2), wall=(0.02, 0.03), bottom=0.01),
    "tapered": BinSpec(
        inner=(0.4, 0.3, 0.2), inner_top=(0.5, 0.36), wall=0.02, heap=0.12
    ),
    "narrowing": BinSpec(inner=(0.4, 0.3, 0.2), inner_top=(0.3, 0.28), wall=0.02),
}
each_bin = pytest.mark.parametrize("spec", SPECS.values(), ids=list(SPECS))


def inside(part, points):
    """Whether points are inside a part, with half-spaces of scipy's hull."""
    hull = ConvexHull(corner_points(part.shape) + part.centre_m)
    normal, offset = hull.equations[:, :3], hull.equations[:, 3]
    return (points @ normal.T + offset < -1e-9).all(axis=1)


@each_bin
def test_parts_are_what_is_between_two_frusta(spec) -> None:
    """Every point is solid as the two frusta say, and in one part only."""
    rng = np.random.default_rng(1)
    low = [-0.35, -0.3, -0.05]
    points = rng.uniform(low, [0.35, 0.3, 0.25], (40_000, 3))
    z = points[:, 2]
    share = z / spec.inner[2]
    half = np.stack(
        [(a + share * (b - a)) / 2 for a, b in zip(spec.inner, spec.top, strict=False)],
        axis=1,
    )
    within = (np.abs(points[:, :2]) < half).all(axis=1)
    around = (np.abs(points[:, :2]) < half + np.array(spec.walls)).all(axis=1)
    tall = (z > -spec.bottom_m) & (z < spec.inner[2])
    solid = around & tall & (~within | (z < spec.heap))
    count = sum(inside(part, points).astype(int) for part in bin_parts(spec))
    assert (count == solid).all()
    assert 100 < solid.sum() < len(points)


@each_bin
def test_engine_and_pictures_have_the_same_parts(spec) -> None:
    """Volume by triangles, and engine distance to points outside, by closed form."""
    for part in bin_parts(spec):
        surface = triangles_of(part.shape)
        a, b, c = surface.vertices[surface.triangles].transpose(1, 0, 2)
        volume = float((a * np.cross(b, c)).sum()) / 6.0
        hull = ConvexHull(corner_points(part.shape))
        assert volume == pytest.approx(hull.volume, rel=1e-9)
        # A step outwards from the middle of each face is that far away.
        for corners in surface.vertices[surface.triangles]:
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            normal /= np.linalg.norm(normal)
            point = corners.mean(axis=0) + 0.013 * normal
            place = coal.Transform3s(np.eye(3), point)
            distance = coal.distance(
                coal_shape(part.shape), coal.Transform3s(), coal.Sphere(1e-6), place,
                coal.DistanceRequest(), coal.DistanceResult(),
            )  # fmt: skip
            assert distance == pytest.approx(0.013, abs=2e-5)


def test_a_rim_stands_out_around_the_upper_edge() -> None:
    """Its outside is the outer size of the bin, and no part of it is in the opening."""
    rim = RimSpec(width=0.015, height=0.03)
    for top in (None, (0.5, 0.36)):
        spec = BinSpec(inner=(0.4, 0.3, 0.2), inner_top=top, wall=0.01, rim=rim)
        ledges = [p for p in bin_parts(spec) if p.name.startswith("bin rim")]
        points = np.vstack([corner_points(p.shape) + p.centre_m for p in ledges])
        assert np.ptp(points, axis=0)[:2] == pytest.approx(spec.outer[:2])
        assert points[:, 2].min() == pytest.approx(0.17)
        assert points[:, 2].max() == pytest.approx(0.2)
        rng = np.random.default_rng(2)
        opening = rng.uniform(-0.5, 0.5, (4000, 3)) * [*spec.top, 0.06]
        opening[:, 2] += 0.17
        share = np.minimum(opening[:, 2], 0.2) / 0.2
        for axis in (0, 1):
            a, b = spec.inner[axis], spec.top[axis]
            opening[:, axis] *= (a + share * (b - a)) / b
        assert not any(inside(part, opening).any() for part in ledges)


def test_a_bin_by_mesh_is_checked_like_the_same_bin_by_numbers(tmp_path) -> None:
    """Configurations around the bin are free, or not, in both cells alike."""
    plain = read_cell("ur5-eye-in-hand")
    triangles = np.vstack(
        [
            surface.vertices[surface.triangles] + part.centre_m
            for part in bin_parts(plain.cell.bin)
            for surface in [triangles_of(part.shape)]
        ]
    )
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {:.9f} {:.9f} {:.9f}\n".format(*v) for v in corners)
        + "endloop\nendfacet\n"
        for corners in triangles
    )
    (tmp_path / "tray.stl").write_text(f"solid tray\n{facets}endsolid tray\n")
    by_mesh = cell_from_text(
        plain.text.replace("bin:\n", "bin:\n  mesh: {file: tray.stl}\n", 1),
        label="cell.yaml",
        directory=tmp_path,
    )
    scenes = [Scene.build(plain), Scene.build(by_mesh)]
    frames = bin_test_frames(plain.cell, scenes[0].T_base_bin).T_base_tcp
    T = frames.reshape(-1, 4, 4)[::40]
    Q, _ = scenes[0].kinematics.solve_many(T, windings=False)
    free = [scene.checker.free_mask(Q) for scene in scenes]
    assert (free[0] == free[1]).mean() > 0.999
    assert 0.05 < free[0].mean() < 0.95
    assert "bin shell" in " ".join(scenes[1].checker.body_pairs)
    assert not scenes[1].scan_problems()


def test_grasps_and_walls_lean_with_the_bin() -> None:
    """Seen from the bin, nothing changes; only what is straight down does."""
    upright = read_cell("ur5-eye-in-hand")
    pose = upright.cell.bin.pose
    rpy = [12.0, -9.0, present(pose.rpy_deg)[2]]
    leaning = read_cell("ur5-eye-in-hand", [f"bin.pose.rpy_deg={rpy}"])
    seen = []
    for loaded in (upright, leaning):
        scene = Scene.build(loaded)
        T_bin_base = inverse_transform(scene.T_base_bin)
        points = bin_test_frames(loaded.cell, scene.T_base_bin).frames.points
        walls = [
            T_bin_base @ scene.robot.T_base_root @ body.placement.homogeneous
            for body in scene.checker.bodies.geometryObjects
            if " bin " in body.name
        ]
        local = points @ T_bin_base[:3, :3].T + T_bin_base[:3, 3]
        seen.append((local, np.array(walls)))
    for a, b in zip(*seen, strict=True):
        assert a == pytest.approx(b, abs=1e-9)
    R = bin_test_frames(leaning.cell, leaning.cell.T_base_bin()).frames.orientations
    down = R[0][:, 2]
    assert down == pytest.approx([0, 0, -1], abs=1e-9)
