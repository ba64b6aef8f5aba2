"""Few test frames that stand for all: shares, weights, and estimates from them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reachmap.cell.loading import read_cell
from reachmap.core.scene import Scene
from reachmap.placement.mapped.exact import PlacedScene
from reachmap.placement.mapped.sample import (
    COARSE,
    MOST_ROLLS,
    frames_in_bin,
    open_frames,
    rolled,
    rolls_of,
    sample_of,
    spread_indices,
)
from reachmap.placement.predicted.prediction import footprint_of
from tests.support.scenes import scene_of

UR5 = "ur5-eye-in-hand"
LISTED = "tool.roll=listed"


@given(count=st.integers(1, 60), wanted=st.integers(1, 70))
def test_spread_indices_stand_for_everything_once(count, wanted):
    """Indices rise, reach both ends, and each share is a whole number of points."""
    index, share = spread_indices(count, wanted)
    assert len(index) == len(share) <= max(wanted, 3)
    assert index[0] == 0
    assert index[-1] == count - 1
    assert (np.diff(index) > 0).all()
    assert share.sum() == pytest.approx(1.0)
    parts = share * count
    assert np.allclose(parts, np.rint(parts))
    ends = np.cumsum(np.rint(parts))
    assert ((index >= ends - np.rint(parts)) & (index < ends)).all()


@given(count=st.integers(1, 60), extra=st.integers(0, 5))
def test_as_many_as_there_are_is_all_of_them(count, extra):
    """Asked for all points or more, each stands for itself."""
    index, share = spread_indices(count, count + extra)
    assert np.array_equal(index, np.arange(count))
    assert np.allclose(share, 1.0 / count)


def test_spread_indices_are_symmetric():
    """Neither wall of the bin is favoured."""
    for count, wanted in ((20, 8), (14, 6), (20, 6), (14, 4), (21, 5)):
        index, share = spread_indices(count, wanted)
        assert np.array_equal(index, (count - 1 - index)[::-1])
        assert np.allclose(share, share[::-1])


def everything_open(cell):
    """A tool that never touches the bin."""
    return np.ones(frames_in_bin(cell).shape, bool)


def test_the_full_grid_is_every_test_grasp():
    """All points and all orientations: nothing is left to estimate."""
    cell = read_cell(UR5, [LISTED]).cell
    sample = sample_of(cell, (20, 14, 1), everything_open(cell))
    frames = frames_in_bin(cell)
    assert len(sample.share) == cell.bin_scan.count() == 7560
    assert np.allclose(sample.T_bin_tcp, frames.transforms().reshape(-1, 4, 4))
    assert np.allclose(sample.share, 1 / 7560)
    assert np.allclose(sample.weight, 1 / 7560)


@pytest.mark.parametrize("grid", [COARSE, (6, 5, 3), (5, 4, 1), (20, 14, 2)])
def test_shares_and_weights_add_up(grid):
    """Shares add up to 1, weights to the share of frames that the tool can take."""
    cell = read_cell(UR5, [LISTED]).cell
    is_open = np.random.default_rng(2).random(frames_in_bin(cell).shape) < 0.8
    sample = sample_of(cell, grid, is_open)
    assert sample.share.sum() == pytest.approx(1.0)
    assert sample.weight.sum() == pytest.approx(is_open.mean())
    assert sample.point.max() == len(sample.open_share) - 1
    assert (np.diff(sample.point) >= 0).all()
    counts = np.bincount(sample.point)
    assert set(counts) == {27 // grid[2]} or grid[2] == 2


def test_neighbours_have_other_orientations():
    """A point and its neighbour share no orientation, three in a row have all."""
    cell = read_cell(UR5, [LISTED]).cell
    sample = sample_of(cell, COARSE, everything_open(cell))
    used = [
        {T[:3, :3].round(6).tobytes() for T in sample.T_bin_tcp[sample.point == p]}
        for p in range(3)
    ]
    assert len(used[0] | used[1] | used[2]) == 27
    assert not used[0] & used[1]


def test_few_orientations_are_all_used():
    """A cell with four orientations has them at every point."""
    cell = read_cell("planar-toy").cell
    sample = sample_of(cell, COARSE, everything_open(cell))
    assert len(sample.share) == 4 * 5 * 4


def test_many_layers_are_thinned():
    """Of many layers the lowest, the middle and the highest are kept."""
    cell = read_cell(UR5, [LISTED, "bin_scan.layers=[0.01,0.02,0.03,0.04,0.05]"]).cell
    heights = np.unique(frames_in_bin(cell).points[..., 2])
    assert heights.tolist() == [0.01, 0.03, 0.05]
    sample = sample_of(cell, COARSE, everything_open(cell))
    assert sample.share.sum() == pytest.approx(1.0)
    assert len(sample.open_share) == 3 * 48


def test_an_estimate_is_near_the_whole_where_reach_is_smooth():
    """A reach that falls off smoothly is estimated well from 6 % of the frames."""
    cell = read_cell(UR5, [LISTED]).cell
    frames = frames_in_bin(cell)
    is_open = everything_open(cell)
    is_open[:, :2, :, ::2] = False
    sample = sample_of(cell, COARSE, is_open)

    def found(T):
        # Reached up to a distance that depends on where the tool leans.
        return T[..., 0, 3] + 0.4 * T[..., 0, 2] + 0.2 * T[..., 1, 3] < 0.15

    whole = (found(frames.transforms()) & is_open).mean()
    estimate = sample.weight @ found(sample.T_bin_tcp)
    assert len(sample.share) == 432
    assert estimate == pytest.approx(whole, abs=0.01)
    assert 0.3 < whole < 0.9


def test_the_worst_point_against_a_loop():
    """Least share over points, of all frames where all are looked at."""
    cell = read_cell(UR5, [LISTED]).cell
    rng = np.random.default_rng(8)
    is_open = rng.random(frames_in_bin(cell).shape) < 0.9
    sample = sample_of(cell, (20, 14, 1), is_open)
    found = rng.random(7560) < 0.8
    by_hand = min(
        (found & is_open.ravel())[27 * p : 27 * (p + 1)].mean() for p in range(280)
    )
    assert sample.worst_point(found) == pytest.approx(by_hand)
    assert sample.worst_point(np.zeros(7560, bool)) == 0.0


def test_nothing_open_is_a_score_of_zero():
    """A tool that fits nowhere has weights of 0 and a worst point of 0."""
    cell = read_cell(UR5, [LISTED]).cell
    sample = sample_of(cell, COARSE, ~everything_open(cell))
    assert not sample.weight.any()
    assert sample.worst_point(np.ones(len(sample.share), bool)) == 0.0


def test_closed_frames_collide_in_the_whole_scene():
    """Where the tool alone is said to touch the bin, every configuration collides."""
    overrides = ("bin_scan.grid=[6,5]",)
    scene = scene_of(UR5, LISTED, *overrides)
    is_open = open_frames(scene.robot, scene.loaded).ravel()
    T = scene.T_base_bin @ frames_in_bin(scene.loaded.cell).transforms().reshape(
        -1, 4, 4
    )
    Q, frame = scene.kinematics.solve_many(T, windings=False)
    free = np.zeros(len(T), bool)
    free[frame[scene.checker.free_mask(Q)]] = True
    assert 0 < (~is_open).sum() < 100
    assert not (free & ~is_open).any()
    assert (free & is_open).sum() > 0.95 * is_open.sum()


def test_a_footprint_averages_what_is_open_around_its_points():
    """Each point of the footprint stands for its tile, frame by frame."""
    cell = read_cell(UR5, [LISTED]).cell
    is_open = np.random.default_rng(4).random((1, 14, 20, 27)) < 0.7
    footprint = footprint_of(cell, is_open)
    assert footprint.weights.sum() == pytest.approx(1.0)
    mean = footprint.weights @ footprint.open.mean(axis=1)
    assert mean == pytest.approx(is_open.mean())
    # Corner point, and the tile of the second point along x on the second row.
    assert np.allclose(footprint.open[0], is_open[0, 0, 0])
    x, _ = spread_indices(20, 5)
    assert x.tolist() == [0, 3, 9, 16, 19]
    assert np.allclose(footprint.open[6], is_open[0, 1:7, 1:7].mean(axis=(0, 1)))


def test_where_the_roll_is_free_a_direction_counts_with_any_roll():
    """Frames of the sample that have a free configuration, by trying every roll."""
    scene = scene_of("ur5-eye-in-hand", "tool.roll=free", with_bin=False)
    loaded = scene.loaded
    assert len(rolls_of(loaded.cell)) == MOST_ROLLS
    listed = frames_in_bin(scene_of(UR5, LISTED, with_bin=False).loaded.cell)
    free = frames_in_bin(loaded.cell)
    down = np.unique(np.round(listed.orientations[:, :, 2], 6), axis=0)
    assert free.shape[-1] == len(down) < listed.shape[-1]
    is_open = open_frames(scene.robot, loaded)
    sample = sample_of(loaded.cell, (3, 2, 3), is_open)
    moving = Scene.build(loaded, with_bin=True, bin_moves=True)
    placed = PlacedScene(moving, (0.5, 0.0, 0.0, 1.57), sample)
    wanted = []
    for k, rolls in enumerate(rolled(loaded.cell, placed.T)):
        branches = [placed.scene.kinematics.solve(T) for T in rolls]
        if any(placed.scene.checker.is_free(q) for Q in branches for q in Q):
            wanted.append(k)
    assert sorted(set(placed.grasps[1].tolist())) == wanted
    assert placed.bound == pytest.approx(100.0 * sample.weight[wanted].sum())


def test_rolls_turn_about_the_approach_axis():
    """The approach direction stays; listed rolls are left alone."""
    for axis, column in (("+z", 2), ("-x", 0)):
        changes = ("tool.roll=4-fold", f"robot.tcp.approach_axis={axis}")
        cell = read_cell("ur5-eye-in-hand", changes).cell
        (rolls,) = rolled(cell, np.eye(4)[None])
        assert len(rolls) == 4
        np.testing.assert_allclose(rolls[:, column, column], 1.0)
        angles = np.degrees(
            np.arccos((np.trace(rolls[:, :3, :3], axis1=1, axis2=2) - 1) / 2)
        )
        assert angles == pytest.approx([0, 90, 180, 90])
    listed = rolls_of(read_cell("ur5-eye-in-hand", (LISTED,)).cell)
    assert listed.tolist() == [0.0]
