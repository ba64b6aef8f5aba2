"""Time laws against closed forms, integration and other libraries."""

from __future__ import annotations

import numpy as np
import pytest
import ruckig

from reachmap.cell.loading import read_cell
from reachmap.core.planning.time_laws import double_s
from reachmap.core.planning.time_laws.corners import (
    BlendedPath,
    blended,
    blended_time_s,
)
from reachmap.core.planning.time_laws.optimal import optimal_time_s, optimal_way_time_s
from reachmap.core.planning.timing import execution_time_s, smooth_way_time_s
from reachmap.errors import SceneError
from tests.support.scenes import scene_of


def by_ruckig(change, v, a, j):
    """Time of a straight motion, all joints in proportion, by Ruckig.

    The share of the way is one axis, whose limits are those of the slowest joint.
    """
    wanted, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
    wanted.current_position, wanted.target_position = [0.0], [1.0]
    size = np.abs(change)
    wanted.max_velocity = [(v / size).min()]
    wanted.max_acceleration = [(a / size).min()]
    wanted.max_jerk = [(j / size).min()]
    assert ruckig.Ruckig(1).calculate(wanted, found) == ruckig.Result.Working
    return found.duration


def test_a_double_s_takes_as_long_as_ruckig_says():
    """Every case of the closed form, from short hops to long cruises."""
    rng = np.random.default_rng(3)
    for size in (1e-3, 0.05, 0.5, 5.0, 50.0):
        for _ in range(20):
            change = size * rng.normal(size=3)
            v, a = rng.uniform(0.5, 3, 3), rng.uniform(1, 10, 3)
            j = rng.uniform(5, 200, 3)
            path = np.array([np.zeros(3), change])
            got = double_s.polyline_time_s(path, v, a, j)
            assert got == pytest.approx(by_ruckig(change, v, a, j), rel=1e-6)


def test_double_s_of_one_joint_by_hand():
    """2 rad at 1 rad/s, 2 rad/s² and 8 rad/s³: d/v + v/a + a/j = 2 + 0.5 + 0.25 s."""
    assert double_s.double_s_time_s(2.0, 1.0, 2.0, 8.0) == pytest.approx(2.75)


def test_without_a_limit_on_jerk_the_double_s_is_a_trapezoid():
    """As the jerk grows, the time falls to that of the trapezoid and not below."""
    path = np.array([[0.0, 0.0], [1.0, -0.4], [1.2, 0.7]])
    v, a = np.array([1.0, 2.0]), np.array([3.0, 2.5])
    plain = execution_time_s(path, v, a)
    for jerk, rel in ((50.0, 0.1), (1e7, 1e-5)):
        slow = double_s.polyline_time_s(path, v, a, np.full(2, jerk))
        assert plain < slow < plain * (1 + rel)


def bent_way(n=40):
    """A smooth curve in three joints."""
    t = np.linspace(0.0, 1.0, n)
    return np.column_stack([np.sin(t), t**2, 0.3 * np.cos(3 * t)])


def test_a_smooth_way_with_limited_jerk_keeps_its_limits():
    """Never faster than without a limit on jerk; near it where jerk hardly limits."""
    v, a = np.full(3, 1.0), np.full(3, 2.0)
    optimum = smooth_way_time_s(bent_way(), v, a)
    for jerk in (20.0, 1e6):
        assert double_s.smooth_way_time_s(bent_way(), v, a, np.full(3, jerk)) > optimum
    straight = np.linspace(0.0, 1.0, 30)[:, None] * np.array([0.5, -1.0, 0.2])
    j = np.full(3, 30.0)
    assert double_s.smooth_way_time_s(straight, v, a, j) == pytest.approx(
        double_s.polyline_time_s(straight[[0, -1]], v, a, j), rel=1e-3
    )


