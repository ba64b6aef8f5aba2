"""What a ranker answers: roll, ties, likeness, neighbours, the edge of the map."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from reachmap.errors import MapFileError, SettingsError
from reachmap.geometry import (
    axis_vector,
    direction_angle,
    rotation_angle,
    rotation_from_quaternion_wxyz,
)
from reachmap.maps.records import Status
from reachmap.ranking import (
    OUTSIDE_MAP,
    CostBasis,
    Ranker,
    RankSettings,
    align,
    rotation_between,
)
from reachmap.ranking.lookup.costs import INVALID, outside_map, stable_order
from reachmap.ranking.lookup.queries import tcp_rotation
from reachmap.ranking.lookup.settings import Roll
from reachmap.ranking.lookup.table import quaternion_angle
from tests.support.optional import present
from tests.support.ranking_maps import make_bin_map

BIN_MAP = make_bin_map(seed=7, reachable=0.6)
RANKER = Ranker(BIN_MAP)
AXES = ["+x", "-x", "+y", "-y", "+z", "-z"]


def in_base(points):
    """Points of the bin frame in robot_base."""
    T = BIN_MAP.bin_pose
    return np.atleast_2d(points) @ T[:3, :3].T + T[:3, 3]


def all_reachable(**changes):
    """A small map in which every attempt succeeded."""
    bin_map = make_bin_map(seed=3, reachable=1.0, shape=(1, 3, 3))
    rng = np.random.default_rng(0)
    shape = bin_map.path_found.shape
    fields = {
        name: rng.uniform(0.5, 1.0, shape)
        for name in ("path_length", "planning_cpu_time", "execution_time")
    }
    everywhere = {"path_found": np.ones(shape, np.uint8)}
    return dataclasses.replace(bin_map, **{**fields, **everywhere, **changes})


def test_a_test_grasp_finds_itself():
    """Ranking the map's own test grasps gives φ1 = φ2 = 0 and their own means."""
    place = (0, 2, 3)
    q = BIN_MAP.quaternion_wxyz[place]
    points = np.tile(BIN_MAP.position[place], (len(q), 1))
    ranking = RANKER.rank(points, rotations=rotation_from_quaternion_wxyz(q))
    np.testing.assert_allclose(ranking.distance, 0.0, atol=1e-12)
    np.testing.assert_allclose(ranking.angle, 0.0, atol=1e-7)
    assert ranking.test_grasp.tolist() == [[*place, o] for o in range(len(q))]
    np.testing.assert_array_equal(ranking.status, BIN_MAP.status[place])
    reached = BIN_MAP.path_found[place].any(axis=-1)
    np.testing.assert_array_equal(ranking.reachable, reached)


@pytest.mark.parametrize("normalise", ["max", "quantile"])
@pytest.mark.parametrize("planning_time", ["checks", "measured"])
def test_terms_are_means_over_successes_over_their_scale(normalise, planning_time):
    """The terms are what NumPy makes of the attempts, whatever the basis."""
    m = BIN_MAP
    found = m.path_found > 0
    basis = CostBasis(normalise=normalise, planning_time=planning_time)
    table = Ranker(m, basis).table
    effort = present(m.effort)
    seconds = effort.checks * effort.seconds_per_check
    planning = seconds if planning_time == "checks" else m.planning_cpu_time
    for index, values in enumerate((m.path_length, planning, m.execution_time)):
        mean = np.nanmean(np.where(found, values, np.nan)[found.any(-1)], axis=-1)
        assert table.maxima[index] == pytest.approx(mean.max())
        scale = mean.max() if normalise == "max" else np.percentile(mean, 95)
        flat = table.normalised[..., index].reshape(found.shape[:-1])[found.any(-1)]
        np.testing.assert_allclose(flat, mean / scale)


def test_terms_add_up_to_the_cost():
    """J is the sum of its terms."""
    m = BIN_MAP
    ranking = RANKER.rank(m.position.reshape(-1, 3), np.tile([0, 0, -1.0], (35, 1)),
                          weights=(0.5, 2.0, 1.0))  # fmt: skip
    reachable = ranking.reachable
    np.testing.assert_allclose(
        ranking.terms[reachable].sum(axis=1), ranking.cost[reachable]
    )


