"""The paper's rule against plain loops, and its order of preference."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from reachmap.placement.paper_rule import (
    LatticePoint,
    choose_by_paper,
    levels_by_average,
    patch_means,
    points_in_order,
)
from tests.support.synthetic_maps import synthetic_workspace_map


def best_by_loops(percent, blocked):
    """Best level, densest patch, highest point in it: every choice as a plain loop."""
    means = [float(np.nanmean(level)) for level in percent]
    for z in sorted(range(len(means)), key=lambda k: (-means[k], k)):
        level = percent[z]
        ny, nx = level.shape

        def density(y, x, level=level):
            total = 0.0
            for dy in (-1, 0, 1):
                for dx in (-1, 0, 1):
                    if 0 <= y + dy < level.shape[0] and 0 <= x + dx < level.shape[1]:
                        total += level[y + dy, x + dx]
            return round(total / 9 * 1e6)

        free = [
            (y, x) for y in range(ny) for x in range(nx) if (z, y, x) not in blocked
        ]
        patches = sorted(
            ((y, x) for y in range(ny) for x in range(nx)),
            key=lambda p: (-density(*p), p),
        )
        for y, x in patches:
            near = [p for p in free if abs(p[0] - y) <= 1 and abs(p[1] - x) <= 1]
            if near:
                row, column = min(near, key=lambda p: (-level[p], -density(*p), p))
                return LatticePoint(z=z, y=row, x=column)
    return None


@given(seed=st.integers(0, 10_000), share_blocked=st.sampled_from([0.0, 0.3, 0.8, 1.0]))
def test_random_maps_against_loops(seed, share_blocked):
    """On random maps with blocked points the rule takes what plain loops take."""
    rng = np.random.default_rng(seed)
    shape = (3, int(rng.integers(3, 7)), int(rng.integers(3, 7)))
    workspace = synthetic_workspace_map(rng.integers(0, 5, shape) / 4)
    blocked = {
        tuple(p) for p in np.argwhere(rng.random(shape) < share_blocked).tolist()
    }
    found = choose_by_paper(
        workspace, lambda point: (point.z, point.y, point.x) not in blocked
    )
    assert found == best_by_loops(workspace.path_reachability, blocked)


def test_a_lone_perfect_square_is_no_dense_patch():
    """A 100 % square among bad ones loses to a 100 % square among good ones."""
    level = np.full((1, 7, 7), 0.25)
    level[0, 1, 1] = 1.0
    level[0, 4:7, 4:7] = 0.75
    level[0, 5, 4] = 1.0
    found = choose_by_paper(synthetic_workspace_map(level), lambda point: True)
    assert found == LatticePoint(z=0, y=5, x=4)


def test_levels_not_attempted_are_left_out():
    """Averages are over what was attempted; an empty level is never chosen."""
    percent = np.array([[[50.0, np.nan]], [[np.nan, np.nan]], [[40.0, 70.0]]])
    assert levels_by_average(percent) == [2, 0]


def test_a_patch_at_the_edge_is_not_denser_for_being_cut_off():
    """What lies outside the map counts as 0."""
    means = patch_means(np.full((3, 4), 90.0))
    assert np.isclose(means[0, 0], 40.0)
    assert np.isclose(means[0, 1], 60.0)
    assert np.isclose(means[1, 1], 90.0)


def test_every_attempted_point_comes_once():
    """The order names each attempted point of a level exactly once."""
    level = np.random.default_rng(5).random((6, 5)) * 100
    level[2, 3] = np.nan
    order = list(points_in_order(level))
    assert len(order) == len(set(order)) == 29
    assert (2, 3) not in order
