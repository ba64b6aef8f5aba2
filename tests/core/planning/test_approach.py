"""Straight approaches: on their line, and not given up where joints move fast."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.planning.approach import StraightApproach
from reachmap.geometry import axis_vector, rotation_angle
from tests.support.scenes import scene_of

DISTANCE_M = 0.05


def approach_of(scene, distance_m=DISTANCE_M):
    """Approaches along the tool of a scene."""
    axis = scene.loaded.cell.robot.tcp.approach_axis
    return StraightApproach(
        scene.kinematics, scene.motions, axis_vector(axis), distance_m
    )


def deviation(scene, way, T_end, samples=9):
    """Furthest distance from the line [m] and turn [rad] between configurations."""
    shares = np.linspace(0, 1, samples)[:, None]
    Q = np.vstack(
        [a + shares * (b - a) for a, b in zip(way[:-1], way[1:], strict=True)]
    )
    T = scene.kinematics.forward_many(Q)
    offset = (T[:, :3, 3] - T_end[:3, 3]) @ T_end[:3, :3]
    aside = np.linalg.norm(offset[:, :2], axis=1)
    return aside.max(), rotation_angle(T[:, :3, :3], T_end[:3, :3]).max()


def grasps(scene, count):
    """Configurations of the UR5, every other one near the wrist's singularity."""
    rng = np.random.default_rng(3)
    robot = scene.robot
    Q = rng.uniform(robot.lower_rad, robot.upper_rad, (count, robot.dof)) / 2
    # Near the wrist's singularity joints turn fast along a straight line.
    Q[::2, 4] = rng.uniform(0.05, 0.15, len(Q[::2]))
    return Q


def test_between_way_points_the_tool_keeps_to_its_line():
    """A tenth of a millimetre and 0.05 degrees, at nine places of each motion."""
    scene = scene_of("ur5-eye-in-hand")
    approach = approach_of(scene)
    refined = 0
    for q in grasps(scene, 120):
        T = scene.kinematics.forward(q)
        way = approach.of(T, q)
        if way is None:
            continue
        straight = approach.straightened(way)
        assert straight is not None
        refined += len(straight) > len(way)
        aside, turn = deviation(scene, straight, T)
        assert aside <= 1.1e-4
        assert turn <= 1.1 * np.deg2rad(0.05)
        np.testing.assert_array_equal(straight[-1], q)
        np.testing.assert_allclose(straight[0], way[0])
    assert refined > 10


def test_fast_joints_are_followed_in_smaller_steps():
    """Where ten millimetres move a joint by more than 0.2 rad, the branch goes on."""
    scene = scene_of("ur5-eye-in-hand")
    approach, found = approach_of(scene), 0
    kinematics: Kinematics = scene.kinematics
    for q in grasps(scene, 300):
        T = kinematics.forward(q)
        way = approach.of(T, q)
        if way is None or np.abs(np.diff(way, axis=0)).max() < 1e-3:
            continue
        steps = np.linalg.norm(
            np.diff(kinematics.forward_many(way)[:, :3, 3], axis=0), axis=1
        )
        assert steps.sum() == pytest.approx(DISTANCE_M, abs=1e-5)
        assert np.abs(np.diff(way, axis=0)).max() <= 0.2 + 1e-9
        found += steps.min() < 0.006
    assert found > 3


def test_many_approaches_are_those_of_one_grasp_at_a_time():
    """Also where the branch ends, which is seen from the kinematics of its far end."""
    scene = scene_of("ur5-eye-in-hand")
    approach = approach_of(scene)
    rng = np.random.default_rng(4)
    # Stretched elbows: many a way back leads out of reach.
    Q = grasps(scene, 200)
    Q[100:, 2] = rng.uniform(-0.4, 0.4, 100)
    T = scene.kinematics.forward_many(Q)
    ways = approach.of_many(T, Q)
    alone = [approach.of(grasp, q) for grasp, q in zip(T, Q, strict=True)]
    assert [way is None for way in ways] == [way is None for way in alone]
    assert 20 < sum(way is None for way in ways) < 180
    for way, other in zip(ways, alone, strict=True):
        if way is not None and other is not None:
            np.testing.assert_allclose(way, other, atol=1e-3)


def test_ways_are_verified_together_as_one_by_one():
    """Ways through the cell, of one configuration and of several, free or not."""
    scene = scene_of("ur5-eye-in-hand")
    Q = grasps(scene, 120)
    found = approach_of(scene).of_many(scene.kinematics.forward_many(Q), Q)
    ways = [way for way in found if way is not None and scene.checker.is_free(way[-1])]
    ways[::7] = [way[-1:] for way in ways[::7]]
    together = scene.motions.ways_are_verified(ways)
    assert together.tolist() == [scene.motions.path_is_verified(way) for way in ways]
    assert 0 < together.sum() < len(ways)
    assert together[::7].all()


def test_a_branch_that_ends_is_no_approach():
    """The toy's arm cannot go back by more than it can stretch."""
    scene = scene_of("planar-toy")
    # Stretched to its full length inwards: straight back leads out of reach.
    q = np.array([1.0, 0.0, np.pi / 1.0001])
    T = scene.kinematics.forward(q)
    assert approach_of(scene, 0.4).of(T, q) is None