def test_a_direction_takes_the_cheapest_reachable_roll():
    """Among the rolls of one approach axis the reachable one of least J is chosen."""
    ranking = RANKER.rank(
        BIN_MAP.position.reshape(-1, 3), np.tile([0, 0, -1.0], (35, 1))
    )
    cost = RANKER.test_costs(RankSettings())
    # Orientations 0, 1, 2 of the family point straight down, at three rolls.
    np.testing.assert_allclose(ranking.cost, cost[:, :3].min(axis=1))
    assert (ranking.test_grasp[:, 3] < 3).all()
    assert ranking.roll_free.all()
    np.testing.assert_allclose(ranking.angle, 0.0, atol=1e-7)


def test_roll_can_be_freed_and_fixed():
    """A full orientation is compared by Eq. (3), or on its axis when roll is free."""
    q = BIN_MAP.quaternion_wxyz[0, 1, 1, 1]
    R = rotation_from_quaternion_wxyz(q)
    turned = R @ Rotation.from_euler("z", 0.4).as_matrix()
    point = BIN_MAP.position[0, 1, 1][None]
    as_given = RANKER.rank(point, rotations=turned[None])
    assert as_given.angle[0] == pytest.approx(0.4)
    assert as_given.test_grasp[0].tolist() == [0, 1, 1, 1]
    free = RANKER.rank(point, rotations=turned[None], roll="free")
    assert free.angle[0] == pytest.approx(0.0, abs=1e-7)
    assert free.cost[0] <= as_given.cost[0]


