"""The share reached around a grasp, against loops and against maps that are plain."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from reachmap.ranking import Ranker
from reachmap.ranking.lookup.probability import KERNEL_STEPS, MAP_WEIGHT
from reachmap.ranking.lookup.queries import complete_rotation
from tests.support.ranking_maps import make_bin_map

BIN_MAP = make_bin_map(seed=5, reachable=0.6, shape=(2, 4, 5))
RANKER = Ranker(BIN_MAP)


def grasps(seed, count, spread=1.0):
    """Points about the lattice and directions about straight down, in robot_base."""
    rng = np.random.default_rng(seed)
    table, T = RANKER.table, BIN_MAP.bin_pose
    low, high = table.bin_points.min(axis=0), table.bin_points.max(axis=0)
    points = low + rng.uniform(0.5 - spread / 2, 0.5 + spread / 2, (count, 3)) * (
        high - low
    )
    v = rng.normal(scale=0.3, size=(count, 3)) - [0, 0, 1]
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    return points, points @ T[:3, :3].T + T[:3, 3], v @ T[:3, :3].T


def by_loops(p_bin, direction):
    """The estimate of one grasp, corner by corner around the nearest inner point."""
    table = RANKER.table
    low, high = table.bin_points.min(axis=0), table.bin_points.max(axis=0)
    pitches = np.array([*table.pitch_m, max(table.pitch_m)])
    outside = np.linalg.norm((p_bin - np.clip(p_bin, low, high)) / pitches)
    p_bin = np.clip(p_bin, low, high)
    lattice = table.bin_points.reshape(*table.shape[:3], 3)
    reached = table.reachable.reshape(table.shape)
    total = nearest = 0.0
    for place in np.ndindex(*table.shape[:3]):
        weight = 1.0
        steps = (
            np.ptp(table.layers_m) / (table.shape[0] - 1),
            table.pitch_m[1],
            table.pitch_m[0],
        )
        for axis, step in zip((2, 1, 0), steps, strict=True):
            weight *= max(0.0, 1.0 - abs(p_bin[axis] - lattice[place][axis]) / step)
        if weight == 0.0:
            continue
        axes = table.axes.reshape(*table.shape, 3)[place]
        kinds: dict[Any, Any] = {}
        for orientation, axis in enumerate(axes):
            key = tuple(np.round(axis, 6))
            hit = bool(reached[place][orientation])
            kinds[key] = (axis, kinds.get(key, (axis, False))[1] or hit)
        spacing = table.spacing_rad[0]
        cosines = np.array([axis @ direction for axis, _ in kinds.values()])
        kernel = np.exp((cosines - 1.0) / (KERNEL_STEPS * spacing) ** 2)
        hits = np.array([hit for _, hit in kinds.values()], float)
        total += weight * float(kernel @ hits / kernel.sum())
        nearest = max(nearest, float(cosines.max()))
    any_roll = [
        reached[..., [k for k, a in enumerate(axes) if np.allclose(a, axis)]].any(-1)
        for axis, _ in kinds.values()
    ]
    beyond = max(0.0, np.arccos(min(nearest, 1.0)) / spacing - 0.5)
    trust = (1.0 - MAP_WEIGHT) * np.exp(-0.5 * (beyond**2 + outside**2))
    return trust * total + (1.0 - trust) * float(np.mean(any_roll))


def test_the_estimate_equals_loops_over_the_lattice():
    """Interpolation over points and the kernel over directions, done plainly."""
    p_bin, points, directions = grasps(seed=1, count=25)
    T = BIN_MAP.bin_pose
    wanted = [
        by_loops(p, d @ T[:3, :3] @ T[:3, :3].T)
        for p, d in zip(p_bin, directions, strict=True)
    ]
    ranking = RANKER.rank(points, directions, max_angle_deg=180.0)
    np.testing.assert_allclose(ranking.probability, wanted, atol=1e-9)


def test_beyond_the_lattice_distance_counts_in_its_own_pitches():
    """As in the loops, where x and y have pitches of their own."""
    p_bin, points, directions = grasps(seed=8, count=300, spread=1.3)
    ranking = RANKER.rank(points, directions, max_angle_deg=180.0)
    known = np.isfinite(ranking.probability)
    inner = RANKER.table.bin_points
    low, high = inner.min(axis=0), inner.max(axis=0)
    off = known[:, None] & ((p_bin < low) | (p_bin > high))
    assert (off.sum(axis=0) > 10).all()
    rows = np.flatnonzero(off.any(axis=1))[:60]
    wanted = [by_loops(p_bin[n], directions[n]) for n in rows]
    np.testing.assert_allclose(ranking.probability[rows], wanted, atol=1e-9)


@pytest.mark.parametrize(("reachable", "low", "high"), [(1.0, 0.97, 1), (0.0, 0, 0.03)])
def test_a_map_of_one_kind_says_so_everywhere(reachable, low, high):
    """Where all is reached, or nothing, so is every grasp."""
    ranker = Ranker(make_bin_map(seed=2, reachable=reachable, shape=(2, 4, 5)))
    _, points, directions = grasps(seed=3, count=60)
    share = ranker.rank(points, directions, max_angle_deg=180.0).probability
    assert ((share >= low) & (share <= high)).all()


def test_on_a_test_grasp_it_decides():
    """A full orientation on a test grasp follows that test grasp alone."""
    table = RANKER.table
    R = np.repeat(table.quaternions[7], 1, axis=0)
    ranking = RANKER.rank(np.tile(table.points[7], (len(R), 1)), quaternions_wxyz=R)
    reached = table.reachable[7]
    assert (ranking.probability[reached] > 0.5).all()
    assert (ranking.probability[~reached] < 0.5).all()


def test_beyond_the_map_it_fades_to_the_share_of_the_map():
    """Sideways of a corner that is never reached, the map's own share counts more."""
    bin_map = make_bin_map(seed=2, reachable=1.0, shape=(1, 4, 5))
    found = bin_map.path_found.copy()
    found[0, -1, -1] = 0
    table = Ranker(bin_map).table
    ranker = Ranker(dataclasses.replace(bin_map, path_found=found, effort=None))
    pitches = np.linspace(0.0, 0.65, 6)
    p_bin = table.bin_points[-1] + pitches[:, None] * [*table.pitch_m, 0.0]
    T = bin_map.bin_pose
    points = p_bin @ T[:3, :3].T + T[:3, 3]
    down = np.tile(-T[:3, 2], (6, 1))
    share = ranker.rank(points[:4], down[:4]).probability
    assert share[0] < 0.03
    assert (np.diff(share) > 0.01).all()


def test_rows_that_the_map_does_not_know_have_none():
    """Outside, unlike and invalid grasps have no probability, the others all do."""
    point = RANKER.table.points[0]
    up = BIN_MAP.bin_pose[:3, 2]
    ranking = RANKER.rank(
        [point, point + 1.0, point, [np.nan] * 3], [-up, -up, up, -up]
    )
    assert np.isnan(ranking.probability).tolist() == [False, True, True, True]


def test_mixed_lists_have_the_probabilities_of_plain_ones():
    """Grasps with and without a roll in one list do not change each other."""
    _, points, directions = grasps(seed=6, count=8)
    R = np.full((8, 3, 3), np.nan)
    R[::2] = complete_rotation(directions, BIN_MAP.bin_pose[:3, :3], "+z")[::2]
    mixed = RANKER.rank(points, directions, R).probability
    free = RANKER.rank(points[1::2], directions[1::2]).probability
    fixed = RANKER.rank(points[::2], rotations=R[::2]).probability
    np.testing.assert_allclose(mixed[1::2], free, atol=1e-12)
    np.testing.assert_allclose(mixed[::2], fixed, atol=1e-12)
