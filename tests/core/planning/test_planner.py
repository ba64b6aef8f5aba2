"""Plans: verified, repeatable, and honest about failure."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.model.planner import PlannerSpec, SimplificationSpec
from reachmap.core.planning.planner import Planner
from reachmap.core.planning.shortcut import (
    cut_corners,
    end_at_nearer_goal,
    shorten,
    skip_waypoints,
)
from reachmap.core.planning.timing import path_length_rad
from reachmap.sampling.frames import bin_test_frames
from reachmap.scans.ik_survey import survey_frames
from tests.support.dense_checks import dense_free
from tests.support.scenes import scene_of


def planner_of(scene, **spec):
    """Planner of a scene with other settings; it searches unless told otherwise."""
    settings = PlannerSpec(**{"straight_first": False, **spec})
    return Planner(scene.motions, settings)


def bin_goals(scene, count):
    """Goal sets of test grasps in the scene's bin."""
    cell = scene.loaded.cell
    grid = bin_test_frames(cell, scene.T_base_bin).frames
    rows = np.random.default_rng(1).permutation(grid.size)[: 6 * count]
    survey = survey_frames(scene, grid.transforms_at(rows), 0.0)
    sets = [survey.goals[survey.goals_of(k)] for k in range(len(rows))]
    return [goals for goals in sets if len(goals)][:count]


def test_paths_into_the_bin_are_free_on_the_meshes():
    """Paths start at the scan configuration, end at a goal and never collide."""
    scene = scene_of("ur5-eye-in-hand")
    found = 0
    for seed, goals in enumerate(bin_goals(scene, 6)):
        plan = scene.planner.plan(scene.scan_configuration, goals, seed)
        if plan.path is None:
            continue
        found += 1
        np.testing.assert_array_equal(plan.path[0], scene.scan_configuration)
        np.testing.assert_array_equal(plan.path[-1], goals[plan.goal])
        for q_from, q_to in zip(plan.path[:-1], plan.path[1:], strict=True):
            assert dense_free(scene, q_from, q_to, margin_m=0.0)
    assert found >= 4


def test_a_seed_is_a_path():
    """A seed gives the same path, also after other work; another seed differs."""
    scene = scene_of("ur5-eye-in-hand")
    goals = bin_goals(scene, 1)[0]
    start = scene.scan_configuration
    planner = planner_of(scene)
    first = planner.plan(start, goals, 7)
    planner.plan(start, goals, 8)
    again = planner.plan(start, goals, 7)
    np.testing.assert_array_equal(first.path, again.path)
    assert first.checks == again.checks
    assert first.checks != planner.plan(start, goals, 9).checks


def test_a_free_straight_motion_is_the_path():
    """To the nearest goal, whatever the seed: no path to any goal is shorter."""
    scene = scene_of("ur5-eye-in-hand")
    start, straight = scene.scan_configuration, 0
    for goals in bin_goals(scene, 8):
        distance = np.linalg.norm(goals - start, axis=1)
        nearest = goals[np.argmin(distance)]
        plans = [scene.planner.plan(start, goals, seed) for seed in (1, 2)]
        if not scene.motions.path_is_verified(np.array([start, nearest])):
            continue
        straight += 1
        for plan in plans:
            np.testing.assert_array_equal(plan.path, [start, nearest])
        searched = planner_of(scene).plan(start, goals, 1)
        assert path_length_rad(searched.path) >= distance.min() - 1e-9
    assert straight >= 4


def test_where_the_straight_motion_is_blocked_the_search_decides():
    """Between configurations with something in between: as without the motion."""
    scene = scene_of("ur5-eye-in-hand")
    start, blocked = scene.scan_configuration, 0
    rng = np.random.default_rng(4)
    for q in rng.uniform(scene.robot.lower_rad, scene.robot.upper_rad, (400, 6)):
        goal = start + 0.5 * (q - start)
        if not scene.checker.is_free(goal) or scene.motions.is_free(start, goal):
            continue
        first = scene.planner.plan(start, goal[None], 5)
        search = planner_of(scene).plan(start, goal[None], 5)
        np.testing.assert_array_equal(first.path, search.path)
        assert first.checks > search.checks
        blocked += search.path is not None
        if blocked == 3:
            return
    pytest.fail("no blocked straight motion was found")


