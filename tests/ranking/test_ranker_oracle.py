"""The vectorised ranking against Algorithm 1 written as loops."""

from __future__ import annotations

import dataclasses
from unittest import mock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reachmap.cell.model.orientations import ConeFamily
from reachmap.ranking.lookup.ranker import Ranker
from tests.support.ranking_maps import make_bin_map
from tests.support.ranking_oracle import Oracle


def wobbled(bin_map):
    """The map with its orientations turned a little, differently at every point."""
    shape = bin_map.quaternion_wxyz.shape
    xyzw = np.roll(bin_map.quaternion_wxyz.reshape(-1, shape[3], 4), -1, axis=2)
    turned = [
        (
            Rotation.from_rotvec([0.01 * n, 0.002, -0.03]) * Rotation.from_quat(q)
        ).as_quat()
        for n, q in enumerate(xyzw)
    ]
    wxyz = np.roll(np.array(turned), 1, axis=2).reshape(shape)
    return dataclasses.replace(bin_map, quaternion_wxyz=wxyz)


ONE = ConeFamily(tilts_deg=(0.0,), azimuths=(1,), rolls=1)
MAPS = [
    make_bin_map(shape=(1, 2, 4), seed=1),
    make_bin_map(shape=(2, 2, 2), seed=2, reachable=0.4, approach_axis="-x"),
    make_bin_map(shape=(1, 2, 2), seed=3, family=ONE),
    wobbled(make_bin_map(shape=(1, 2, 3), seed=4, reachable=0.5)),
]
PAIRS = [(Ranker(bin_map), Oracle(bin_map), bin_map) for bin_map in MAPS]


def random_list(bin_map, rng, n):
    """Grasps in the bin: some random, some on or midway between test grasps."""
    points = bin_map.position.reshape(-1, 3)
    p = points[rng.integers(len(points), size=n)].copy()
    kind = rng.integers(3, size=n)
    p[kind == 0] += rng.normal(scale=0.02, size=(n, 3))[kind == 0]
    # Midway between two neighbours: φ1 ties exactly, but for rounding.
    step = bin_map.position[0, 0, 1] - bin_map.position[0, 0, 0]
    p[kind == 1] += 0.5 * step
    R = Rotation.random(n, random_state=int(rng.integers(2**31))).as_matrix()
    some = rng.random(n) < 0.5
    q = bin_map.quaternion_wxyz.reshape(-1, 4)
    chosen = np.roll(q[rng.integers(len(q), size=n)], -1, axis=1)
    R[some] = Rotation.from_quat(chosen).as_matrix()[some]
    return p, R


def directions_of(R, axis):
    """Approach directions of TCP orientations."""
    sign = 1.0 if axis[0] == "+" else -1.0
    return sign * R[:, :, "xyz".index(axis[1])]


@pytest.mark.parametrize("roll", ["free", "fixed"])
@pytest.mark.parametrize("part", range(5))
def test_rankings_agree_with_the_loops(roll, part):
    """Each of 1,000 random lists, in ten parts, comes out in the oracle's order.

    Costs, matched test grasps and the places of ties agree, not only the best grasp.
    """
    rng = np.random.default_rng([part, roll == "free"])
    for case in range(100):
        ranker, oracle, bin_map = PAIRS[case % 4]
        n = int(rng.integers(1, 7))
        p, R = random_list(bin_map, rng, n)
        v = directions_of(R, bin_map.approach_axis)
        weights = tuple(rng.choice([0.25, 0.5, 1.0, 2.0], size=3) * (1.0, 0.0, 1.0))
        given = {"directions": v} if roll == "free" else {"rotations": R}
        # The oracle knows neither outside nor unlike: both are tested by themselves.
        ranking = _without_outside(ranker, p, weights, **given)
        order, costs, matches = oracle.rank(
            p, v, None if roll == "free" else R, weights
        )
        assert [tuple(row) for row in ranking.test_grasp.tolist()] == matches
        np.testing.assert_allclose(ranking.cost, costs, rtol=1e-9)
        assert ranking.order.tolist() == order


def _without_outside(ranker, p, weights, **given):
    nowhere = np.zeros(len(p), bool)
    with mock.patch("reachmap.ranking.lookup.ranker.outside_map", return_value=nowhere):
        return ranker.rank(p, weights=weights, max_angle_deg=180.0, **given)