@pytest.mark.parametrize("roll", ["as-given", "free", "fixed"])
def test_printed_matrices_rank_as_the_rotations_they_stand_for(roll: Roll):
    """Rounded to three decimals or scaled a little: the nearest rotation is taken."""
    rng = np.random.default_rng(4)
    q = BIN_MAP.quaternion_wxyz.reshape(-1, 4)
    rows = rng.integers(len(q), size=60)
    near = Rotation.from_quat(np.roll(q[rows], -1, axis=1)) * Rotation.from_rotvec(
        rng.normal(scale=0.1, size=(60, 3))
    )
    points = np.repeat(BIN_MAP.position.reshape(-1, 3), len(q) // 35, axis=0)[rows]
    exact = near.as_matrix()
    for printed in (np.round(exact, 3), 0.996 * exact, 1.004 * exact):
        # SciPy's own nearest rotation.
        meant = Rotation.from_matrix(printed).as_matrix()
        ranking = RANKER.rank(points, rotations=printed, roll=roll)
        wanted = RANKER.rank(points, rotations=meant, roll=roll)
        np.testing.assert_array_equal(ranking.test_grasp, wanted.test_grasp)
        np.testing.assert_array_equal(ranking.order, wanted.order)
        np.testing.assert_allclose(ranking.angle, wanted.angle, atol=1e-6)


def test_a_fixed_roll_of_a_direction_is_the_upright_tool_turned():
    """Where the family has the direction, its roll 0 is the match, exactly."""
    orientations = np.arange(0, 27, 3)
    axes = RANKER.table.axes[10, orientations]
    points = np.tile(RANKER.table.points[10], (len(axes), 1))
    ranking = RANKER.rank(points, axes, roll="fixed")
    assert ranking.test_grasp[:, 3].tolist() == orientations.tolist()
    np.testing.assert_allclose(ranking.angle, 0.0, atol=1e-7)


def test_directions_and_orientations_in_one_list():
    """Rows without an orientation are roll-free, the others are not."""
    n = 9
    points = np.tile(BIN_MAP.position[0, 2, 2], (n, 1))
    R = rotation_from_quaternion_wxyz(BIN_MAP.quaternion_wxyz[0, 2, 2, :n])
    v = R[:, :, 2].copy()
    mixed = R.copy()
    mixed[::2] = np.nan
    ranking = RANKER.rank(points, v, mixed)
    apart = RANKER.rank(points, rotations=R), RANKER.rank(points, v)
    assert ranking.roll_free.tolist() == [True, False] * 4 + [True]
    np.testing.assert_array_equal(ranking.cost[1::2], apart[0].cost[1::2])
    np.testing.assert_array_equal(ranking.cost[::2], apart[1].cost[::2])


def test_midway_between_points_the_cheapest_of_the_tied_wins():
    """Between four grid points all four tie in φ1, whatever the rounding says."""
    m = all_reachable()
    ranker = Ranker(m)
    corners = m.position[0, :2, :2].reshape(-1, 3)
    middle = corners.mean(axis=0)
    rng = np.random.default_rng(1)
    jitter = rng.normal(scale=1e-9, size=(20, 3))
    ranking = ranker.rank(middle + jitter, np.tile([0, 0, -1.0], (20, 1)))
    at = [0, 1, 3, 4]
    cheapest = ranker.test_costs(RankSettings())[at][:, :3].min()
    np.testing.assert_allclose(ranking.cost, cheapest)
    # Equal costs keep their supplied order although the distances differ.
    assert ranking.order.tolist() == list(range(20))


def test_order_is_stable_and_unreachable_last():
    """Ties keep their order, unreachable ones too, and rounding decides nothing."""
    cost = np.array([2.0, np.inf, 1.0, 2.0 + 1e-15, np.inf, 1.0 - 1e-15])
    assert stable_order(cost).tolist() == [2, 5, 0, 3, 1, 4]


def test_scores_decide_between_equal_costs_only():
    """A higher score wins a tie of J, never more; unreachable ones ignore it."""
    cost = np.array([1.0, 1.0, 0.5, np.inf, np.inf, 1.0])
    scores = np.array([0.1, 0.9, 0.0, 0.1, 0.9, np.nan])
    assert stable_order(cost, scores).tolist() == [2, 1, 0, 5, 3, 4]


def test_likeness_grows_with_both_distances():
    """φ6 is 0 on a test grasp, ½ one pitch away, ½ one orientation step away."""
    m = all_reachable()
    ranker = Ranker(m)
    pitch = ranker.table.pitch_m.max()
    assert pitch == pytest.approx(0.12)
    assert ranker.table.spacing_rad[0] == pytest.approx(np.radians(30.0))
    x_axis = m.bin_pose[:3, 0]
    place, down = m.position[0, 1, 1], np.array([0.0, 0.0, -1.0])
    tilted = Rotation.from_rotvec(np.radians(10) * x_axis).apply(down)
    points = np.stack([place, place + 0.03 * x_axis, place])
    ranking = ranker.rank(points, np.stack([down, down, tilted]), likeness=2.0)
    expected = [0.0, 2.0 * 0.5 * 0.03 / 0.12, 2.0 * 0.5 * 10 / 30]
    np.testing.assert_allclose(ranking.terms[:, 3], expected, atol=1e-7)
    plain = ranker.rank(points, np.stack([down, down, tilted]))
    np.testing.assert_allclose(ranking.cost - plain.cost, expected, atol=1e-7)


def test_likeness_of_full_orientations_uses_their_own_spacing():
    """With rolls 120° apart the nearest other orientation is a tilt of 30° away."""
    gaps = [
        min(
            rotation_angle(*rotation_from_quaternion_wxyz(np.stack([a, b])))
            for j, b in enumerate(BIN_MAP.quaternion_wxyz[0, 0, 0])
            if i != j
        )
        for i, a in enumerate(BIN_MAP.quaternion_wxyz[0, 0, 0])
    ]
    assert RANKER.table.spacing_rad[1] == pytest.approx(max(gaps))


def test_neighbours_give_the_median_weighted_by_inverse_distance():
    """Of two points that is the nearer."""
    m = all_reachable()
    ranker = Ranker(m)
    a, b = m.position[0, 1, 1], m.position[0, 1, 2]
    R = rotation_from_quaternion_wxyz(m.quaternion_wxyz[0, 1, 1, 0])[None]
    nearer = ranker.rank((0.75 * a + 0.25 * b)[None], rotations=R, neighbours=2)
    terms = [ranker.rank(p[None], rotations=R).terms[0, :3] for p in (a, b)]
    np.testing.assert_array_equal(nearer.terms[0, :3], terms[0])
    on_point = ranker.rank(a[None], rotations=R, neighbours=5)
    np.testing.assert_array_equal(on_point.terms[0, :3], terms[0])


def test_an_unreachable_neighbour_has_no_cost():
    """The median is of what is left, and the nearest test grasp still decides."""
    m = all_reachable()
    found, status = m.path_found.copy(), m.status.copy()
    found[0, 1, 2], status[0, 1, 2] = 0, Status.NO_IK
    lost = Ranker(dataclasses.replace(m, path_found=found, status=status))
    a, b = m.position[0, 1, 1], m.position[0, 1, 2]
    R = rotation_from_quaternion_wxyz(m.quaternion_wxyz[0, 1, 1, 0])[None]
    median = lost.rank((0.6 * a + 0.4 * b)[None], rotations=R, neighbours=2)
    alone = lost.rank(a[None], rotations=R)
    np.testing.assert_array_equal(median.terms[0, :3], alone.terms[0, :3])
    near_lost = lost.rank((0.3 * a + 0.7 * b)[None], rotations=R, neighbours=4)
    assert not near_lost.reachable[0]


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("same_everywhere", [True, False])
def test_median_costs_are_those_of_a_plain_loop(free, same_everywhere):
    """Over nearest points and, by a kernel, over like directions or orientations."""
    bin_map = make_bin_map(seed=3, reachable=0.8)
    if not same_everywhere:
        turned = bin_map.quaternion_wxyz.copy()
        turned[0, 0, 0] = turned[0, 0, 0][::-1]
        bin_map = dataclasses.replace(bin_map, quaternion_wxyz=turned)
    ranker = Ranker(bin_map)
    table, rng = ranker.table, np.random.default_rng(0)
    assert table.same_everywhere == same_everywhere
    points = table.points[rng.integers(len(table.points), size=30)]
    points = points + rng.uniform(-0.01, 0.01, points.shape)
    R = Rotation.from_euler("xyz", rng.normal(0, 0.2, (30, 3))).as_matrix()
    axis = axis_vector(bin_map.approach_axis)
    R = R @ rotation_between(axis, table.axes[0, 0])
    roll: Roll = "free" if free else "fixed"
    median = ranker.rank(points, rotations=R, neighbours=3, roll=roll)
    nearest = ranker.rank(points, rotations=R, roll=roll)
    np.testing.assert_array_equal(median.reachable, nearest.reachable)
    assert (median.cost != nearest.cost).sum() >= 3
    for n in np.flatnonzero(median.reachable):
        expected = plain_median(table, points[n], R[n], R[n] @ axis if free else None)
        np.testing.assert_allclose(median.terms[n, :3], expected, rtol=1e-12)


def plain_median(table, point, R, axis):
    """Terms of median cost over the three nearest points, one by one."""
    distance = np.linalg.norm(table.points - point, axis=1)
    spacing = table.spacing_rad[1 if axis is None else 0]
    rows = []
    for p in np.argsort(distance)[:3]:
        angle = [
            rotation_angle(R, rotation_from_quaternion_wxyz(table.quaternions[p, o]))
            if axis is None
            else direction_angle(axis, table.axes[p, o])
            for o in range(table.axes.shape[1])
        ]
        for o, a in enumerate(angle):
            terms = table.normalised[p, o]
            like = np.exp((np.cos(a) - np.cos(min(angle))) / (0.3 * spacing) ** 2)
            if np.isfinite(terms).all():
                rows.append((terms.sum(), like / distance[p], terms))
    rows.sort(key=lambda row: row[0])
    half, total = 0.5 * sum(row[1] for row in rows), 0.0
    for _, weight, terms in rows:
        total += weight
        if total >= half:
            return terms
    raise AssertionError


def test_more_neighbours_than_points():
    """A map of one point answers for any number of neighbours."""
    ranker = Ranker(make_bin_map(shape=(1, 1, 1), reachable=1.0))
    point = ranker.table.points[:1]
    R = rotation_from_quaternion_wxyz(ranker.table.quaternions[0, 0])[None]
    one, many = (ranker.rank(point, rotations=R, neighbours=k) for k in (1, 64))
    np.testing.assert_allclose(one.cost, many.cost)


def test_outside_the_map_sideways_above_and_below():
    """Beyond half a grid diagonal and 1 mm, 5 cm off the layer, or the floor."""
    half = 0.5 * np.hypot(*RANKER.table.pitch_m)
    x_edge = BIN_MAP.x[-1]
    points = {
        (0.0, 0.0, 0.028): False,
        (0.0, 0.0, 0.065): False,
        (0.0, 0.0, 0.0999): False,
        (0.0, 0.0, 0.1001): True,
        (0.0, 0.0, 0.0001): False,
        (0.0, 0.0, -0.0001): True,
        (x_edge + half, 0.0, 0.05): False,
        (x_edge + half + 0.0009, 0.0, 0.05): False,
        (x_edge + half + 0.0011, 0.0, 0.05): True,
        (2.0, 0.0, 0.05): True,
    }
    down = np.tile([0, 0, -1.0], (len(points), 1))
    ranking = RANKER.rank(in_base(list(points)), down)
    outside = ranking.status == OUTSIDE_MAP
    assert outside.tolist() == list(points.values())
    assert np.isinf(ranking.cost[outside]).all()


def test_every_place_in_the_bin_is_inside():
    """No point over the inner bottom, at the heights of a heap, is outside."""
    rng = np.random.default_rng(0)
    size = np.array([0.36, 0.26, 0.0])
    p = (rng.random((2000, 3)) - 0.5) * size
    p[:, 2] = rng.uniform(0.028, 0.065, len(p))
    _, nearest = RANKER._tree.query(in_base(p), 1)
    assert not outside_map(in_base(p), nearest[:, 0], RANKER.table).any()


def test_layers_extend_the_map_upwards():
    """With layers at 5 and 9 cm the map reaches from 0 to 14 cm, matched in 3D."""
    ranker = Ranker(make_bin_map(shape=(2, 3, 3), reachable=1.0, bin_pose=np.eye(4)))
    z = np.array([0.001, 0.06, 0.08, 0.139, 0.141])
    points = np.stack([0 * z, 0 * z, z], axis=1)
    ranking = ranker.rank(points, np.tile([0, 0, -1.0], (5, 1)))
    assert ranking.test_grasp[:4, 0].tolist() == [0, 0, 1, 1]
    assert (ranking.status == OUTSIDE_MAP).tolist() == [False] * 4 + [True]


def test_a_path_without_a_successful_attempt_has_no_cost():
    """What only the roadmap proves is not path reachable for a loop that plans."""
    m = all_reachable()
    found = m.path_found.copy()
    found[0, 0, 0] = 0
    ranker = Ranker(dataclasses.replace(m, path_found=found))
    ranking = ranker.rank(m.position[0, 0, :2], np.tile([0, 0, -1.0], (2, 1)))
    assert ranking.status.tolist() == [Status.NO_PATH_FOUND, Status.PATH_FOUND]
    assert np.isinf(ranking.cost[0])


def test_a_map_without_a_reachable_test_grasp():
    """Nothing is divided by zero; every grasp is unreachable, in supplied order."""
    ranker = Ranker(make_bin_map(reachable=0.0))
    ranking = ranker.rank(ranker.table.points, np.tile([0, 0, -1.0], (35, 1)))
    assert not ranking.reachable.any()
    assert ranking.order.tolist() == list(range(35))


def test_only_what_a_direction_points_to_counts():
    """Of any length, but not one that is 0 with rounding."""
    points = BIN_MAP.position.reshape(-1, 3)[:4]
    v = np.tile([0.1, -0.2, -1.0], (4, 1))
    plain = RANKER.rank(points, v)
    for length in (1e-5, 1e3, 1e200, 1e308):
        scaled = RANKER.rank(points, length * v)
        np.testing.assert_allclose(scaled.cost, plain.cost)
        np.testing.assert_allclose(scaled.angle, plain.angle, atol=1e-9)
    nothing = RANKER.rank(points, 1e-12 * v)
    assert (nothing.status == INVALID).all()


def test_what_is_masked_or_none_is_no_number():
    """As in the images of depth cameras, and in columns of tables."""
    points = BIN_MAP.position.reshape(-1, 3)[:3]
    v = np.tile([0, 0, -1.0], (3, 1))
    masked = np.ma.masked_array(points, mask=np.eye(3) * [[1], [0], [0]] > 0)
    ranking = RANKER.rank(masked, v, scores=np.array([None, 1, 2], object))
    assert (ranking.status == INVALID).tolist() == [True, False, False]


def test_no_grasps():
    """An empty list has an empty ranking."""
    ranking = RANKER.rank(np.zeros((0, 3)), np.zeros((0, 3)), neighbours=3)
    assert ranking.order.shape == (0,)
    assert ranking.terms.shape == (0, 4)


def test_threads_share_a_ranker():
    """Many threads at once get what one gets."""
    rng = np.random.default_rng(5)
    points = in_base(
        rng.uniform([-0.1, -0.1, 0.03], [0.1, 0.1, 0.07], (8, 200, 3)).reshape(-1, 3)
    )
    lists = points.reshape(8, 200, 3)
    v = rng.normal(size=(8, 200, 3)) * 0.2 - [0, 0, 1]
    alone = [RANKER.rank(p, d, neighbours=3) for p, d in zip(lists, v, strict=True)]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(5):
            together = pool.map(lambda p, d: RANKER.rank(p, d, neighbours=3), lists, v)
            for one, other in zip(alone, together, strict=True):
                np.testing.assert_array_equal(one.order, other.order)
                np.testing.assert_array_equal(one.cost, other.cost)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_a_list_ranks_as_its_grasps_do_alone(seed):
    """Costs do not depend on the other grasps; permuting the list permutes them."""
    rng = np.random.default_rng(seed)
    n = 12
    points = in_base(rng.uniform([-0.2, -0.15, 0.0], [0.2, 0.15, 0.1], (n, 3)))
    v = rng.normal(size=(n, 3))
    ranking = RANKER.rank(points, v, likeness=0.3)
    alone = [RANKER.rank(points[[i]], v[[i]], likeness=0.3).cost[0] for i in range(n)]
    np.testing.assert_array_equal(ranking.cost, alone)
    shuffled = rng.permutation(n)
    again = RANKER.rank(points[shuffled], v[shuffled], likeness=0.3)
    np.testing.assert_array_equal(again.cost, ranking.cost[shuffled])
    assert (
        np.diff(np.round(ranking.cost[ranking.order], 12)[: ranking.reachable.sum()])
        >= 0
    ).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": np.zeros((2, 2))}, r"points must have the shape \('n', 3\)"),
        ({"points": np.full((2, 3), np.nan)}, "rows 0, 1: expected finite points"),
        ({"directions": np.zeros((2, 3))}, "finite directions longer than 0"),
        ({"directions": np.ones((3, 3))}, r"directions must have the shape \(2, 3\)"),
        ({"directions": None}, "give directions or rotations"),
        ({"rotations": np.ones((2, 3, 3))}, "orthonormal rotations"),
        ({"rotations": -np.tile(np.eye(3), (2, 1, 1))}, "determinant \\+1"),
        (
            {"directions": None, "rotations": np.full((2, 3, 3), np.nan)},
            "rows 0, 1",
        ),
        ({"weights": (1.0, -1.0, 0.0)}, "weight beta must be between 0"),
        ({"weights": (1.0, np.nan, 0.0)}, "weight beta must be between 0"),
        ({"weights": (0.0, 0.0, 0.0)}, "one weight at least"),
        ({"weights": (1.0, 1.0)}, "three weights are needed"),
        ({"likeness": np.inf}, "weight likeness"),
        ({"weights": "abc"}, "weight alpha must be between 0"),
        ({"weights": 1.0}, "three weights are needed"),
        ({"likeness": None}, "weight likeness"),
        ({"margins": ["clearance"]}, "margins are weights by name"),
        ({"margins": {1: 1.0, "x": 1.0}}, r"got \[1, 'x'\]"),
        ({"max_angle_deg": "5"}, "max_angle_deg must be above 0"),
        ({"scores": [1.0]}, r"scores must have the shape \(2,\)"),
        ({"scores": ["a", "b"]}, "scores must be an array of numbers"),
        ({"points": np.zeros((2, 3)) * 1j}, "points must be an array of numbers"),
        ({"neighbours": 0}, "neighbours must be 1 to"),
        ({"neighbours": 2.5}, "neighbours must be 1 to"),
        ({"roll": "loose"}, "roll must be one of"),
    ],
)
def test_wrong_arguments(arguments, message):
    """Shapes, numbers and settings that do not fit are named."""
    given_ = {"points": np.zeros((2, 3)), "directions": np.ones((2, 3)), **arguments}
    with pytest.raises(SettingsError, match=message):
        RANKER.rank(**given_, invalid="raise")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position": np.full((1, 3, 3, 3), np.nan)}, "poses that are not finite"),
        ({"quaternion_wxyz": np.ones((1, 3, 3, 27, 4))}, "not of unit length"),
        ({"path_length": np.full((1, 3, 3, 27, 5), np.nan)}, "without length or times"),
    ],
)
def test_maps_that_cannot_be_ranked_with(changes, message):
    """A map whose numbers make no sense is refused when it is loaded."""
    with pytest.raises(MapFileError, match=message):
        Ranker(all_reachable(**changes))


