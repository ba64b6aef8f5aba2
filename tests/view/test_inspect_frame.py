"""What a click shows: a goal, or a configuration with the bodies in the way."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.core.scene import Scene
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.records import Status
from reachmap.view.inspect_frame import answer, best_first
from reachmap.view.points import MapPoints, points_of
from tests.support.toy_artefacts import toy_bin_map, toy_workspace


@pytest.fixture(scope="module")
def points() -> MapPoints:
    """Points of the toy's workspace."""
    return points_of(toy_workspace())


@pytest.fixture(scope="module")
def scene() -> Scene:
    """The toy's cell as it was mapped, without the bin."""
    loaded = cell_of_artefact(toy_workspace().provenance, "toy")
    return Scene.build(loaded, with_bin=False)


def rows_with(points: MapPoints, status: Status) -> list[int]:
    """Some test frames in a state."""
    assert points.frames is not None
    return np.flatnonzero(points.frames.status == status)[:5].tolist()


def test_a_reached_frame_shows_its_goal(points: MapPoints, scene: Scene) -> None:
    """The stored configuration is free, and its TCP is at the frame."""
    for row in rows_with(points, Status.PATH_FOUND):
        shown = answer(points, row, toy_workspace().body_pairs, None)
        assert shown.configuration is not None
        T = scene.kinematics.forward(shown.configuration)
        assert pytest.approx(shown.T_base_tcp, abs=1e-6) == T
        assert scene.checker.is_free(shown.configuration)
        assert shown.text == "path found"


def test_a_colliding_frame_shows_the_bodies(points: MapPoints, scene: Scene) -> None:
    """The configuration found again has the very pair in contact that the map names."""
    rows = rows_with(points, Status.IK_IN_COLLISION)
    assert rows
    for row in rows:
        shown = answer(points, row, toy_workspace().body_pairs, scene)
        assert shown.configuration is not None
        touching = scene.checker.touching_pairs(shown.configuration)
        names = {scene.checker.body_pairs[k] for k in touching}
        assert " | ".join(shown.blocking) in names
        assert shown.text.endswith(" touches ".join(shown.blocking))


def test_a_frame_out_of_reach_shows_no_arm(points: MapPoints, scene: Scene) -> None:
    """There is nothing to show but the frame."""
    for row in rows_with(points, Status.NO_IK):
        shown = answer(points, row, toy_workspace().body_pairs, scene)
        assert shown.configuration is None
        assert shown.blocking == ()


def test_the_most_useful_frame_comes_first(points: MapPoints) -> None:
    """Reached ones before others, all of the point's."""
    assert points.frames is not None
    for point in range(len(points.position)):
        rows = best_first(points, point)
        assert sorted(rows) == points.frames_at(point).tolist()
        found = points.frames.status[rows] == Status.PATH_FOUND
        assert found.tolist() == sorted(found.tolist(), reverse=True)


def test_bin_frames_know_their_path() -> None:
    """A reached test grasp can be played."""
    record = toy_bin_map()
    points = points_of(record)
    row = rows_with(points, Status.PATH_FOUND)[0]
    shown = answer(points, row, record.body_pairs, None)
    assert shown.path >= 0
    index = record.paths.index[shown.path]
    assert np.ravel_multi_index(tuple(index[:4]), record.status.shape) == row
