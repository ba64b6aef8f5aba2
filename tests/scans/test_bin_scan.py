"""Bin scans: verified paths, honest attempts, and the same map however it is run."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.core.planning.timing import execution_time_s, path_length_rad
from reachmap.geometry import rotation_angle, rotation_from_quaternion_wxyz
from reachmap.maps import Status, read_bin_map
from reachmap.runtime.options import RunOptions
from reachmap.tools.bin_scan import bin_scan, estimate_bin_scan, summary_of_bin
from reachmap.tools.merge import merge
from tests.support.dense_checks import dense_free
from tests.support.scenes import scene_of

# In the listed rolls, so that paths end at the test grasps themselves.
UR5_FEW = ("bin_scan.grid=[3,2]", "bin_scan.repeats=2", "tool.roll=listed")
TOY = ("bin_scan.repeats=2", "planner.max_checks=300")


@pytest.fixture(scope="module")
def ur5_bin(tmp_path_factory):
    """A small bin map of the UR5 cell."""
    path = tmp_path_factory.mktemp("bin") / "bin.h5"
    bin_scan(None, path, cell="ur5-eye-in-hand", overrides=UR5_FEW)
    return read_bin_map(path)


def paths_of(bin_map):
    """Each stored path with its index and the size of its planned part."""
    begin = 0
    store = bin_map.paths
    for size, planned, index in zip(
        store.row_size, store.planned_size, store.index, strict=True
    ):
        yield store.configuration[begin : begin + size], int(planned), tuple(index)
        begin += size


def test_no_stored_path_collides_on_the_meshes(ur5_bin):
    """Paths replayed at a third of the verification distance touch nothing."""
    scene = scene_of("ur5-eye-in-hand", *UR5_FEW)
    all_paths = list(paths_of(ur5_bin))
    assert len(all_paths) > 100
    for path, _, _ in all_paths[::31]:
        assert (path >= scene.robot.lower_rad).all()
        assert (path <= scene.robot.upper_rad).all()
        for q_from, q_to in zip(path[:-1], path[1:], strict=True):
            assert dense_free(scene, q_from, q_to, margin_m=0.0)


def test_paths_lead_from_the_scan_configuration_to_their_test_grasp(ur5_bin):
    """Each path ends within 0.1 mm and 0.05 degrees of its grasp, straight at last."""
    scene = scene_of("ur5-eye-in-hand", *UR5_FEW)
    for path, planned, index in paths_of(ur5_bin):
        np.testing.assert_array_equal(path[0], ur5_bin.scan_configuration)
        T = scene.kinematics.forward(path[-1])
        grasp = index[:4]
        R = rotation_from_quaternion_wxyz(ur5_bin.quaternion_wxyz[grasp])
        assert np.linalg.norm(T[:3, 3] - ur5_bin.position[grasp[:3]]) < 1e-4
        assert rotation_angle(T[:3, :3], R) < np.deg2rad(0.05)
        way = scene.kinematics.forward_many(path[planned - 1 :])
        assert np.linalg.norm(way[0, :3, 3] - T[:3, 3]) == pytest.approx(
            ur5_bin.approach_distance, abs=1e-5
        )
        # The approach is straight along the tool's axis, turned nowhere.
        offset = (way[:, :3, 3] - T[:3, 3]) @ T[:3, :3]
        np.testing.assert_allclose(offset[:, :2], 0.0, atol=1e-5)
        np.testing.assert_allclose(
            way[:, :3, :3], way[:1, :3, :3].repeat(len(way), 0), atol=1e-5
        )


def test_stored_lengths_and_times_are_those_of_the_paths(ur5_bin):
    """Lengths follow from the stored waypoints; times are no shorter than planned."""
    scene = scene_of("ur5-eye-in-hand", *UR5_FEW)
    limits = (scene.robot.velocity_rad_s, scene.robot.acceleration_rad_s2)
    for path, planned, index in paths_of(ur5_bin):
        assert ur5_bin.path_length[index] == pytest.approx(path_length_rad(path))
        part = path_length_rad(path[:planned])
        assert ur5_bin.path_length_planned[index] == pytest.approx(part)
        drive = execution_time_s(path[:planned], *limits)
        assert ur5_bin.execution_time[index] > drive
        straight = np.linalg.norm(
            scene.kinematics.forward(path[0])[:3, 3] - ur5_bin.position[index[:3]]
        )
        assert ur5_bin.tcp_path_length[index] >= straight - 1e-6


def test_states_follow_from_goals_and_attempts(ur5_bin):
    """A grasp is reachable when an attempt or the roadmap says so, else has a cause."""
    found = ur5_bin.path_found.any(axis=-1)
    reachable = ur5_bin.status == Status.PATH_FOUND
    np.testing.assert_array_equal(reachable, found | (ur5_bin.connected > 0))
    assert (ur5_bin.n_ik[ur5_bin.status == Status.NO_IK] == 0).all()
    collided = ur5_bin.status == Status.IK_IN_COLLISION
    assert (ur5_bin.n_ik_free[collided] == 0).all()
    assert (ur5_bin.blocking_pair[collided] >= 0).all()
    assert np.isnan(ur5_bin.path_length[ur5_bin.path_found == 0]).all()


def test_connectivity_and_attempts_agree(ur5_bin):
    """What the roadmap proves, attempts find, and they find nothing else."""
    found = ur5_bin.path_found.any(axis=-1)
    connected = ur5_bin.connected > 0
    assert (found & ~connected).sum() == 0
    assert (connected & ~found).mean() < 0.02


def run_toy(path, **options):
    """Scan the toy's bin and return the content hash (None for a shard)."""
    overrides = options.pop("overrides", TOY)
    result = bin_scan(
        None, path, cell="planar-toy", overrides=overrides, run=RunOptions(**options)
    )
    return None if result is None else read_bin_map(path).stamp.content_sha256


