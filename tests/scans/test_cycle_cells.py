"""The pick cycle in cells with a real arm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from reachmap.cell.loading import cell_from_json, read_cell
from reachmap.core.collision.held_part import HeldPart
from reachmap.maps import Status, read_bin_map
from reachmap.maps.parts import StageStatus
from reachmap.runtime.options import RunOptions
from reachmap.scans.rolls import places_among
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.merge import merge
from tests.support.cycle_replay import faults_of_cycle, paths_by_stage

SMALL = (
    "bin_scan.grid=[3, 2]",
    "bin_scan.repeats=1",
    "bin_scan.orientations={family: cone, tilts_deg: [0, 20], azimuths: [1, 4], "
    "rolls: 1, roll_offset_deg: 180}",
)


def scan(path, cell, *overrides, **options):
    """Scan a cell with few grasps."""
    bin_scan(
        None,
        path,
        cell=cell,
        overrides=(*SMALL, *overrides),
        run=RunOptions(overwrite=True, quiet=True, **options),
    )
    return read_bin_map(path) if path.exists() else None


@pytest.fixture(scope="module")
def conveyor(tmp_path_factory):
    """A small map of the shipped cell."""
    return scan(tmp_path_factory.mktemp("conveyor") / "bin.h5", "ur5-conveyor")


def test_stages_join_into_a_cycle(conveyor):
    """Each begins where the last one ends, and all of it closes."""
    whole = np.argwhere(conveyor.cycle.drop_off >= 0)
    assert len(whole) > 0.8 * conveyor.status.size
    for grasp in whole:
        stages = paths_by_stage(conveyor, grasp)
        assert sorted(stages) == [0, 1, 2, 3, 4, 5]
        for stage in range(1, 6):
            gap = stages[stage][0] - stages[stage - 1][-1]
            assert np.abs(gap).max() < 1e-9
        np.testing.assert_allclose(
            stages[5][-1], conveyor.scan_configuration, atol=1e-9
        )
        at = tuple(grasp)
        total = conveyor.best.execution_time[at] + conveyor.cycle.time[at].sum()
        assert conveyor.cycle.cycle_time[at] == pytest.approx(total + 1.4)


def test_path_reachability_does_not_know_the_part(tmp_path, conveyor):
    """Status, attempts and their reachability are those of the scan without a part."""
    plain = scan(tmp_path / "plain.h5", "ur5-conveyor", "part=null")
    assert plain.cycle is None
    for name in ("status", "path_found", "path_length", "path_reachability"):
        np.testing.assert_array_equal(getattr(conveyor, name), getattr(plain, name))


def test_shards_make_the_same_map(tmp_path, conveyor):
    """Two halves, merged, have the contents of the whole."""
    for k in (1, 2):
        scan(tmp_path / "half.h5", "ur5-conveyor", shard=(k, 2))
    shards = sorted(tmp_path.glob("half*"))
    merge(shards, output=tmp_path / "whole.h5")
    merged = read_bin_map(tmp_path / "whole.h5")
    assert merged.stamp.content_sha256 == conveyor.stamp.content_sha256


def test_lifts_keep_to_their_goals_when_others_are_added():
    """Behind those of the same frame, as a stable sort puts them."""
    rng = np.random.default_rng(3)
    frame = np.sort(rng.integers(0, 6, 12))
    added = rng.integers(0, 8, 9)
    both = np.concatenate([frame, added])
    order = np.argsort(both, kind="stable")
    places = places_among(frame, both[order])
    np.testing.assert_array_equal(order[places], np.arange(len(frame)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cell", "overrides"),
    [("ur5-conveyor", ()), ("ur10-deep-conveyor", ("bin_scan.fill=[0.2, 0.7]",))],
)
def test_nothing_collides_in_an_independent_replay(tmp_path, cell, overrides):
    """A few cycles of each shipped cell at a third of the verification distance."""
    record = scan(tmp_path / "bin.h5", cell, *overrides)
    given = record.provenance
    loaded = cell_from_json(given.cell_resolved_json, urdf=given.urdf, srdf=given.srdf)
    whole = np.argwhere(record.cycle.drop_off >= 0)
    assert len(whole) > 0
    for grasp in whole[:: max(1, len(whole) // 2)]:
        level = loaded.fillings()[grasp[0] if len(loaded.fillings()) > 1 else 0]
        assert faults_of_cycle(level, record, grasp) == []


def test_swept_bodies_hold_every_turn():
    """The swept body of a box holds all its turns, and is hardly larger."""
    part = HeldPart.of(read_cell("ur10-deep-conveyor"))
    assert part is not None
    corner = np.hypot(0.03, 0.025)
    body = ConvexHull(part.points)
    turn = np.linspace(0, 2 * np.pi, 200)
    for height in (0.0, 0.06):
        ring = np.column_stack(
            [corner * np.cos(turn), corner * np.sin(turn), 0 * turn + height]
        )
        beyond = ring @ body.equations[:, :3].T + body.equations[:, 3]
        assert beyond.max() < 1e-9
    assert body.volume < 1.02 * np.pi * corner**2 * 0.06


def test_another_roll_saves_a_cycle(tmp_path):
    """A plate that meets a wall at the listed roll is turned where the roll is free."""
    plate = "part={shape: {box: [0.02, 0.20, 0.03]}, pose: {xyz: [0, 0, 0.015]}}"
    grid = ("bin_scan.grid=[1, 3]", "bin_scan.layers=[0.05]")
    flat = (
        "bin_scan.orientations={family: cone, tilts_deg: [0], azimuths: [1], "
        "rolls: 1, roll_offset_deg: 180}"
    )
    fixed, free = (
        scan(tmp_path / f"{roll}.h5", "ur5-conveyor", plate, *grid, flat,
             f"tool.roll={roll}")
        for roll in ("listed", "free")
    )  # fmt: skip
    assert (fixed.status == Status.PATH_FOUND).all()
    held = fixed.cycle.status[..., 0] == StageStatus.PART_IN_COLLISION
    assert held.any()
    assert (free.cycle.drop_off >= 0).sum() > (fixed.cycle.drop_off >= 0).sum()
    saved = held & (free.cycle.drop_off >= 0)
    assert (np.abs(free.winning_roll[saved]) > 0.1).all()