@pytest.mark.parametrize("tcp_axis", AXES)
@pytest.mark.parametrize("grasp_axis", AXES)
def test_orientations_of_another_convention(grasp_axis, tcp_axis):
    """The TCP approaches along the grasp's axis; what is square to both stays."""
    R = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix()
    turned = tcp_rotation(R, grasp_axis, tcp_axis)
    np.testing.assert_allclose(
        turned @ axis_vector(tcp_axis), R @ axis_vector(grasp_axis), atol=1e-12
    )
    assert np.linalg.det(turned) == pytest.approx(1.0)
    angle = rotation_angle(R, turned)
    smallest = direction_angle(axis_vector(tcp_axis), axis_vector(grasp_axis))
    assert angle == pytest.approx(float(smallest), abs=1e-7)


def test_smallest_rotations():
    """A vector is turned into another by their angle, also if nearly opposite."""
    rng = np.random.default_rng(2)
    a = rng.normal(size=(300, 3))
    b = rng.normal(size=(300, 3))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    b[:50] = -a[:50]
    b[50:100] = a[50:100]
    b[100:150] = -a[100:150] + 1e-4 * b[100:150]
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    R = rotation_between(a, b)
    np.testing.assert_allclose((R @ a[..., None])[..., 0], b, atol=1e-9)
    np.testing.assert_allclose(
        R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (300, 1, 1)), atol=1e-9
    )
    np.testing.assert_allclose(
        rotation_angle(R, np.eye(3)), direction_angle(a, b), atol=1e-7
    )


