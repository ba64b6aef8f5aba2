"""The roadmap against planning from scratch, on the shipped cell."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.core.planning.shortcut import shorten
from reachmap.maps import Status
from reachmap.sampling.frames import (
    approach_distance_m,
    bin_test_frames,
    workspace_frames,
)
from reachmap.scans.ik_survey import survey_frames
from reachmap.scans.routes import plan_from_scratch
from reachmap.scans.workspace_per_frame import plan_frames
from reachmap.scans.workspace_roadmap import connect_survey
from tests.support.dense_checks import dense_free
from tests.support.optional import present
from tests.support.roadmap_paths import path_to_frame
from tests.support.scenes import scene_of

SAMPLE = 300


def replay_is_free(scene, path):
    """Whether a path is free on the meshes at a third of the verification distance."""
    return all(
        dense_free(scene, a, b, margin_m=0.0)
        for a, b in zip(path[:-1], path[1:], strict=True)
    )


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_roadmap_misses_nothing_that_planning_finds():
    """On 300 random frames, what plans reach is connected; the rest has a path."""
    scene = scene_of("ur5-eye-in-hand", with_bin=False)
    cell = scene.loaded.cell
    cubes = workspace_frames(cell)
    poses = np.concatenate([c.frames.transforms().reshape(-1, 4, 4) for c in cubes])
    survey = survey_frames(scene, poses, 0.0)
    connection = connect_survey(scene, survey, seed=1)
    reached = np.zeros(len(poses), bool)
    reached[connection.roadmap.frames_reached()] = True
    rows = np.random.default_rng(11).permutation(len(poses))[:SAMPLE]
    planned = plan_frames(scene, poses[rows], rows.tolist())
    found = planned.status == Status.PATH_FOUND
    assert reached[rows[found]].all()
    only_roadmap = rows[~found & reached[rows]]
    print(f"{found.sum()} found by planning, {len(only_roadmap)} more by the roadmap")
    for frame in only_roadmap:
        path = path_to_frame(survey, connection, int(frame))
        rng = np.random.default_rng(int(frame))
        short = shorten(present(path), scene.motions.is_verified, tries=20, rng=rng)
        assert replay_is_free(scene, short)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_another_seed_reaches_the_same_test_grasps():
    """On 200 random test grasps another seed agrees but where attempts had failed."""
    scene = scene_of("ur5-eye-in-hand", "tool.roll=listed")
    other = scene_of("ur5-eye-in-hand", "tool.roll=listed", "seed=99")
    cell = scene.loaded.cell
    grid = bin_test_frames(cell, scene.T_base_bin).frames
    rows = np.random.default_rng(12).permutation(grid.size)[:200]
    survey = survey_frames(scene, grid.transforms_at(rows), approach_distance_m(cell))
    disputed = 0
    every = range(len(rows))
    for first, second in zip(
        plan_from_scratch(scene, survey, every),
        plan_from_scratch(other, survey, every),
        strict=True,
    ):
        found = [
            [plan.path is not None for plan, _ in made] for made in (first, second)
        ]
        if any(found[0]) != any(found[1]):
            assert not all(found[0])
            disputed += 1
    print(f"{disputed} of {len(rows)} differ, all found in fewer than all attempts")
