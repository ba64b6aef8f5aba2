"""Bounds on how far the robot moves, against moving it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from reachmap.core.collision.bodies import build_geometry
from reachmap.core.collision.displacement import displacement_bounds
from tests.support.scenes import scene_of

CELLS = ["ur5-eye-in-hand", "panda-eye-in-hand", "planar-toy"]


def mesh_points(scene, names=None):
    """Positions of all vertices of all moving bodies, as a function of q."""
    bodies = build_geometry(scene.robot, scene.loaded, with_bin=False)
    geometry = bodies.geometry
    data, placed = scene.robot.model.createData(), geometry.createData()
    local = []
    for index, body in enumerate(geometry.geometryObjects):
        if body.parentJoint:
            body.geometry.computeLocalAABB()
            box = body.geometry.aabb_local
            low, high = np.asarray(box.min_), np.asarray(box.max_)
            corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1)
            points = (
                np.asarray(body.geometry.vertices())
                if hasattr(body.geometry, "vertices")
                else 0.999 * (corners.T - (low + high) / 2) + (low + high) / 2
            )
            local.append((index, points))

    def at(q):
        pin.updateGeometryPlacements(scene.robot.model, data, geometry, placed, q)
        return [
            points @ placed.oMg[index].rotation.T + placed.oMg[index].translation
            for index, points in local
        ]

    return at


@pytest.mark.parametrize("name", CELLS)
def test_no_vertex_moves_further_than_the_global_bound(name):
    """The bound from the chain holds for random motions of every size."""
    scene = scene_of(name, with_bin=False)
    at = mesh_points(scene)
    rng = np.random.default_rng(1)
    low, high = scene.robot.lower_rad, scene.robot.upper_rad
    for _ in range(60):
        q = rng.uniform(low, high)
        step = rng.normal(size=len(q)) * 10.0 ** rng.uniform(-3, -0.3)
        bound = float(np.abs(step) @ scene.checker.reach_m)
        moved = max(
            np.linalg.norm(a - b, axis=1).max()
            for a, b in zip(at(q), at(q + step), strict=True)
        )
        assert moved <= bound + 1e-12


@pytest.mark.parametrize("name", CELLS)
def test_no_vertex_leaves_the_local_bound_of_any_part_of_a_motion(name):
    """The bound about a middle holds for the motion, and its parts about theirs."""
    scene = scene_of(name, with_bin=False)
    at = mesh_points(scene)
    rng = np.random.default_rng(2)
    for _ in range(60):
        q = rng.uniform(scene.robot.lower_rad, scene.robot.upper_rad)
        half = rng.normal(size=len(q))
        half *= rng.uniform(0.01, 0.2) / np.abs(half).sum()
        bound = float(scene.checker.bound.displacement_m(q[None], half)[0])
        part = rng.choice([1.0, 0.5, 0.25])
        middle = q + rng.uniform(-(1 - part), 1 - part) * half
        here = at(middle)
        for share in (-1.0, -0.6, 0.3, 1.0):
            there = at(middle + part * share * half)
            moved = max(
                np.linalg.norm(a - b, axis=1).max()
                for a, b in zip(here, there, strict=True)
            )
            assert moved <= part * bound + 1e-12


def test_the_local_bound_is_worth_having():
    """About where the robot is, the bound is well below that of the stretched arm."""
    scene = scene_of("ur5-eye-in-hand", with_bin=False)
    rng = np.random.default_rng(3)
    q0 = scene.scan_configuration
    ratios = []
    for _ in range(50):
        half = rng.normal(size=6)
        half *= 0.05 / np.abs(half).sum()
        local = float(scene.checker.bound.displacement_m(q0[None], half)[0])
        ratios.append(local / float(np.abs(half) @ scene.checker.reach_m))
    assert np.mean(ratios) < 0.7


def test_planar_bounds_are_the_lengths_of_the_links():
    """For parallel axes in a plane the bound is the stretched length, to a radius."""
    scene = scene_of("planar-toy", with_bin=False)
    bodies = build_geometry(scene.robot, scene.loaded, with_bin=False)
    bounds = displacement_bounds(scene.robot.model, bodies).max(axis=0)
    np.testing.assert_allclose(bounds, [0.7, 0.3, 0.1], atol=0.015)
    assert (bounds >= [0.7, 0.3, 0.1]).all()
