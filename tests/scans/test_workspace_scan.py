"""Workspace scans of the toy arm against its closed form, and of the UR5 in part."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.errors import ReachmapError
from reachmap.geometry import rotation_from_quaternion_wxyz
from reachmap.maps import Status, read_workspace_map
from reachmap.runtime.options import RunOptions
from reachmap.tools.workspace_scan import (
    estimate_workspace_scan,
    summary_of_workspace,
    workspace_scan,
)
from tests.support.optional import present
from tests.support.toy_closed_form import margin, verdict

MEANING = {
    "no_ik": Status.NO_IK,
    "blocked": Status.IK_IN_COLLISION,
    "behind": Status.NO_PATH_FOUND,
    "reachable": Status.PATH_FOUND,
}
PER_FRAME = (
    "planner.max_checks=4000",
    "planner.name=RRTConnect",
    "workspace_scan.repeats=1",
    "workspace_scan.cubes.0.grid=[8,4]",
    "workspace_scan.cubes.1.grid=[8,4]",
)
UR5_FEW = (
    "workspace_scan.cubes.0.grid=[3,2]",
    "workspace_scan.cubes.1.grid=[3,2]",
    "workspace_scan.z_step=0.5",
    "roadmap.max_checks=1000",
    "roadmap.sample_checks=2000",
)


def frames_of(cube):
    """Each frame of a planar cube: index, x, y, yaw."""
    R = rotation_from_quaternion_wxyz(cube.quaternion_wxyz)
    yaws = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    for index in np.ndindex(cube.status.shape):
        _, y, x, o = index
        yield index, cube.x[x], cube.y[y], yaws[o]


@pytest.mark.parametrize("method", ["roadmap", "per-frame"])
def test_the_map_of_the_toy_is_the_closed_form(tmp_path, method):
    """Every frame that is not on an edge has the state worked out on paper."""
    overrides = () if method == "roadmap" else PER_FRAME
    workspace_scan("planar-toy", tmp_path / "w.h5", method=method, overrides=overrides)
    result = read_workspace_map(tmp_path / "w.h5")
    seen = set()
    for cube in result.cubes.values():
        for index, x, y, yaw in frames_of(cube):
            if margin(x, y, yaw) < 1e-3:
                continue
            expected = verdict(x, y, yaw)
            seen.add(expected)
            assert cube.status[index] == MEANING[expected], (x, y, yaw, expected)
    assert seen >= {"no_ik", "behind", "reachable"}


def test_progress_ends_with_what_is_not_reached(tmp_path, capsys):
    """All frames with a collision-free configuration are counted, as in the map."""
    workspace_scan("planar-toy", tmp_path / "w.h5", run=RunOptions(quiet=False))
    cubes = read_workspace_map(tmp_path / "w.h5").cubes.values()
    reached = sum(int((c.status == Status.PATH_FOUND).sum()) for c in cubes)
    missed = sum(int((c.status == Status.NO_PATH_FOUND).sum()) for c in cubes)
    assert missed > 0
    last = capsys.readouterr().err.splitlines()[-1]
    frames = reached + missed
    assert f" {frames}/{frames} (100%) ok {100 * reached / frames:.1f}% " in last


def test_percentages_are_eq_1_over_pooled_frames(tmp_path):
    """The stitched percentages count frames, those of the shared row once per cube."""
    workspace_scan("planar-toy", tmp_path / "w.h5")
    result = read_workspace_map(tmp_path / "w.h5")
    right, left = result.cubes["right"], result.cubes["left"]
    assert result.path_reachability.shape == (1, 15, 15)
    for x in range(15):
        pooled = np.concatenate([right.status[0, -1, x], left.status[0, 0, x]])
        share = 100 * (pooled == Status.PATH_FOUND).mean()
        assert result.path_reachability[0, 7, x] == pytest.approx(share)
    assert (result.path_reachability <= result.ik_free_reachability).all()
    assert (result.ik_free_reachability <= result.ik_reachability).all()


@pytest.mark.parametrize("method", ["roadmap", "per-frame"])
def test_workers_do_not_change_the_map(tmp_path, method):
    """One and two workers give the same content hash, another seed another one."""
    hashes = []
    for workers in (1, 2):
        path = tmp_path / f"w{workers}.h5"
        workspace_scan(
            "ur5-eye-in-hand" if method == "roadmap" else "planar-toy",
            path,
            method=method,
            overrides=UR5_FEW if method == "roadmap" else ("planner.max_checks=200",),
            run=RunOptions(workers=workers),
        )
        hashes.append(read_workspace_map(path).stamp.content_sha256)
    assert hashes[0] == hashes[1]


def test_reachable_frames_of_the_ur5_have_verified_goals(tmp_path):
    """Goals are free and meet their frames; frames without IK have no attempt."""
    from tests.support.scenes import scene_of

    workspace_scan("ur5-eye-in-hand", tmp_path / "w.h5", overrides=UR5_FEW)
    result = read_workspace_map(tmp_path / "w.h5")
    scene = scene_of("ur5-eye-in-hand", with_bin=False)
    for cube in result.cubes.values():
        found = cube.status == Status.PATH_FOUND
        assert found.any()
        assert np.isfinite(cube.path_length[found]).all()
        assert (cube.attempts[cube.status == Status.NO_IK] == 0).all()
        R = rotation_from_quaternion_wxyz(cube.quaternion_wxyz)
        for z, y, x, o in np.argwhere(found)[::7]:
            q = cube.goal_configuration[z, y, x, o]
            T = scene.kinematics.forward(q)
            point = [cube.x[x], cube.y[y], cube.z[z]]
            np.testing.assert_allclose(T[:3, 3], point, atol=1e-6)
            np.testing.assert_allclose(T[:3, :3], R[o], atol=1e-6)
            assert scene.checker.is_free(q)


def test_the_summary_names_the_best_level(tmp_path):
    """The headline has the level with the best average."""
    scan = workspace_scan("ur5-eye-in-hand", tmp_path / "w.h5", overrides=UR5_FEW)
    result = present(scan)
    facts = summary_of_workspace(result)
    means = result.path_reachability.mean(axis=(1, 2))
    assert facts["best_level_m"] == result.z[np.argmax(means)]
    assert facts["frames"] == sum(c.status.size for c in result.cubes.values())
    assert summary_of_workspace(None) == {}


def test_a_dry_run_writes_nothing(tmp_path, monkeypatch):
    """An estimate names frames and seconds and leaves the folder empty."""
    monkeypatch.chdir(tmp_path)
    facts = estimate_workspace_scan(
        "planar-toy", method="roadmap", overrides=(), run=RunOptions()
    )
    assert facts["frames"] == 2 * 15 * 8 * 4
    assert facts["estimated_s"] >= 0
    assert not list(tmp_path.iterdir())


def test_wrong_settings_are_refused_before_any_work(tmp_path):
    """Shards of a roadmap, unknown methods and blocked starts are one clear line."""
    output = tmp_path / "w.h5"
    with pytest.raises(ReachmapError, match="--method per-frame"):
        workspace_scan("planar-toy", output, run=RunOptions(shard=(1, 2)))
    with pytest.raises(ReachmapError, match="roadmap or per-frame"):
        workspace_scan("planar-toy", output, method="magic")
    blocked = ("scan_configuration.q_deg.joint_1=0",)
    with pytest.raises(ReachmapError, match=r"scan_configuration: \w+ touches \w+"):
        workspace_scan("planar-toy", output, overrides=blocked)
    assert not list(tmp_path.iterdir())


def test_an_existing_map_is_not_overwritten(tmp_path):
    """Without overwrite the old file stays as it is."""
    output = tmp_path / "w.h5"
    output.write_bytes(b"precious")
    with pytest.raises(ReachmapError, match="exists"):
        workspace_scan("planar-toy", output)
    assert output.read_bytes() == b"precious"