def test_the_unreachable_half_of_the_toy_is_not_reached():
    """Goals behind the post cost the budget in checks and give no path."""
    scene = scene_of("planar-toy")
    behind = np.array([[-1.0, 0.5, 0.5]])
    plan = scene.planner.plan(scene.scan_configuration, behind, 1, max_checks=3000)
    assert plan.path is None
    assert plan.goal == -1
    assert 3000 <= plan.checks < 3400
    assert not plan.hit_time_limit


def test_the_safety_net_is_recorded():
    """A limit in seconds that strikes is told apart from a spent budget."""
    scene = scene_of("planar-toy")
    planner = planner_of(scene, time_limit_s=0.05, max_checks=10**9)
    plan = planner.plan(scene.scan_configuration, np.array([[-1.0, 0.5, 0.5]]), 1)
    assert plan.path is None
    assert plan.hit_time_limit


def test_a_search_begun_anew_still_ends_and_is_counted_whole():
    """Searches of 1, 2, 4, … checks find a path; the attempt counts all of them."""
    scene = scene_of("ur5-eye-in-hand")
    goals, start = bin_goals(scene, 1)[0], scene.scan_configuration
    at_once = planner_of(scene, restart_checks=None).plan(start, goals, 7)
    never_reached = planner_of(scene, restart_checks=20000).plan(start, goals, 7)
    np.testing.assert_array_equal(never_reached.path, at_once.path)
    assert never_reached.checks == at_once.checks
    anew = planner_of(scene, restart_checks=1).plan(start, goals, 7)
    assert scene.motions.path_is_verified(anew.path)
    assert anew.checks > at_once.checks / 2


def test_beginning_anew_cuts_the_tail():
    """The unluckiest of many attempts cost less when searches are begun anew."""
    scene = scene_of("ur5-eye-in-hand")
    start, sets = scene.scan_configuration, bin_goals(scene, 12)

    def checks(**spec):
        planner = planner_of(scene, **spec)
        return np.array(
            [planner.plan(start, g, seed).checks for g in sets for seed in range(30)]
        )

    through, anew = checks(restart_checks=None), checks()
    assert np.quantile(anew, 0.99) < np.quantile(through, 0.99)
    assert anew.mean() < 1.05 * through.mean()


def test_no_goals_is_no_path():
    """An empty set of goals is answered at once."""
    scene = scene_of("planar-toy")
    plan = scene.planner.plan(scene.scan_configuration, np.zeros((0, 3)), 1)
    assert plan.path is None
    assert plan.checks == 0


def test_goals_outside_the_limits_are_not_waited_for():
    """Goals that no joint may take end the attempt by a count, not by the clock."""
    scene = scene_of("planar-toy")
    outside = np.array([[4.0, 0.0, 0.0]])
    plan = scene.planner.plan(scene.scan_configuration, outside, 1, max_checks=100)
    assert plan.path is None
    assert not plan.hit_time_limit
    both = np.vstack([outside, [[1.5, 0.2, 0.0]]])
    assert scene.planner.plan(scene.scan_configuration, both, 1).goal == 1


def test_goals_in_collision_are_not_waited_for():
    """OMPL would wait for other goals; nothing is spent where there are none."""
    scene = scene_of("planar-toy")
    Q = np.random.default_rng(0).uniform(-1.5, 1.5, (400, 3))
    blocked = Q[~scene.checker.free_mask(Q)][:3]
    assert len(blocked) == 3
    for name in ("RRTConnect", "LBKPIECE1"):
        planner = planner_of(scene, name=name, straight_first=False)
        plan = planner.plan(scene.scan_configuration, blocked, 1)
        assert plan.path is None
        assert plan.checks < 20
        assert not plan.hit_time_limit
        both = np.vstack([blocked, [[1.5, 0.2, 0.0]]])
        assert planner.plan(scene.scan_configuration, both, 1).goal == 3


@pytest.mark.parametrize(
    "name",
    [
        "LBKPIECE1",
        "BKPIECE1",
        "KPIECE1",
        "RRTConnect",
        "RRT",
        "RRTstar",
        "InformedRRTstar",
        "SORRTstar",
        "BITstar",
        "FMT",
        "BFMT",
        "AORRTC",
    ],
)
def test_every_planner_solves_the_toy(name):
    """Planners by name find a verified path between free configurations."""
    scene = scene_of("planar-toy")
    goal = np.array([[2.5, -1.0, 1.0]])
    planner = planner_of(scene, name=name, max_checks=20000)
    plan = planner.plan(scene.scan_configuration, goal, 3)
    assert plan.path is not None
    assert scene.motions.path_is_verified(plan.path)


