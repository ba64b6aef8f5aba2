"""Clearance against a closed form and brute force; the other margins beside them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from reachmap.core.collision.clearance import (
    TOLERANCE_M,
    TOLERANCE_SHARE,
    ClearanceMeter,
)
from reachmap.scans.margins import MarginMeter
from tests.support.scenes import scene_of


def at_most(least):
    """The greatest clearance that may be said where this is the least."""
    return max(least + TOLERANCE_M, least / (1 - TOLERANCE_SHARE)) + 1e-9


@pytest.mark.parametrize("angle", [0.5, -0.7])
def test_the_gap_to_a_post_is_that_on_paper(angle):
    """Link 1 of the toy arm, 10 mm thick, turns towards a post 60 mm from its axis."""
    scene = scene_of("planar-toy")
    path = np.array([[np.sign(angle) * 1.2, 0.5, 0.5], [angle, 0.5, 0.5]])
    clearance, pair = ClearanceMeter(scene.checker).of_path(path)
    assert clearance == pytest.approx(0.06 * np.sin(abs(angle)) - 0.02, abs=1e-5)
    assert set(scene.checker.body_pairs[pair].split(" | ")) == {"link_1", "post"}


def test_the_narrowest_place_lies_between_way_points():
    """Both ends of the motion are far from the post, its middle is near."""
    scene = scene_of("planar-toy")
    meter = ClearanceMeter(scene.checker)
    a, b = np.array([2.0, -1.9, 0.4]), np.array([2.4, -2.6, 0.4])
    ends = min(meter.of_path(q[None])[0] for q in (a, b))
    between = min(
        meter.of_path((a + share * (b - a))[None])[0]
        for share in np.linspace(0, 1, 2001)
    )
    clearance, _ = meter.of_path(np.array([a, b]))
    assert between - 1e-9 <= clearance <= at_most(between)
    assert clearance <= ends


@pytest.mark.parametrize("seed", [0, 1])
def test_clearance_is_the_least_of_all_pairs_on_the_meshes(seed):
    """Distances of the true meshes at 150 places of a motion, every pair of bodies."""
    scene = scene_of("ur5-eye-in-hand")
    checker, rng = scene.checker, np.random.default_rng(seed)
    while True:
        q = scene.scan_configuration + rng.normal(0, 0.6, scene.robot.dof)
        path = np.array([scene.scan_configuration, q])
        if scene.motions.path_is_verified(path):
            break
    model, data = scene.robot.body_model, scene.robot.body_model.createData()
    placed = checker.bodies.createData()
    least = np.inf
    for share in np.linspace(0, 1, 150):
        at = scene.robot.body_configuration(path[0] + share * (path[1] - path[0]))
        pin.computeDistances(model, data, checker.bodies, placed, at)
        least = min(least, *(r.min_distance for r in placed.distanceResults))
    clearance, _ = ClearanceMeter(checker).of_path(path)
    step = (checker.pair_reach_m @ np.abs(path[1] - path[0])).max() / 149
    assert least - step <= clearance <= at_most(least)
    assert clearance >= checker.safety_margin_m - TOLERANCE_M


def test_the_answer_does_not_depend_on_earlier_questions():
    """To the last bit, whatever was measured before."""
    scene = scene_of("ur5-eye-in-hand")
    rng = np.random.default_rng(5)
    paths = scene.scan_configuration + rng.normal(0, 0.3, (4, 3, scene.robot.dof))
    meter = ClearanceMeter(scene.checker)
    forwards = [meter.of_path(path) for path in paths]
    backwards = [ClearanceMeter(scene.checker).of_path(path) for path in paths[::-1]]
    assert forwards == backwards[::-1]


def test_joint_margin_and_singular_value_are_those_of_the_approach():
    """Least over the approach; the singular value by differences of the tool's pose."""
    scene = scene_of("planar-toy")
    robot = scene.robot
    path = np.array([[1.5, 0.5, 0.5], [1.6, 0.4, 0.6], [1.7, 0.3, 0.7]])
    found = MarginMeter(scene).of_path(path, planned=2)
    room = np.minimum(path[1:] - robot.lower_rad, robot.upper_rad - path[1:]).min()
    assert found.joint_margin_rad == pytest.approx(room)
    values = []
    for q in path[1:]:
        J = np.zeros((6, robot.dof))
        for k in range(robot.dof):
            step = np.eye(robot.dof)[k] * 1e-6
            T, U = scene.kinematics.forward_many(np.array([q - step, q + step]))
            J[:3, k] = (U[:3, 3] - T[:3, 3]) / 2e-6
            turn = U[:3, :3] @ T[:3, :3].T
            J[3:, k] = [
                (turn[2, 1] - turn[1, 2]) / 4e-6,
                (turn[0, 2] - turn[2, 0]) / 4e-6,
                (turn[1, 0] - turn[0, 1]) / 4e-6,
            ]
        values.append(np.linalg.svd(J, compute_uv=False)[-1])
    assert found.smallest_singular_value == pytest.approx(min(values), abs=1e-6)
