"""Verdicts between the test grasps: a wall that no test grasp sees."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np
import pytest

from reachmap.cli.text.info import info_text
from reachmap.geometry import (
    inverse_transform,
    quaternion_wxyz_from_rotation,
    rotation_from_quaternion_wxyz,
)
from reachmap.maps import read_bin_map, write_bin_map
from reachmap.maps.parts import Refinement
from reachmap.maps.records import Status
from reachmap.ranking import Ranker
from reachmap.ranking.lookup.queries import complete_rotation
from reachmap.sampling.volume import GraspVolume
from reachmap.tools.info import info
from tests.support.optional import present
from tests.support.ranking_maps import CELL, make_bin_map

LEVER_M = 0.2


def is_reached(points, axes):
    """The truth, in the bin frame: a wall that tip and tool must clear."""
    return (points[:, 0] < 0.05) & ((points - LEVER_M * axes)[:, 0] < 0.04)


def in_base(bin_map, points, axes):
    """Points and directions of the bin frame in robot_base."""
    T = bin_map.bin_pose
    return points @ T[:3, :3].T + T[:3, 3], axes @ T[:3, :3].T


def drawn(bin_map, seed, count):
    """Random grasps of the bin frame."""
    points = bin_map.position.reshape(-1, 3) @ np.linalg.inv(bin_map.bin_pose)[:3, :3].T
    points += np.linalg.inv(bin_map.bin_pose)[:3, 3]
    volume = GraspVolume(
        low=points.min(axis=0),
        high=points.max(axis=0) + 1e-9,
        cosines=(float(np.cos(np.radians(30))), 1.0),
    )
    return volume.draw(np.random.default_rng(seed), count)


def true_map(**changes):
    """A map whose test grasps are true to the wall in every roll."""
    blank = make_bin_map(reachable=1.0, **changes)
    T = inverse_transform(blank.bin_pose)
    points = blank.position.reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
    R = rotation_from_quaternion_wxyz(blank.quaternion_wxyz)
    axes = R.reshape(len(points), -1, 3, 3)[..., 2] @ T[:3, :3].T
    reached = np.array([is_reached(np.tile(p, (len(a), 1)), a)
                        for p, a in zip(points, axes, strict=True)])  # fmt: skip
    reached = reached.reshape(blank.status.shape)
    gone: dict[str, Any] = {
        name: np.where(reached[..., None], getattr(blank, name), np.nan)
        for name in ("path_length", "path_length_planned", "tcp_path_length",
                     "planning_time", "planning_cpu_time", "simplification_time",
                     "execution_time")
    }  # fmt: skip
    status = np.where(reached, blank.status, Status.IK_IN_COLLISION).astype(np.uint8)
    found = np.where(reached[..., None], blank.path_found, 0).astype(np.uint8)
    return dataclasses.replace(blank, status=status, path_found=found, **gone)


def refined(bin_map, count=1500, cause=Status.APPROACH_BLOCKED):
    """The map with refining grasps."""
    points, axes = drawn(bin_map, 1, count)
    reached = is_reached(points, axes)
    at, along = in_base(bin_map, points, axes)
    R = complete_rotation(along, bin_map.bin_pose[:3, :3], bin_map.approach_axis)
    return dataclasses.replace(
        bin_map,
        refinement=Refinement(
            position=at,
            quaternion_wxyz=quaternion_wxyz_from_rotation(R),
            status=np.where(reached, Status.PATH_FOUND, cause).astype(np.uint8),
            lever_m=LEVER_M,
        ),
    )


def errors(bin_map):
    """Share of random grasps whose verdict is wrong, and the ranking."""
    points, axes = drawn(bin_map, 2, 1500)
    ranking = Ranker(bin_map).rank(*in_base(bin_map, points, axes))
    return np.mean(ranking.reachable != is_reached(points, axes)), ranking


def test_verdicts_follow_the_wall():
    """Refined, a quarter of the errors; every verdict has a cost or a cause."""
    coarse = true_map(shape=(1, 2, 3))
    before, _ = errors(coarse)
    after, ranking = errors(refined(coarse))
    assert before > 0.05
    assert after < before / 4
    np.testing.assert_array_equal(
        ranking.status == Status.PATH_FOUND, np.isfinite(ranking.cost)
    )
    # The test grasp that gives the cost is one that is reached.
    table = Ranker(coarse).table
    place = np.ravel_multi_index(tuple(ranking.test_grasp[:, :3].T), table.shape[:3])
    on = ranking.reachable
    assert table.reachable[place[on], ranking.test_grasp[on, 3]].all()
    assert set(ranking.status[~on]) <= {
        Status.APPROACH_BLOCKED,
        Status.IK_IN_COLLISION,
    }


def test_a_test_grasp_keeps_its_verdict():
    """What was planned to is known, whatever a regression says."""
    bin_map = make_bin_map(seed=3)
    wrong = refined(bin_map)
    R = rotation_from_quaternion_wxyz(bin_map.quaternion_wxyz).reshape(-1, 3, 3)
    points = np.repeat(bin_map.position.reshape(-1, 3), bin_map.status.shape[-1], 0)
    axes = R @ np.array([0.0, 0.0, 1.0])
    np.testing.assert_array_equal(
        Ranker(wrong).rank(points, axes).cost, Ranker(bin_map).rank(points, axes).cost
    )


def test_a_grasp_with_a_roll_of_its_own_is_not_touched():
    """The refinement is about directions in any roll."""
    bin_map = make_bin_map(seed=4)
    points, axes = in_base(bin_map, *drawn(bin_map, 2, 200))
    R = complete_rotation(axes, bin_map.bin_pose[:3, :3], bin_map.approach_axis)
    plain = Ranker(bin_map).rank(points, rotations=R)
    same = Ranker(refined(bin_map)).rank(points, rotations=R)
    np.testing.assert_array_equal(plain.cost, same.cost)
    np.testing.assert_array_equal(plain.probability, same.probability)


def test_probability_is_the_estimate():
    """Between the test grasps a refined map is surer than its grid."""
    coarse = true_map(shape=(1, 2, 3))
    points, axes = drawn(coarse, 2, 1500)
    truth = is_reached(points, axes)
    brier = [
        np.mean((Ranker(m).rank(*in_base(m, points, axes)).probability - truth) ** 2)
        for m in (coarse, refined(coarse))
    ]
    assert brier[1] < brier[0] / 2


def test_info_says_what_was_looked_at_between_the_test_grasps(tmp_path):
    """How many were asked for, looked at and reached, and what they are for."""
    cell = {**CELL, "bin_scan": {"refine": 2000}}
    bin_map = refined(make_bin_map(seed=5), count=50)
    told = dataclasses.replace(bin_map.provenance, cell_resolved_json=json.dumps(cell))
    path = tmp_path / "bin.h5"
    write_bin_map(path, dataclasses.replace(bin_map, provenance=told))
    reached = int((present(bin_map.refinement).status == Status.PATH_FOUND).sum())
    facts = info(path)
    assert facts.facts()["summary"]["refinement"] == {
        "asked": 2000,
        "grasps": 50,
        "reachable": reached,
    }
    text = info_text(facts)
    assert "50 (2000 asked for)" in text
    assert f"{reached} ({2 * reached:.1f} %)" in text
    assert "bin_scan.refine" in text
    write_bin_map(tmp_path / "plain.h5", make_bin_map(seed=5))
    assert "bin_scan.refine" not in info_text(info(tmp_path / "plain.h5"))


def test_a_grasp_without_room_for_the_tool_is_not_reached():
    """The regression is sure; a tool that is wider than the bin is not asked."""
    bin_map = refined(make_bin_map(reachable=1.0, seed=6), count=200)
    every = dataclasses.replace(
        present(bin_map.refinement),
        status=np.full(200, Status.PATH_FOUND, np.uint8),
    )
    bin_map = dataclasses.replace(bin_map, refinement=every)
    points, axes = in_base(bin_map, *drawn(bin_map, 2, 40))
    assert Ranker(bin_map).rank(points, axes).reachable.all()
    cell = {
        **CELL,
        "robot": {"tcp": {"parent": "tool0", "approach_axis": "+z"}},
        "bin": {
            "inner": [0.36, 0.26, 0.3],
            "inner_top": None,
            "mesh": None,
            "wall": 0.01,
        },
        "collision": {"safety_margin_m": 0.002},
        "bodies": [
            {
                "name": "plate",
                "attach_to": "tool0",
                "shape": {"box": [0.4, 0.4, 0.01], "cylinder": None},
                "pose": {"xyz": [0, 0, -0.1]},
                "touch": [],
            }
        ],
    }
    told = dataclasses.replace(bin_map.provenance, cell_resolved_json=json.dumps(cell))
    ranking = Ranker(dataclasses.replace(bin_map, provenance=told)).rank(points, axes)
    assert not ranking.reachable.any()
    assert set(ranking.status) == {Status.IK_IN_COLLISION}
    assert (ranking.probability < 0.02).all()


def test_it_is_kept_in_the_file(tmp_path):
    """Written and read, it ranks alike; the content hash covers it."""
    bin_map = refined(make_bin_map(seed=5), count=50)
    write_bin_map(tmp_path / "bin.h5", bin_map)
    back = read_bin_map(tmp_path / "bin.h5")
    kept = present(back.refinement)
    for name in ("position", "quaternion_wxyz", "status"):
        np.testing.assert_array_equal(
            getattr(kept, name), getattr(bin_map.refinement, name)
        )
    assert kept.lever_m == pytest.approx(LEVER_M)
    write_bin_map(tmp_path / "plain.h5", make_bin_map(seed=5))
    plain = read_bin_map(tmp_path / "plain.h5")
    assert plain.refinement is None
    assert plain.stamp.content_sha256 != back.stamp.content_sha256
