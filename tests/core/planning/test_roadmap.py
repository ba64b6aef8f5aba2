"""The roadmap method, on an arm whose answer is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.model.planner import RoadmapSpec
from reachmap.core.kinematics.windings import Windings
from reachmap.core.planning.candidates import CandidateMotions, UnionFind
from reachmap.core.planning.connection import connect
from reachmap.core.planning.roadmap import Goals
from tests.support.scenes import scene_of

SMALL = RoadmapSpec(max_checks=2000, samples=300, sample_checks=2000)


def connection_of(scene, goals, frame, seed=1, spec=SMALL):
    """Connect goals to the scan configuration of a scene."""
    goals = Goals.of(goals, frame)
    return connect(scene.scan_configuration, goals, scene.motions, spec, seed=seed)


def nodes_reached(connection):
    """Which goals are reached as they stand."""
    reached = np.zeros(len(connection.roadmap.goals.frame) + 1, bool)
    nodes = np.array(connection.roadmap.reached)
    reached[nodes[nodes < len(reached)]] = True
    return reached[1:]


def toy_goals(scene, count, seed):
    """Free configurations of the toy arm, and whether they are on the start's side."""
    rng = np.random.default_rng(seed)
    Q = rng.uniform(-3.1, 3.1, (count, 3))
    Q = Q[scene.checker.free_mask(Q)]
    # The post splits joint 1 at 0; at ±π the joint ends.
    return Q, Q[:, 0] > 0


@pytest.mark.parametrize("count", [60, 600])
def test_the_two_halves_of_the_toy_are_told_apart(count):
    """Exactly the configurations on the start's side of the post are connected."""
    scene = scene_of("planar-toy")
    Q, same_side = toy_goals(scene, count, 3)
    connection = connection_of(scene, Q, np.arange(len(Q)))
    np.testing.assert_array_equal(nodes_reached(connection), same_side)
    assert (connection.attempts >= connection.reached).all()
    # What is behind the post is open, with what each method spent on it.
    behind = connection.component[~same_side]
    assert not connection.reached[behind].any()
    assert connection.agreed.all()
    spent = dict(zip(connection.methods, connection.checks[behind].T, strict=True))
    assert set(connection.methods) == {"straight", "LBKPIECE1", "RRTConnect", "samples"}
    for name, checks in spent.items():
        assert (checks > 0).all(), name


def test_routes_run_over_verified_motions():
    """Each route starts at the scan configuration, is verified, and as long as said."""
    scene = scene_of("planar-toy")
    Q, same_side = toy_goals(scene, 300, 4)
    connection = connection_of(scene, Q, np.arange(len(Q)))
    paths = connection.roadmap.shortest_paths()
    for goal in np.flatnonzero(same_side)[::17]:
        path = paths.path_to(int(goal) + 1)
        np.testing.assert_array_equal(path[0], scene.scan_configuration)
        np.testing.assert_array_equal(path[-1], Q[goal])
        assert scene.motions.path_is_verified(path)
        length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        assert length == pytest.approx(paths.length_rad[goal + 1])
    assert np.isinf(paths.length_rad[1:][~same_side][: len(Q)]).all()


def test_a_frame_is_reached_by_any_of_its_goals():
    """A frame with goals on both sides is reached; one with goals behind is not."""
    scene = scene_of("planar-toy")
    Q = np.array([[1.0, 0, 0], [-1.0, 0, 0], [-2.0, 0.5, 0]])
    connection = connection_of(scene, Q, np.array([0, 0, 1]))
    np.testing.assert_array_equal(connection.roadmap.frames_reached(), [0])
    labels = connection.component
    assert connection.reached[labels[0]]
    assert not connection.reached[labels[2]]
    assert connection.attempts[labels[2]] > 2


def test_the_roadmap_is_repeatable():
    """The same seed gives the same edges."""
    scene = scene_of("ur5-eye-in-hand")
    rng = np.random.default_rng(5)
    Q = scene.scan_configuration + rng.normal(0, 0.7, (400, 6))
    Q = np.clip(Q, scene.robot.lower_rad, scene.robot.upper_rad)
    Q = Q[scene.checker.free_mask(Q)]
    first = connection_of(scene, Q, np.arange(len(Q)))
    second = connection_of(scene, Q, np.arange(len(Q)))
    assert first.roadmap.edges == second.roadmap.edges
    np.testing.assert_array_equal(first.component, second.component)


def test_no_goals_is_no_frames():
    """A scan in which nothing has a goal ends with nothing reached."""
    scene = scene_of("planar-toy")
    connection = connection_of(scene, np.zeros((0, 3)), np.zeros(0, np.int64))
    assert len(connection.roadmap.frames_reached()) == 0


def test_candidates_are_the_nearest_neighbours():
    """Each configuration is a candidate of its nearest neighbours, by brute force."""
    rng = np.random.default_rng(6)
    Q, weight = rng.normal(size=(80, 3)) * 0.5, np.array([1.0, 0.5, 0.2])
    no_turns = Windings(scene_of("planar-toy").robot)
    graph = CandidateMotions.of(Q, weight, no_turns, RoadmapSpec(neighbours=4))
    distance = np.linalg.norm((Q[:, None] - Q[None]) * weight, axis=2)
    for k in range(1, len(Q)):
        nearest = set(np.argsort(distance[k])[1:5].tolist())
        near = {n for n in nearest if np.abs(Q[n] - Q[k]).max() <= 2.2}
        assert near <= set(graph.node[graph.begin[k] : graph.begin[k + 1]].tolist())


def test_union_find_agrees_with_flooding():
    """Sets of random joins are the components found by flooding."""
    rng = np.random.default_rng(7)
    pairs = rng.integers(0, 50, (40, 2))
    sets = UnionFind(50)
    for a, b in pairs.tolist():
        sets.join(a, b)
    label = np.arange(50)
    for _ in range(50):
        for a, b in pairs:
            label[[a, b]] = min(label[a], label[b])
    same = label[:, None] == label[None]
    ours = np.array([sets.find(k) for k in range(50)])
    np.testing.assert_array_equal(ours[:, None] == ours[None], same)
