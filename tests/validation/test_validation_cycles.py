"""Whole cycles re-planned on the planar toy, whose truth is a closed form."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from reachmap.cli.text.validate import validation_text
from reachmap.errors import SettingsError
from reachmap.maps import read_bin_map
from reachmap.maps.parts import StageStatus
from reachmap.ranking import RankSettings
from reachmap.runtime.options import RunOptions
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.validate import PickOptions, validate
from tests.scans.test_cycle_toy import HALF, MARGIN, TOY


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    """The toy's map, and a validation of the grasps at its own test points."""
    folder = tmp_path_factory.mktemp("cycles")
    path = folder / "bin.h5"
    bin_scan(None, path, cell="planar-toy", overrides=TOY, run=RunOptions(quiet=True))
    record = read_bin_map(path)
    grasps = [
        {
            "id": f"x{k}",
            "position": record.position[0, 0, k].tolist(),
            "quaternion_wxyz": record.quaternion_wxyz[0, 0, k, 0].tolist(),
        }
        for k in range(len(record.x))
    ]
    document = {"format": "reachmap.grasps", "format_version": "1.0",
                "frame": "robot_base", "approach_axis": "+x",
                "grasps": grasps}  # fmt: skip
    (folder / "grasps.json").write_text(json.dumps(document))
    answer = validate(
        path,
        [folder / "grasps.json"],
        settings=RankSettings(cost="cycle", roll="fixed"),
        pick=PickOptions(repeats=1),
        run=RunOptions(quiet=True),
    )
    return record, answer


def test_cycles_are_found_where_the_part_fits(toy: tuple[Any, Any]) -> None:
    """A part 20 mm wide keeps 2 mm from walls 200 mm apart; planning agrees."""
    record, answer = toy
    (judged,) = answer.validation.lists
    fits = np.abs(record.x) + HALF + MARGIN < 0.1
    np.testing.assert_array_equal(judged.cycles.found, fits)
    status = judged.cycles.status
    assert (status[~fits] == StageStatus.PART_IN_COLLISION).all()
    (summary,) = answer.validation.cycles
    assert summary.confusion.true_positive == fits.sum()
    assert summary.confusion.precision.share == 1.0
    assert summary.confusion.recall.share == 1.0


def test_measured_seconds_are_at_least_those_of_the_map(toy: tuple[Any, Any]) -> None:
    """All motions of the toy are straight: no fresh plan is quicker than the map."""
    record, answer = toy
    (judged,) = answer.validation.lists
    measured = judged.cycles.measured_s
    predicted = record.cycle.cycle_time[0, 0, :, 0]
    whole = np.isfinite(measured)
    # A fresh plan takes the nearest branch; the map chose among all of them.
    assert (measured[whole] >= predicted[whole] - 1e-6).all()
    assert np.isclose(measured, predicted, rtol=1e-6).sum() >= 12
    first = answer.validation.cycles[0].orders["by seconds"]
    quickest = np.sort(measured[np.isfinite(measured)])[: first.considered]
    assert first.seconds == pytest.approx(quickest.mean())
    assert first.whole == first.considered == 10
    # As supplied, the two outermost grasps come first and fail: no part is there.
    supplied = answer.validation.cycles[0].orders["supplied"]
    lost = np.isnan(measured[:10])
    assert supplied.whole == 10 - lost.sum() < 10
    spent = np.nansum(measured[:10]) + lost.sum() * np.nanmedian(predicted)
    assert supplied.seconds_per_part == pytest.approx(spent / supplied.whole)


def test_cycles_stand_in_the_text_and_the_facts(toy: tuple[Any, Any]) -> None:
    """Precision, recall and seconds of each order; J is judged as before."""
    _, answer = toy
    text = validation_text(answer.validation)
    assert "Whole cycles re-planned with the part" in text
    assert "by seconds" in text
    (facts,) = answer.facts["cycles"]
    assert set(facts["orders"]) == {"supplied", "re-ranked", "by seconds"}
    assert answer.validation.overall.confusion.true_positive == 20


def test_a_map_without_cycles_refuses_seconds(toy_map: Any) -> None:
    """And validates ways in as ever, without a word on cycles."""
    with pytest.raises(SettingsError, match="no whole cycles"):
        validate(toy_map, random=4, settings=RankSettings(cost="cycle"))
    answer = validate(toy_map, random=4, pick=PickOptions(repeats=1))
    assert answer.validation.cycles == ()
    assert "cycles" not in answer.facts
