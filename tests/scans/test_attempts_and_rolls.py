"""Attempts over the network, and tools whose roll is free, on the planar toy."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.maps import Status, read_bin_map
from reachmap.tools.bin_scan import bin_scan
from tests.support.scenes import scene_of

FLAT = "bin_scan.orientations.rpy_deg=[[0,0,0],[0,0,90],[0,0,180],[0,0,-90]]"
TURNED = "bin_scan.orientations.rpy_deg=[[180,0,0],[180,0,90],[180,0,180],[180,0,-90]]"


def scanned(folder, *overrides):
    """Bin map of the toy."""
    path = folder / "bin.h5"
    path.unlink(missing_ok=True)
    bin_scan(None, path, cell="planar-toy", overrides=overrides)
    return read_bin_map(path)


@pytest.fixture(scope="module")
def listed(tmp_path_factory):
    """The toy as it is: the roll of an arm in a plane is 0."""
    return scanned(tmp_path_factory.mktemp("listed"), FLAT)


def test_every_reachable_grasp_has_a_best_path(listed):
    """The best path leads to its grasp, is verified, and as short as can be.

    The free space on the start's side of the post is convex: the shortest path is
    the straight motion to the nearest goal.
    """
    scene = scene_of("planar-toy")
    found = listed.status == Status.PATH_FOUND
    assert found.any()
    np.testing.assert_array_equal(listed.best.row >= 0, found)
    np.testing.assert_array_equal(listed.path_found.all(axis=-1), found)
    ends = np.cumsum(listed.paths.row_size)
    for grasp in np.argwhere(found):
        row = listed.best.row[tuple(grasp)]
        np.testing.assert_array_equal(listed.paths.index[row, :4], grasp)
        begin = ends[row] - listed.paths.row_size[row]
        path = listed.paths.configuration[begin : ends[row]]
        assert scene.motions.path_is_verified(path)
        straight = np.linalg.norm(path[-1] - path[0])
        assert listed.best.path_length[tuple(grasp)] == pytest.approx(straight)
    assert (listed.effort.checks[found] > 0).all()


@pytest.mark.parametrize("attempts", ["roadmap", "planner"])
def test_verdicts_do_not_rest_on_repeats(tmp_path, listed, attempts):
    """One attempt or three give the same states, and so does either kind."""
    for repeats in (1, 3):
        found = scanned(
            tmp_path,
            FLAT,
            f"bin_scan.repeats={repeats}",
            f"bin_scan.attempts={attempts}",
        )
        np.testing.assert_array_equal(found.status, listed.status)
        assert found.path_found.shape[-1] == repeats


def test_a_path_that_attempts_missed_is_kept(tmp_path, listed):
    """With a planner that finds nothing, the roadmap's own path is the best one."""
    found = scanned(
        tmp_path,
        FLAT,
        "bin_scan.attempts=planner",
        "planner.max_checks=1",
        "planner.straight_first=false",
    )
    np.testing.assert_array_equal(found.status, listed.status)
    reached = found.status == Status.PATH_FOUND
    missed = reached & ~found.path_found.any(axis=-1)
    assert missed.any()
    assert (found.paths.index[found.best.row[missed], 4] == -1).all()
    assert np.isfinite(found.best.execution_time[missed]).all()


@pytest.mark.parametrize("roll", ["free", "2-fold"])
def test_a_free_roll_finds_the_one_that_works(tmp_path, listed, roll):
    """Grasps listed upside down are reached like upright ones, half a turn away."""
    found = scanned(tmp_path, TURNED, f"tool.roll={roll}", "tool.rolls=6")
    np.testing.assert_array_equal(found.status, listed.status)
    reached = found.status == Status.PATH_FOUND
    np.testing.assert_allclose(np.abs(found.winning_roll[reached]), np.pi, atol=1e-9)
    assert np.isnan(found.winning_roll[~reached]).all()
    scene = scene_of("planar-toy")
    ends = np.cumsum(found.paths.row_size) - 1
    for grasp in np.argwhere(reached)[::3]:
        q = found.paths.configuration[ends[found.best.row[tuple(grasp)]]]
        T = scene.kinematics.forward(q)
        p = found.position[tuple(grasp[:3])]
        np.testing.assert_allclose(T[:3, 3], p, atol=1e-6)


@pytest.mark.parametrize("roll", ["listed", "3-fold"])
def test_other_rolls_do_not_help(tmp_path, roll):
    """A tool that may be turned by thirds, or not at all, reaches nothing."""
    found = scanned(tmp_path, TURNED, f"tool.roll={roll}")
    assert (found.status == Status.NO_IK).all()


def test_directions_share_their_verdict(tmp_path, listed):
    """Two rolls of a direction, one of them impossible, are both reached."""
    both = (
        "bin_scan.orientations.rpy_deg="
        "[[180,0,0],[0,0,0],[180,0,90],[0,0,90],[180,0,180],[0,0,180],[180,0,-90],[0,0,-90]]"
    )
    found = scanned(tmp_path, both, "tool.roll=free", "tool.rolls=2")
    np.testing.assert_array_equal(found.status[..., ::2], listed.status)
    np.testing.assert_array_equal(found.status[..., 1::2], listed.status)
    reached = found.status == Status.PATH_FOUND
    rolls = np.abs(found.winning_roll)
    np.testing.assert_allclose(rolls[..., ::2][reached[..., ::2]], np.pi, atol=1e-9)
    np.testing.assert_allclose(rolls[..., 1::2][reached[..., 1::2]], 0, atol=1e-9)
