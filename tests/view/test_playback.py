"""Stored paths in time, on real paths of the planar toy arm."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.core.collision.solids import SolidCell
from reachmap.errors import SettingsError
from reachmap.maps.provenance import cell_of_artefact
from reachmap.motions.motion import way_points
from reachmap.view.playback import (
    Playback,
    choose_paths,
    find_path,
    playback_of,
    stage_rows,
)
from reachmap.view.points import shortest_paths
from tests.support.optional import present
from tests.support.synthetic_maps import synthetic_bin_map
from tests.support.synthetic_parts import bin_with_parts
from tests.support.toy_artefacts import toy_bin_map


@pytest.fixture(scope="module")
def cell() -> SolidCell:
    """The toy arm, as the artefact keeps it."""
    return SolidCell.build(cell_of_artefact(toy_bin_map().provenance, "toy"))


@pytest.fixture(scope="module")
def playbacks(cell: SolidCell) -> list[Playback]:
    """All stored paths."""
    record = toy_bin_map()
    return [
        playback_of(record, row, cell.robot)
        for row in range(len(record.paths.row_size))
    ]


def test_a_playback_takes_the_execution_time(playbacks: list[Playback]) -> None:
    """To the grasp and back out, exactly as long as the map says."""
    record = toy_bin_map()
    assert playbacks
    for row, playback in enumerate(playbacks):
        place = tuple(record.paths.index[row])
        at_grasp = record.execution_time[place]
        out = at_grasp + present(record.times).retreat[place]
        assert playback.time_s[playback.grasp] == pytest.approx(at_grasp)
        assert playback.time_s[-1] == pytest.approx(out)
        assert (np.diff(playback.time_s) > 0).all()
        assert len(playback.time_s) == len(playback.configuration)


def test_a_playback_goes_from_the_scan_to_the_grasp_and_out(
    playbacks: list[Playback], cell: SolidCell
) -> None:
    """It begins where paths begin, is at the test grasp once, and ends before it."""
    record = toy_bin_map()
    for row, playback in enumerate(playbacks):
        planned, approach = way_points(record, row)
        q = playback.configuration
        assert q[0] == pytest.approx(record.scan_configuration)
        assert q[playback.grasp] == pytest.approx(approach[-1])
        assert q[-1] == pytest.approx(planned[-1])
        T = cell.tcp_pose(q[playback.grasp])
        expected = record.position[playback.test_grasp[:3]]
        assert T[:3, 3] == pytest.approx(expected, abs=1e-6)


def test_a_playback_stays_on_the_path(playbacks: list[Playback]) -> None:
    """Every waypoint of the planned part is passed, none is cut off."""
    record = toy_bin_map()
    for row, playback in enumerate(playbacks):
        planned, _ = way_points(record, row)
        for point in planned:
            nearest = np.linalg.norm(playback.configuration - point, axis=1).min()
            assert nearest < 0.12


def test_no_joint_is_faster_than_it_can(
    playbacks: list[Playback], cell: SolidCell
) -> None:
    """Finite differences stay below the limits that the time was computed with."""
    for playback in playbacks:
        step = np.diff(playback.configuration, axis=0)
        speed = np.abs(step) / np.diff(playback.time_s)[:, None]
        assert (speed <= cell.robot.velocity_rad_s * 1.001).all()


def test_the_paths_to_watch_are_typical() -> None:
    """As many test grasps of the quadrant have a longer shortest path as a shorter."""
    record = toy_bin_map()
    shortest = shortest_paths(record)
    for row in choose_paths(record):
        _, y, x, _, attempt = record.paths.index[row]
        place = tuple(record.paths.index[row][:4])
        assert shortest[place] == row
        same_y = (record.y >= 0) == (record.y[y] >= 0)
        same_x = (record.x >= 0) == (record.x[x] >= 0)
        rows = shortest[:, same_y][:, :, same_x]
        index = record.paths.index[rows[rows >= 0]]
        lengths = record.path_length[tuple(index.T)]
        own = record.path_length[(*place, attempt)]
        assert abs(int((lengths < own).sum()) - int((lengths > own).sum())) <= 1


def test_the_paths_to_watch_are_in_different_quadrants() -> None:
    """One for each quadrant that has any."""
    record = toy_bin_map()
    rows = choose_paths(record)
    places = record.paths.index[list(rows)]
    quadrants = {(record.y[y] >= 0, record.x[x] >= 0) for _, y, x, _, _ in places}
    assert len(quadrants) == len(rows) >= 2


def test_a_path_is_found_by_its_test_grasp() -> None:
    """The one with the least length; others are refused with the range."""
    record = toy_bin_map()
    layer, y, x, orientation, _ = (int(i) for i in record.paths.index[0])
    row = find_path(record, (layer, y, x, orientation))
    assert record.paths.index[row].tolist()[:4] == [layer, y, x, orientation]
    with pytest.raises(SettingsError, match="no such test grasp"):
        find_path(record, (0, 99, 0, 0))
    without = np.argwhere(record.path_found.sum(axis=-1) == 0)
    layer, y, x, orientation = without[0].tolist()
    with pytest.raises(SettingsError, match="no path to this test grasp"):
        find_path(record, (layer, y, x, orientation))


def test_the_best_path_is_the_one_to_watch() -> None:
    """Also where it is the roadmap's own, which is no attempt."""
    record = bin_with_parts(
        synthetic_bin_map(0.3, connected=np.ones((1, 4, 5, 6), bool))
    )
    np.testing.assert_array_equal(shortest_paths(record), present(record.best).row)
    assert len(choose_paths(record)) == 4
    own = tuple(np.argwhere(~record.path_found.any(axis=-1))[0])
    assert record.paths.index[find_path(record, own)].tolist() == [*own, -1]


def test_a_playback_runs_the_whole_cycle_where_one_is_stored(cell: SolidCell) -> None:
    """The stages follow the grasp in order; the part hangs on the tool in between."""
    record = bin_with_parts(toy_bin_map())
    whole = np.argwhere(np.isfinite(present(record.cycle).cycle_time))
    assert len(whole)
    for place in whole[:5].tolist():
        row = int(present(record.best).row[tuple(place)])
        playback = playback_of(record, row, cell.robot)
        rows = stage_rows(record, row)
        stages = present(record.paths.stage)
        assert stages[rows].tolist() == [1, 2]
        assert playback.has_cycle
        last = np.concatenate(way_points(record, rows[-1]))[-1]
        np.testing.assert_allclose(playback.configuration[-1], last)
        assert playback.release == len(playback.configuration) - 1
        at_grasp = playback.configuration[playback.grasp]
        np.testing.assert_array_equal(present(playback.part_at(0)), at_grasp)
        held = playback.grasp + 2
        np.testing.assert_array_equal(
            present(playback.part_at(held)), playback.configuration[held]
        )
        assert (np.diff(playback.time_s) >= 0).all()


def test_without_a_cycle_there_is_no_part(playbacks: list[Playback]) -> None:
    """The arm goes back out, and nothing hangs on it."""
    assert not any(playback.has_cycle for playback in playbacks)
    assert all(playback.part_at(3) is None for playback in playbacks)