@pytest.mark.parametrize("method", ["shortcut", "simplify_max", "none"])
def test_simplification_keeps_ends_and_verifies(method):
    """Whatever the method, the path is verified; shortened ones are shorter."""
    scene = scene_of("ur5-eye-in-hand")
    goals = bin_goals(scene, 1)[0]
    spec = SimplificationSpec(method=method)
    planner = planner_of(scene, simplification=spec)
    plan = planner.plan(scene.scan_configuration, goals, 5)
    assert plan.path is not None
    assert scene.motions.path_is_verified(plan.path)
    if method != "none":
        raw = planner_of(scene, simplification=SimplificationSpec(method="none"))
        long = raw.plan(scene.scan_configuration, goals, 5)
        assert path_length_rad(plan.path) < path_length_rad(long.path)


def around_a_disc(q_from, q_to):
    """Whether a segment in the plane keeps out of the unit disc, in closed form."""
    change = q_to - q_from
    share = np.clip(-(q_from @ change) / max(change @ change, 1e-12), 0, 1)
    return float(np.linalg.norm(q_from + share * change)) > 1.0


def test_shortening_goes_towards_the_tangents():
    """Around a disc, shortening comes near the shortest path known in closed form."""
    start, end = np.array([-2.0, 0.0]), np.array([2.0, 0.0])
    zigzag = np.array([start, [-2, 3], [0, 1.5], [0.5, 4], [2, 2], end])
    best = 2 * (np.sqrt(3.0) + np.pi / 6)
    short = shorten(zigzag, around_a_disc, tries=400, rng=np.random.default_rng(1))
    assert path_length_rad(short) < 1.05 * best
    assert path_length_rad(short) >= best - 1e-9
    assert all(around_a_disc(a, b) for a, b in zip(short[:-1], short[1:], strict=True))
    np.testing.assert_array_equal(short[[0, -1]], [start, end])


def test_a_path_ends_at_the_goal_of_the_shortest_way():
    """Of all ways along the path and straight to a goal, the shortest free one wins."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        path, goals = rng.normal(size=(5, 2)), rng.normal(size=(6, 2))
        path[-1] = goals[0]

        def is_free(a, b):
            return bool((a + b)[0] > -0.5)

        arc = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
        ways = [
            arc[k] + np.linalg.norm(goal - path[k])
            for k in range(4)
            for goal in goals
            if is_free(path[k], goal)
        ]
        short = end_at_nearer_goal(path, goals, is_free)
        length = np.linalg.norm(np.diff(short, axis=0), axis=1).sum()
        assert length == pytest.approx(min([arc[-1], *ways]), abs=2e-3)
        assert (short[-1] == goals).all(axis=1).any()
        np.testing.assert_array_equal(short[0], path[0])


def test_attempts_at_a_choice_of_goals_are_much_alike():
    """In free space every attempt ends at the nearest goal, straight."""
    scene = scene_of("planar-toy", with_bin=False)
    goals = np.array([[0.5, 0.1, 0.0], [0.3, 0.3, 0.3], [-0.4, 0.0, 0.6]])
    goals = scene.scan_configuration + goals[:, : scene.robot.dof]
    free = np.array([scene.checker.is_free(q) for q in goals])
    goals = goals[free]
    planner = planner_of(scene)
    nearest = np.linalg.norm(goals - scene.scan_configuration, axis=1).min()
    for seed in range(1, 6):
        result = planner.plan(scene.scan_configuration, goals, seed)
        assert path_length_rad(result.path) == pytest.approx(nearest, abs=2e-3)


def test_shortening_never_lengthens():
    """Cutting corners and skipping waypoints shorten or change nothing."""
    rng = np.random.default_rng(2)
    for _ in range(30):
        path = rng.normal(size=(8, 3))
        some = shorten(path, lambda a, b: bool((a - b).sum() > 0), tries=20, rng=rng)
        assert path_length_rad(some) <= path_length_rad(path) + 1e-9
    blocked = cut_corners(path, lambda a, b: False, tries=20, rng=rng)
    np.testing.assert_array_equal(blocked, path)
    np.testing.assert_array_equal(skip_waypoints(path, lambda a, b: False), path)
