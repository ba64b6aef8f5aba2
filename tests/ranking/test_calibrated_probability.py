"""The calibration of a map: kept beside it, bound to it, used by the ranker."""

from __future__ import annotations

import dataclasses
import json
import logging
import os

import numpy as np
import pytest

from reachmap.errors import MapFileError
from reachmap.maps import read_bin_map, write_bin_map
from reachmap.ranking import Ranker
from reachmap.ranking.lookup.probability import (
    Calibration,
    calibration_beside,
    read_calibration,
)
from tests.support.ranking_maps import make_bin_map


def calibration_of(sha256):
    """A curve that halves every share."""
    return Calibration(
        map_sha256=sha256,
        share=np.array([0.0, 1.0]),
        probability=np.array([0.0, 0.5]),
        grasps=80,
        reached=40,
        error=0.02,
    )


@pytest.fixture
def map_path(tmp_path):
    """A map on disk."""
    path = tmp_path / "bin.h5"
    write_bin_map(path, make_bin_map(seed=1, reachable=0.7))
    return path


def put(path, **changes):
    """Write a calibration beside a map; return its document."""
    sha256 = read_bin_map(path).stamp.content_sha256
    document = {**calibration_of(sha256).document(), **changes}
    calibration_beside(path).write_text(json.dumps(document))
    return document


def test_a_ranker_takes_the_calibration_beside_its_map(map_path):
    """Probabilities go through the curve; nothing else of the ranking changes."""
    plain = Ranker.from_map(map_path)
    put(map_path)
    calibrated = Ranker.from_map(map_path)
    points, directions = plain.table.points[:9], plain.table.axes[:9, 1]
    before, after = plain.rank(points, directions), calibrated.rank(points, directions)
    np.testing.assert_allclose(after.probability, before.probability / 2)
    np.testing.assert_array_equal(after.order, before.order)
    np.testing.assert_array_equal(after.cost, before.cost)


def test_another_maps_calibration_is_refused(map_path):
    """In reading and by the ranker; both maps are named."""
    put(map_path, map_sha256="f" * 64)
    with pytest.raises(MapFileError, match="made for the map ffffffffffff, not"):
        read_calibration(calibration_beside(map_path), "e" * 64)
    with pytest.raises(MapFileError, match="another map"):
        Ranker(read_bin_map(map_path), calibration=calibration_of("f" * 64))


def test_a_stale_calibration_is_passed_over_with_a_warning(map_path, caplog):
    """A map that was scanned again is ranked without calibration, and says so."""
    put(map_path, map_sha256="f" * 64)
    with caplog.at_level(logging.WARNING):
        ranker = Ranker.from_map(map_path)
    assert ranker.calibration is None
    assert "not calibrated" in caplog.text


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "reachmap.grasps"}, "expected a file of the format"),
        ({"format_version": "2.0"}, "format_version 2.0"),
        ({"share": [0.0, 0.0]}, "must be rising numbers"),
        ({"probability": [0.5, 0.4]}, "must be rising numbers"),
        ({"probability": [0.5, 1.4]}, "must be rising numbers"),
        ({"probability": [0.5]}, "must be rising numbers"),
        ({"share": "x"}, "must be rising numbers"),
        ({"error": None}, "must be rising numbers"),
    ],
)
def test_damaged_calibrations_are_refused(map_path, changes, message):
    """A file that is none ends in one sentence."""
    put(map_path, **changes)
    with pytest.raises(MapFileError, match=message):
        Ranker.from_map(map_path)


def test_a_round_trip_keeps_every_number(tmp_path):
    """What is written is what is read."""
    made = dataclasses.replace(
        calibration_of("a" * 64),
        share=np.array([0.1, 1 / 3, 0.9]),
        probability=np.array([0.2, 0.2, 0.7]),
    )
    path = tmp_path / "c.json"
    path.write_text(json.dumps(made.document()))
    assert read_calibration(path, "a" * 64).document() == made.document()


def test_a_pipe_in_the_place_of_a_calibration_is_refused(map_path):
    """Nobody waits for what may never come."""
    os.mkfifo(calibration_beside(map_path))
    with pytest.raises(MapFileError, match="not a regular file"):
        Ranker.from_map(map_path)
