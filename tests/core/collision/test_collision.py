"""Collision checks, against geometry on paper and against brute force."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from reachmap._typing import FloatArray
from reachmap.cell.model.bin_parts import bin_parts
from reachmap.cell.model.shapes import sides
from reachmap.core.collision.bodies import build_geometry
from reachmap.core.collision.checker import LADDER_M
from tests.support.scenes import scene_of

POST_ANGLE = np.arcsin((0.01 + 0.01 + 0.002) / 0.06)


def test_a_link_beside_a_post_collides_up_to_the_tangent():
    """Link 1 of the toy arm touches the post exactly within the closed-form angle."""
    scene = scene_of("planar-toy")
    for angle in (POST_ANGLE - 1e-3, -POST_ANGLE + 1e-3, 0.0):
        assert not scene.checker.is_free(np.array([angle, 0.5, 0.5]))
    for angle in (POST_ANGLE + 1e-3, -POST_ANGLE - 1e-3, 2.0):
        assert scene.checker.is_free(np.array([angle, 0.5, 0.5]))


def test_the_blocking_pair_is_named():
    """A blocked configuration names the two bodies by the user's names."""
    scene = scene_of("planar-toy")
    pair = scene.checker.blocking_pair(np.array([0.0, 0.5, 0.5]))
    assert set(scene.checker.body_pairs[pair].split(" | ")) == {"link_1", "post"}
    assert scene.checker.blocking_pair(np.array([2.0, 0.5, 0.5])) == -1


def plain_free(scene, Q):
    """Collision without broad phase, proofs and ladder: all pairs, original meshes."""
    bodies = build_geometry(scene.robot, scene.loaded, with_bin=scene.with_bin)
    model, geometry = scene.robot.model, bodies.geometry
    data, placed = model.createData(), geometry.createData()
    for request in placed.collisionRequests:
        request.security_margin = scene.checker.safety_margin_m
    return np.array(
        [not pin.computeCollisions(model, data, geometry, placed, q, True) for q in Q]
    )


@pytest.mark.parametrize("name", ["ur5-eye-in-hand", "panda-eye-in-hand"])
def test_checks_agree_with_all_pairs_on_the_meshes(name):
    """Broad phase and proved pairs change no verdict on random configurations."""
    scene = scene_of(name)
    rng = np.random.default_rng(4)
    wide = rng.uniform(
        scene.robot.lower_rad, scene.robot.upper_rad, (700, scene.robot.dof)
    )
    near = scene.scan_configuration + rng.normal(0, 0.5, (700, scene.robot.dof))
    Q = np.vstack([wide, near])
    ours = scene.checker.free_mask(Q)
    np.testing.assert_array_equal(ours, plain_free(scene, Q))
    assert 0.02 < ours.mean() < 0.98


def test_pairs_proved_never_to_meet_do_not_meet():
    """No random configuration brings a pair together that was taken out by proof."""
    scene = scene_of("ur5-eye-in-hand")
    bodies = build_geometry(scene.robot, scene.loaded, with_bin=True)
    names, model = bodies.pair_names(), scene.robot.model
    data, placed = model.createData(), bodies.geometry.createData()
    proved = [k for k, name in enumerate(names) if name in scene.checker.proved_pairs]
    assert len(proved) >= 5
    rng = np.random.default_rng(5)
    for q in rng.uniform(scene.robot.lower_rad, scene.robot.upper_rad, (400, 6)):
        pin.updateGeometryPlacements(model, data, bodies.geometry, placed, q)
        assert not any(pin.computeCollision(bodies.geometry, placed, k) for k in proved)


def test_a_clear_configuration_stays_free_within_its_distance():
    """Motions by less than a proved distance never collide, on the meshes."""
    scene = scene_of("ur5-eye-in-hand")
    checker, rng = scene.checker, np.random.default_rng(6)
    moved: list[FloatArray] = []
    while len(moved) < 300:
        q = scene.scan_configuration + rng.normal(0, 0.6, 6)
        step = LADDER_M[int(rng.integers(len(LADDER_M)))]
        if checker.is_clear(q, step):
            change = rng.normal(size=6)
            moved.append(q + change * step / (np.abs(change) @ checker.reach_m))
    assert plain_free(scene, np.array(moved)).all()


def test_answers_do_not_depend_on_what_was_asked_before():
    """Not even where the last digit decides, and whatever else was asked between."""
    scene = scene_of("ur5-eye-in-hand")
    checker, rng = scene.checker, np.random.default_rng(7)
    Q = _on_the_brink(scene, rng, 60)
    first = checker.free_mask(Q)
    assert 0 < first.sum() < len(Q)
    for _ in range(4):
        for row in rng.permutation(len(Q)):
            assert bool(checker.touching_pairs(Q[row])) != first[row]
            assert checker.is_free(Q[row]) == first[row]


def _on_the_brink(scene, rng, count):
    """Free and colliding configurations that are neighbours to the last digits."""
    robot, is_free = scene.robot, scene.checker.is_free
    brink: list[FloatArray] = []
    while len(brink) < 2 * count:
        free = scene.scan_configuration
        touching = np.clip(free + rng.normal(size=6), robot.lower_rad, robot.upper_rad)
        if is_free(touching):
            continue
        for _ in range(55):
            middle = (free + touching) / 2
            if is_free(middle):
                free = middle
            else:
                touching = middle
        brink += [free, touching]
    return np.array(brink)


def test_the_bin_is_five_boxes_around_its_inner_volume():
    """Boxes fill the outer volume but for the inner one, and do not overlap."""
    spec = scene_of("ur5-eye-in-hand").loaded.cell.bin
    boxes = bin_parts(spec)
    x, y, depth = spec.inner
    wall_x, wall_y = spec.walls
    outer = (x + 2 * wall_x) * (y + 2 * wall_y) * (depth + spec.bottom_m)
    volume = sum(float(np.prod(sides(box.shape))) for box in boxes)
    assert volume == pytest.approx(outer - x * y * depth)
    rng = np.random.default_rng(8)
    points = rng.uniform([-x / 2, -y / 2, 0], [x / 2, y / 2, depth], (2000, 3))
    for box in boxes:
        inside = np.abs(points - box.centre_m) < sides(box.shape) / 2 - 1e-9
        assert not inside.all(axis=1).any()
