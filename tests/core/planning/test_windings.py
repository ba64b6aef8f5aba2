"""Joints with more than a full turn, on an arm whose answer is known in closed form."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.cell.model.planner import RoadmapSpec
from reachmap.core.kinematics.windings import TURN_RAD, Windings
from reachmap.core.planning.candidates import NearestNeighbours
from reachmap.core.planning.connection import connect
from reachmap.core.planning.lazy_prm import LazySamples
from reachmap.core.planning.roadmap import Goals, Roadmap
from reachmap.core.scene import Scene
from reachmap.maps import Status
from reachmap.sampling.frames import approach_distance_m, bin_test_frames
from reachmap.scans.ik_survey import survey_frames
from reachmap.scans.workspace_roadmap import connect_survey
from tests.support.optional import present
from tests.support.roadmap_paths import path_to_frame

TOY = Path(__file__).parents[3] / "cells"
HARD = Path(__file__).parents[3] / "benchmarks" / "hard_cells"
UPPER_RAD = 4.5
POST_RAD = np.arcsin((0.01 + 0.01 + 0.002) / 0.06)


def toy_with_limits(folder, lower, upper):
    """The toy arm with other limits of its first joint."""
    text = (TOY / "planar-toy.yaml").read_text()
    urdf = (TOY / "planar-toy" / "planar_arm.urdf").read_text()
    limit = 'lower="-3.141592653589793" upper="3.141592653589793"'
    (folder / "planar-toy").mkdir()
    (folder / "planar-toy" / "planar_arm.urdf").write_text(
        urdf.replace(limit, f'lower="{lower}" upper="{upper}"', 1)
    )
    (folder / "toy.yaml").write_text(text)
    return Scene.build(read_cell(str(folder / "toy.yaml")))


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """First joint from -180 to 258 degrees: past the back, not round to the post."""
    return toy_with_limits(tmp_path_factory.mktemp("toy"), -np.pi, UPPER_RAD)


def test_what_lies_behind_the_post_is_reached_the_other_way_round(scene):
    """Exactly what is within the joint's range, a turn added, is reached."""
    rng = np.random.default_rng(1)
    Q = rng.uniform(-np.pi, np.pi, (400, 3))
    Q = Q[scene.checker.free_mask(Q)]
    wanted = (Q[:, 0] > 0) | (Q[:, 0] + TURN_RAD <= UPPER_RAD)
    assert 0.1 < wanted[Q[:, 0] < 0].mean() < 0.9
    spec = RoadmapSpec(max_checks=2000, samples=300, sample_checks=2000)
    goals = Goals.of(Q, np.arange(len(Q)))
    connection = connect(scene.scan_configuration, goals, scene.motions, spec, seed=1)
    np.testing.assert_array_equal(connection.roadmap.frame_reached, wanted)
    # The routes keep the limits and pass the verification.
    roadmap = connection.roadmap
    paths = roadmap.shortest_paths()
    nodes = roadmap.shortest_to_goals(paths)
    for goal in np.flatnonzero(wanted)[::23]:
        path = paths.path_to(int(nodes[goal]))
        assert (path >= scene.robot.lower_rad).all()
        assert (path <= scene.robot.upper_rad).all()
        assert scene.motions.path_is_verified(path)
        turns = (path[-1] - Q[goal]) / TURN_RAD
        np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)


def test_an_approach_keeps_its_goal_from_turning_too_far(scene):
    """A goal is only turned as far as its whole approach stays within the limits."""
    Q = np.array([[UPPER_RAD - TURN_RAD - 0.05, 1.0, 0.5]])
    room = np.array([[0.1, 0.0, 0.0]])
    spec = RoadmapSpec(max_checks=500, samples=100, sample_checks=500)
    for high, is_reached in ((Q, True), (Q + room, False)):
        goals = Goals(Q=Q, frame=np.array([0]), low=Q, high=high)
        found = connect(scene.scan_configuration, goals, scene.motions, spec, seed=1)
        assert found.roadmap.frame_reached[0] == is_reached


def first_joint_on(q, distances_m):
    """Joint 1 while the tool of the toy is drawn back, by trigonometry; None beyond."""
    yaw = q.sum()
    wrist = 0.4 * np.exp(1j * q[0]) + 0.2 * np.exp(1j * (q[0] + q[1]))
    p = wrist - np.asarray(distances_m) * np.exp(1j * yaw)
    cosine = (np.abs(p) ** 2 - 0.4**2 - 0.2**2) / (2 * 0.4 * 0.2)
    if (np.abs(cosine) > 0.99).any():
        return None
    elbow = np.sign(q[1]) * np.arccos(cosine)
    angle = np.angle(p) - np.angle(0.4 + 0.2 * np.exp(1j * elbow))
    return q[0] + (angle - q[0] + np.pi) % TURN_RAD - np.pi