def test_workers_shards_and_layers_do_not_change_the_map(tmp_path):
    """One worker, two workers and merged shards give one content hash."""
    alone = run_toy(tmp_path / "alone.h5")
    assert run_toy(tmp_path / "two.h5", workers=2) == alone
    shards = []
    for k in (1, 2, 3):
        run_toy(tmp_path / "shard.h5", shard=(k, 3))
        shards = sorted(tmp_path.glob("shard*.journal"))
    assert len(shards) == 3
    merge(shards, output=tmp_path / "merged.h5")
    assert read_bin_map(tmp_path / "merged.h5").stamp.content_sha256 == alone
    other = run_toy(tmp_path / "seed.h5", overrides=(*TOY, "seed=2"))
    assert other != alone


def test_layers_lead_the_index(tmp_path):
    """Two layers give two grids, one above the other."""
    overrides = (*TOY, "bin_scan.layers=[0.2, 0.201]")
    bin_scan(None, tmp_path / "b.h5", cell="planar-toy", overrides=overrides)
    result = read_bin_map(tmp_path / "b.h5")
    assert result.status.shape == (2, 4, 5, 4)
    np.testing.assert_allclose(
        result.position[1] - result.position[0], [[[0, 0, 0.001]] * 5] * 4, atol=1e-12
    )
    # The arm is planar: nothing above its plane is reachable.
    assert (result.status[1] == Status.NO_IK).all()


def test_the_paper_s_definition_is_approach_zero(tmp_path):
    """Without an approach the path ends where the plan does."""
    bin_scan(
        None,
        tmp_path / "b.h5",
        cell="ur5-eye-in-hand",
        overrides=(
            "bin_scan.grid=[1,1]",
            "bin_scan.repeats=1",
            "bin_scan.approach_distance_m=0",
        ),
    )
    result = read_bin_map(tmp_path / "b.h5")
    np.testing.assert_array_equal(result.paths.row_size, result.paths.planned_size)
    np.testing.assert_array_equal(result.path_length, result.path_length_planned)


def test_the_summary_and_the_estimate(tmp_path, ur5_bin):
    """The headline counts; a dry run names plans and seconds."""
    facts = summary_of_bin(ur5_bin)
    assert facts["test_grasps"] == 3 * 2 * 27
    share = 100 * (ur5_bin.status == Status.PATH_FOUND).mean()
    assert facts["path_reachability_percent"] == pytest.approx(share, abs=0.01)
    estimate = estimate_bin_scan(
        None, cell="planar-toy", overrides=TOY, run=RunOptions()
    )
    assert estimate["plans"] == 4 * 5 * 4 * 2
