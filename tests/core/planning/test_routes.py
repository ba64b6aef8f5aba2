"""Routes around a disc, where the shortest way is two tangents and an arc."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.model.planner import RoadmapSpec
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.planning.routes import (
    RouteNetwork,
    shorten_until,
    spread_over,
)
from reachmap.core.planning.shortcut import settle
from reachmap.core.planning.timing import Pace, execution_time_s, path_length_rad
from reachmap.geometry import pieces

START, GOAL = np.array([-2.0, 0.0]), np.array([2.0, 0.0])
SHORTEST = 2 * np.sqrt(3) + np.pi / 3
SPEC = RoadmapSpec(ways=2, way_tries=60)


class PlaneWithDisc(MotionChecker):
    """Motions of a point in the plane that has to keep out of the unit disc."""

    def __init__(self):
        """Nothing to build."""

    @property
    def is_proof(self):
        """Distances are exact."""
        return True

    def is_verified(self, q_from, q_to):
        """Distance of a segment to the origin, in closed form."""
        change = q_to - q_from
        length_sq = change @ change
        along = 0.0 if length_sq == 0 else np.clip(-q_from @ change / length_sq, 0, 1)
        return bool(np.linalg.norm(q_from + along * change) >= 1.0)

    is_free = is_verified

    def path_is_free(self, path):
        """Whether no segment enters the disc."""
        return all(map(self.is_verified, path[:-1], path[1:]))


PLANE = PlaneWithDisc()
VELOCITY, ACCELERATION = np.array([2.0, 1.0]), np.array([3.0, 4.0])
PACE = Pace(velocity=VELOCITY, acceleration=ACCELERATION)
WIDE_FIRST = np.array([START, [-3, 3], [0, 1.3], [1.2, 0.7], GOAL])
WIDE_LAST = np.array([START, [-1.2, 0.7], [0, 1.3], [3, 3], GOAL])


def test_shortening_comes_near_the_shortest_way():
    """From a wide detour to within three percent of tangents and arc."""
    rng = np.random.default_rng(1)
    wide = np.array([START, [-3, 3], [3, 3], GOAL])
    short = shorten_until(wide, PLANE, rng, 0.002)
    assert PLANE.path_is_free(short)
    np.testing.assert_array_equal(short[[0, -1]], [START, GOAL])
    assert SHORTEST <= path_length_rad(short) < 1.03 * SHORTEST


def settled(seed):
    """A wide detour, shortened and then settled, with one seed."""
    rng = np.random.default_rng(seed)
    wide = np.array([START, [-3, 3], [3, 3], GOAL])
    short = shorten_until(wide, PLANE, rng, 0.002)
    return short, settle(short, PLANE.is_verified, PACE, rng, 0.002)


def test_settled_paths_agree():
    """Whatever the seed: free, never dearer, and with less spread than before."""
    found = [settled(seed) for seed in range(12)]
    cost = np.array([[PACE.of_path(path) for path in pair] for pair in found])
    assert all(PLANE.path_is_free(path) for _, path in found)
    assert all((path[[0, -1]] == [START, GOAL]).all() for _, path in found)
    assert (cost[:, 1] <= cost[:, 0] + 1e-9).all()
    assert cost[:, 1].std() < 0.8 * cost[:, 0].std()
    assert cost[:, 1].mean() < 0.95 * cost[:, 0].mean()


def test_the_settled_path_is_nearly_the_cheapest():
    """Brute force over all paths with one stop above the disc is hardly better."""
    side = np.linspace(-2, 2, 201)
    x, y = np.meshgrid(side, np.linspace(1, 3, 101))
    via = np.stack([x, y], axis=-1).reshape(-1, 2)
    cost = PACE.of_motions(via - START) + PACE.of_motions(GOAL - via)
    order = np.argsort(cost)
    best = next(cost[k] for k in order if PLANE.path_is_free([START, via[k], GOAL]))
    found = [PACE.of_path(settled(seed)[1]) for seed in range(12)]
    assert min(found) > 0.98 * best
    assert np.median(found) < 1.05 * best


def test_a_pace_is_time_and_length():
    """Stops count at corners, not at points on a straight line."""
    bent = np.array([START, [0.0, 2.0], [1.0, 1.0], GOAL])
    time_s = execution_time_s(bent, VELOCITY, ACCELERATION)
    expected = time_s + 0.5 * path_length_rad(bent)
    assert PACE.of_path(bent) == pytest.approx(expected)
    assert PACE.of_path(pieces(bent, 0.1)) == pytest.approx(expected)


def test_good_halves_of_two_routes_are_put_together():
    """The network's way is shorter than both routes: half of each."""
    assert PLANE.path_is_free(WIDE_FIRST)
    assert PLANE.path_is_free(WIDE_LAST)
    network = RouteNetwork.joined([WIDE_FIRST, WIDE_LAST], PACE, PLANE)
    ways = network.ways_to(GOAL[None], PLANE, SPEC)
    assert PLANE.path_is_free(ways[0])
    half = path_length_rad(WIDE_LAST[:3])
    assert path_length_rad(ways[0]) <= 2 * half + 1e-9
    assert path_length_rad(ways[0]) < 0.8 * path_length_rad(WIDE_FIRST)
    # Lengths and costs are those of the ways.
    for node in range(0, len(network.Q), 5):
        way = network.route_to(node)
        assert path_length_rad(way) == pytest.approx(network.length_rad[node])
        assert PACE.of_path(way) == pytest.approx(network.cost_s[node])
        assert PLANE.path_is_free(way)


def test_what_is_straight_is_taken_straight():
    """A goal in sight of the start gets one way of two points."""
    network = RouteNetwork.of([WIDE_FIRST, WIDE_LAST], PACE)
    ways = network.ways_to(np.array([[2.0, 0.0], [-2.0, 3.0]]), PLANE, SPEC)
    assert len(ways) == 1
    np.testing.assert_array_equal(ways[0], [START, [-2.0, 3.0]])


def test_a_goal_out_of_reach_has_no_way():
    """Nothing leads into the disc."""
    network = RouteNetwork.of([WIDE_FIRST], PACE)
    assert network.ways_to(np.array([[0.0, 0.0]]), PLANE, SPEC) == []


def test_pieces_keep_way_points_and_length():
    """Pieces are short, and the path is the same."""
    path = pieces(WIDE_FIRST, 0.3)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert steps.max() <= 0.3 + 1e-12
    assert steps.sum() == pytest.approx(path_length_rad(WIDE_FIRST))
    for corner in WIDE_FIRST:
        assert np.abs(path - corner).max(axis=1).min() < 1e-12


def test_spread_goals_leave_no_corner_out():
    """Four of five clusters' worth of picks hit each cluster once."""
    rng = np.random.default_rng(2)
    centres = np.array([[0, 0], [10, 0], [0, 10], [10, 10]], float)
    Q = np.vstack([centre + rng.normal(0, 0.1, (50, 2)) for centre in centres])
    assert sorted(spread_over(Q, 4) // 50) == [0, 1, 2, 3]
    assert len(spread_over(Q[:3], 9)) == 3
    assert len(spread_over(Q[:0], 4)) == 0