def test_recommended_orientations_can_be_aligned():
    """The recommended roll with exactly the supplied approach."""
    v = np.array([[0.1, 0.05, -1.0]]) / np.linalg.norm([0.1, 0.05, -1.0])
    ranking = RANKER.rank(BIN_MAP.position[0, 2, 2][None], v)
    R = rotation_from_quaternion_wxyz(ranking.orientation_wxyz)
    aligned = align(R, v, "+z")
    np.testing.assert_allclose(aligned[:, :, 2], v, atol=1e-12)
    np.testing.assert_allclose(rotation_angle(R, aligned), ranking.angle, atol=1e-7)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.floats(0, np.pi))
def test_angles_of_quaternions_are_those_of_matrices(seed, angle):
    """φ2 by quaternions equals φ2 by matrices and the angle that was put in."""
    a = Rotation.random(random_state=seed)
    axis = np.random.default_rng(seed).normal(size=3)
    b = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)) * a
    q = [np.roll(r.as_quat(), 1) for r in (a, b)]
    assert quaternion_angle(q[0], -q[1]) == pytest.approx(angle, abs=1e-7)
    by_matrix = rotation_angle(a.as_matrix(), b.as_matrix())
    assert quaternion_angle(*q) == pytest.approx(float(by_matrix), abs=1e-7)


@pytest.mark.parametrize("nothing", [[], (), np.zeros(0), np.zeros((0, 3))])
def test_an_image_without_grasps_is_ranked(nothing):
    """Empty lists have no second dimension; they are no mistake of the loop."""
    ranker = Ranker(make_bin_map())
    for how in ({"directions": nothing}, {"rotations": np.zeros((0, 3, 3))}):
        ranking = ranker.rank(nothing, **how)
        assert len(ranking.order) == len(ranking.cost) == 0
