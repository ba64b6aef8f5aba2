"""Points of a map: percentages, filters, and which of them a click means."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.maps.records import Status
from reachmap.view.points import EVERYTHING, points_of, shortest_paths
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_workspace_map,
)


def test_workspace_points_have_the_stitched_percentages() -> None:
    """Frames of squares that two cubes share are pooled, as Eq. (1) does."""
    rng = np.random.default_rng(5)
    record = synthetic_workspace_map(rng.random((2, 5, 4)), shared_row=2)
    points = points_of(record)
    assert len(points.position) == 2 * 5 * 4
    for x, y, z in points.position:
        row = np.flatnonzero((points.position == (x, y, z)).all(axis=1))
        assert len(row) == 1
        place = (
            int(np.abs(record.z - z).argmin()),
            int(np.abs(record.y - y).argmin()),
            int(np.abs(record.x - x).argmin()),
        )
        assert points.main[row[0]] == pytest.approx(record.path_reachability[place])
        assert points.shares["IK"][row[0]] == pytest.approx(
            record.ik_reachability[place]
        )
    assert points.frames is not None
    assert len(points.frames.point) == sum(c.status.size for c in record.cubes.values())


def test_frames_keep_their_orientation_and_goal() -> None:
    """Sorting by point moves status, orientation and goal together."""
    record = synthetic_workspace_map(np.full((1, 3, 2), 0.5), shared_row=1)
    points = points_of(record)
    frames = points.frames
    assert frames is not None
    cube = record.cubes["left"]
    wanted = np.array([cube.x[1], cube.y[1], cube.z[0]])
    point = int(np.abs(points.position - wanted).sum(axis=1).argmin())
    rows = points.frames_at(point)
    assert frames.status[rows].tolist() == cube.status[0, 1, 1].tolist()
    assert frames.quaternion_wxyz[rows] == pytest.approx(cube.quaternion_wxyz)
    assert frames.goal[rows] == pytest.approx(
        cube.goal_configuration[0, 1, 1], nan_ok=True
    )


def test_bin_points_follow_the_map() -> None:
    """Position, share and layer of a bin map, point by point."""
    record = synthetic_bin_map(0.5, shape=(2, 3, 4, 6, 2))
    points = points_of(record)
    assert points.main == pytest.approx(record.path_reachability.ravel())
    assert points.position == pytest.approx(record.position.reshape(-1, 3))
    assert points.levels == ("+0.05 m above the bottom", "+0.10 m above the bottom")
    assert points.chosen(1).tolist() == list(range(12, 24))


def test_a_filter_keeps_points_with_a_frame_in_the_state() -> None:
    """By brute force over all points and states."""
    record = synthetic_bin_map(0.4, shape=(2, 3, 4, 5, 1), seed=2)
    points = points_of(record)
    status = record.status.reshape(-1, 5)
    for name, code in points.states().items():
        expected = [p for p in range(24) if (status[p] == code).any()]
        assert points.chosen(None, name).tolist() == expected
        assert points.chosen(0, name).tolist() == [p for p in expected if p < 12]
    assert len(points.chosen(None, EVERYTHING)) == 24


def test_shortest_paths_by_brute_force() -> None:
    """Of the attempts at a test grasp the one with the least path length."""
    record = synthetic_bin_map(0.6, shape=(1, 3, 3, 4, 4), seed=9)
    rows = shortest_paths(record)
    index = record.paths.index.tolist()
    for place in np.ndindex(*record.status.shape):
        lengths = record.path_length[place]
        if np.isnan(lengths).all():
            assert rows[place] == -1
        else:
            best = int(np.nanargmin(lengths))
            assert index[rows[place]] == [*place, best]


def test_a_placement_shows_its_candidates() -> None:
    """Excluded places have no score, and the best yaw of a place counts."""
    points = points_of(synthetic_placement())
    assert len(points.position) == 4
    assert np.isnan(points.main).sum() == 1
    assert np.nanmax(points.main) == 96.5
    assert points.frames is None
    assert points.states() == {}


def test_unattempted_points_have_no_percentage() -> None:
    """They are not 0 %."""
    status = np.full((1, 2, 2, 3), Status.PATH_FOUND, np.uint8)
    status[0, 0, 0] = Status.NOT_ATTEMPTED
    record = synthetic_workspace_map(np.ones((1, 2, 2)), status=status)
    assert np.isnan(points_of(record).main).sum() == 1