def right_angle(d):
    """Two joints, one after the other over 1 rad, blended d before and after."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    return BlendedPath(corners=corners, blend=np.array([0.0, d, 0.0]))


def test_one_blended_corner_by_hand():
    """Equal limits v and a: the corner is passed at √(2ad), the rest is trapezoids."""
    v, a, d = np.full(2, 10.0), np.full(2, 2.0), 0.2
    corner = np.sqrt(2 * 2.0 * d)
    # From rest over 0.8 rad to the corner's speed: the top is above it, then it brakes.
    peak = np.sqrt(corner**2 / 2 + 2.0 * 0.8)
    ramp = (2 * peak - corner) / 2.0
    expected = 2 * ramp + 2 * d / corner
    assert blended_time_s(right_angle(d), v, a) == pytest.approx(expected)
    slow = np.full(2, 0.5)  # cruises at 0.5 rad/s all the way: d/v + v/a
    assert blended_time_s(right_angle(d), slow, a) == pytest.approx(2 / 0.5 + 0.25)


def integrated(path, v, a, dt=1e-4):
    """Whether the law's motion keeps to its limits: sampled accelerations at corners.

    Along a blend run in its time T the acceleration is 2 (out - 2 corner + in)/T².
    """
    into, corner, out = path.parabola(1)
    d = path.blend[1]
    speed = min(
        np.sqrt(2 * d * (a / np.abs(out - 2 * corner + into) * d).min()), v.min()
    )
    T = 2 * d / speed
    t = np.arange(0.0, 1.0, dt)[:, None]
    q = (1 - t) ** 2 * into + 2 * t * (1 - t) * corner + t**2 * out
    return np.diff(q, n=2, axis=0) / (dt * T) ** 2


def test_a_blend_keeps_to_the_accelerations():
    """Second differences of the parabola, run in its time, are just at the limit."""
    v, a = np.full(2, 10.0), np.array([2.0, 1.0])
    sampled = np.abs(integrated(right_angle(0.2), v, a))
    assert (sampled <= a + 1e-3).all()
    assert (sampled / a).max() == pytest.approx(1.0, abs=1e-3)


def random_blends(rng, n=5, dof=4):
    """A polyline with corners blended at random, some not at all."""
    corners = rng.normal(size=(n, dof))
    length = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    share = rng.choice([0.0, 0.1, 0.25, 0.5], n - 2)
    inner = share * np.minimum(length[:-1], length[1:])
    return BlendedPath(corners=corners, blend=np.concatenate([[0], inner, [0]]))


def test_even_blends_are_no_faster_than_the_optimum_along_them():
    """Along one curve toppra is faster, and without blends it is as fast as stops."""
    rng = np.random.default_rng(11)
    for _ in range(12):
        path = random_blends(rng)
        v, a = rng.uniform(0.5, 3, 4), rng.uniform(1, 8, 4)
        best = optimal_time_s(path, v, a)
        assert best <= 1.005 * blended_time_s(path, v, a)
        stops = BlendedPath(corners=path.corners, blend=np.zeros(5))
        exact = execution_time_s(path.corners, v, a)
        assert blended_time_s(stops, v, a) == pytest.approx(exact)
        assert optimal_time_s(stops, v, a) == pytest.approx(exact, rel=3e-3)


def test_toppra_on_a_straight_line_is_the_trapezoid():
    """One segment has nothing to blend; the optimum is the closed form."""
    rng = np.random.default_rng(2)
    for size in (0.05, 0.6, 4.0):
        corners = np.array([np.zeros(3), size * rng.normal(size=3)])
        v, a = rng.uniform(0.5, 3, 3), rng.uniform(1, 8, 3)
        path = BlendedPath(corners=corners, blend=np.zeros(2))
        assert optimal_time_s(path, v, a) == pytest.approx(
            execution_time_s(corners, v, a), rel=2e-3
        )


def test_toppra_on_a_smooth_way_agrees_with_the_phase_plane():
    """Two implementations of one optimum."""
    v, a = np.array([1.0, 0.8, 2.0]), np.array([2.0, 3.0, 1.5])
    assert optimal_way_time_s(bent_way(), v, a) == pytest.approx(
        smooth_way_time_s(bent_way(), v, a), rel=0.015
    )


def winding_paths(scene, count):
    """Polylines of verified motions around the scan configuration."""
    rng = np.random.default_rng(5)
    paths: list[np.ndarray] = []
    while len(paths) < count:
        path = scene.scan_configuration + rng.normal(0, 0.4, (4, scene.robot.dof))
        if scene.motions.path_is_verified(path):
            paths.append(path)
    return paths


def test_blends_are_verified_and_save_time():
    """Each blend is free at a third of the verification distance; stops are slower."""
    scene = scene_of("ur5-eye-in-hand")
    robot = scene.robot
    limits = robot.velocity_rad_s, robot.acceleration_rad_s2
    third_m = scene.motions.verification_distance_m / 3
    blends = 0
    for path in winding_paths(scene, 12):
        found = blended(path, scene.motions, *limits)
        assert blended_time_s(found, *limits) <= execution_time_s(path, *limits) + 1e-9
        for k in np.flatnonzero(found.blend).tolist():
            blends += 1
            a, b, c = found.parabola(k)
            size = float((np.abs(b - a) + np.abs(c - b)) @ scene.checker.reach_m)
            t = np.linspace(0, 1, 2 + int(size / third_m))[:, None]
            curve = (1 - t) ** 2 * a + 2 * t * (1 - t) * b + t**2 * c
            assert scene.checker.free_mask(curve).all()
    assert blends >= 12


def test_a_parabola_through_a_body_is_refused():
    """No parabola verifies that is in collision anywhere; others mostly do."""
    scene = scene_of("ur5-eye-in-hand")
    rng = np.random.default_rng(8)
    blocked = verified = 0
    t = np.linspace(0, 1, 200)[:, None]
    for a, b, c in rng.normal(0, 0.7, (80, 3, 6)) + scene.scan_configuration:
        curve = (1 - t) ** 2 * a + 2 * t * (1 - t) * b + t**2 * c
        passed = scene.motions.parabola_is_verified(a, b, c)
        verified += passed
        if not scene.checker.free_mask(curve).all():
            blocked += 1
            assert not passed
    assert blocked >= 10
    assert verified >= 10


def test_the_law_of_a_cell_times_its_paths():
    """Jerk is slower than stops, blends faster; jerk without a limit is refused."""
    key = "planner.time_law="
    times = {}
    for law, more in (
        ("trapezoid", ()),
        ("jerk", ("robot.limits.jerk_rad_s3=40",)),
        ("blend", ()),
        ("toppra", ()),
    ):
        scene = scene_of("ur5-eye-in-hand", key + law, *more)
        path = winding_paths(scene_of("ur5-eye-in-hand"), 1)[0]
        times[law] = scene.time_law.path_time_s(path), scene.time_law.way_time_s(path)
    assert times["jerk"][0] > times["trapezoid"][0] > times["blend"][0]
    assert times["blend"][0] >= times["toppra"][0] * 0.995
    assert times["toppra"][1] == pytest.approx(times["trapezoid"][1], rel=0.02)
    with pytest.raises(SceneError, match=r"jerk needs robot\.limits\.jerk_rad_s3 for"):
        scene_of("ur5-eye-in-hand", key + "jerk")


def test_the_default_law_leaves_hashes_as_they_were():
    """A cell that names the default is the cell that does not; another law is not."""
    plain = read_cell("planar-toy", ())
    named = read_cell("planar-toy", ("planner.time_law=trapezoid",))
    blend = read_cell("planar-toy", ("planner.time_law=blend",))
    assert plain.sha256 == named.sha256 != blend.sha256
    assert "time_law" not in plain.resolved_json
    assert "blend" in blend.resolved_json