def test_an_approach_across_a_limit_is_made_a_turn_further(tmp_path):
    """Where joint 1 would leave its range while the tool is drawn back, and only there.

    Else the turn that is nearest to the scan configuration is the goal.
    """
    lower = -1.9
    scene = toy_with_limits(tmp_path, lower, lower + TURN_RAD + 0.5)
    rng = np.random.default_rng(5)
    bend = rng.uniform(0.6, 2.2, 200) * rng.choice([-1, 1], 200)
    Q = np.column_stack(
        [rng.uniform(lower, lower + 0.2, 200), bend, rng.uniform(-0.8, 0.8, 200)]
    )
    survey = survey_frames(scene, scene.kinematics.forward_many(Q), 0.05)
    across = seen = 0
    for k, q in enumerate(Q):
        way = first_joint_on(q, np.linspace(0.0, 0.05, 51))
        if way is None or abs(way.min() - lower) < 1e-3:
            continue
        turn = TURN_RAD if way.min() < lower else 0.0
        grasps = survey.grasps[survey.goals_of(k)]
        same_elbow = grasps[np.sign(grasps[:, 1]) == np.sign(q[1])]
        np.testing.assert_allclose(
            same_elbow, [q + np.array([turn, 0.0, 0.0])], atol=1e-6
        )
        across, seen = across + (turn > 0), seen + 1
    assert 0.1 < across / seen < 0.9


def test_samples_alone_lead_out_the_other_way_round(scene):
    """Each goal behind the post is met after a whole turn, over verified motions."""
    rng = np.random.default_rng(3)
    robot, motions = scene.robot, scene.motions
    low, high = np.array([-3.1, -2.0, -2.0]), np.array([UPPER_RAD - TURN_RAD, 2, 2])
    spec = RoadmapSpec(samples=600)
    Q = rng.uniform(low, high, (12, 3))
    for q in Q[scene.checker.free_mask(Q)]:
        roadmap = Roadmap.of(scene.scan_configuration, Goals.of(q[None], np.array([0])))
        samples = LazySamples(roadmap, motions, Windings(robot), spec, rng)
        way = present(samples.way_out(np.array([1]), 20000))
        assert way.turns.tolist() == [1, 0, 0]
        assert (way.node, way.goal_node) == (0, 1)
        np.testing.assert_array_equal(way.path[0], scene.scan_configuration)
        np.testing.assert_allclose(
            way.path[-1], q + np.array([TURN_RAD, 0, 0]), atol=1e-12
        )
        assert (way.path >= robot.lower_rad).all()
        assert (way.path <= robot.upper_rad).all()
        assert motions.path_is_verified(way.path)


def test_turns_come_nearest_first_and_completely(scene):
    """The order is that of sorting all combinations, by brute force."""
    robot = scene.robot
    windings = Windings(robot)
    assert windings.turns.tolist() == [True, False, False]
    q_goal, q = np.array([-2.5, 0.3, 0.4]), scene.scan_configuration
    found = list(windings.in_order(q_goal, q, q_goal, q_goal))
    combinations = itertools.product((-1, 0, 1), repeat=3)
    turned = [(q_goal + TURN_RAD * np.array(k), k) for k in combinations]
    inside = [
        (float(np.linalg.norm(r - q)), k)
        for r, k in turned
        if (r >= robot.lower_rad).all() and (r <= robot.upper_rad).all()
    ]
    assert [k for _, k in found] == [k for _, k in sorted(inside)]
    assert [d for d, _ in found] == pytest.approx([d for d, _ in sorted(inside)])


def test_neighbours_are_near_whatever_the_turns(scene):
    """Distances are those of the nearest turn, by brute force."""
    rng = np.random.default_rng(2)
    Q = rng.uniform(scene.robot.lower_rad, scene.robot.upper_rad, (60, 3))
    weight, windings = np.array([0.9, 0.5, 0.1]), Windings(scene.robot)
    distance, row = NearestNeighbours(Q, weight, windings).of(Q, 5)
    change = Q[:, None] - Q[None]
    change[..., 0] -= TURN_RAD * np.round(change[..., 0] / TURN_RAD)
    wanted = np.sort(np.linalg.norm(change * weight, axis=2), axis=1)[:, :5]
    np.testing.assert_allclose(distance, wanted, atol=1e-12)
    assert (row[:, 0] == np.arange(60)).all()


def test_an_arm_without_further_turns_is_left_alone():
    """Limits of exactly one turn leave no choice."""
    windings = Windings(Scene.build(read_cell("planar-toy")).robot)
    assert not windings.exist
    Q = np.array([[3.0, -3.0, 1.0]])
    assert not windings.nearest(Q, np.array([-3.0, 3.0, 0.0])).any()


@pytest.mark.slow
def test_a_real_arm_swings_round_its_back():
    """Every test grasp behind the wall is reached, by paths within the limits."""
    scene = Scene.build(read_cell(str(HARD / "winding-ur10.yaml")))
    cell = scene.loaded.cell
    grid = bin_test_frames(cell, scene.T_base_bin).frames
    T = grid.transforms_at(np.arange(grid.size))
    survey = survey_frames(scene, T, approach_distance_m(cell))
    with_goals = np.flatnonzero(survey.status == Status.NOT_ATTEMPTED)
    assert len(with_goals) == 382
    connection = connect_survey(scene, survey, seed=1)
    np.testing.assert_array_equal(connection.roadmap.frames_reached(), with_goals)
    for frame in with_goals[::40]:
        path = path_to_frame(survey, connection, int(frame))
        assert path is not None
        assert (path >= scene.robot.lower_rad).all()
        assert (path <= scene.robot.upper_rad).all()
        np.testing.assert_array_equal(path[0], scene.scan_configuration)
        T_end = scene.kinematics.forward(path[-1])
        back = T[frame][:3, 3] - 0.05 * T[frame][:3, 2]
        np.testing.assert_allclose(T_end[:3, 3], back, atol=1e-5)
