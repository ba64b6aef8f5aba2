"""Calibration: known rates are found again, and the diagram counts what it says."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from reachmap.cli import group
from reachmap.errors import SettingsError
from reachmap.validation.calibration import calibrate, reliability_diagram


def test_the_diagram_by_hand():
    """Two bins, one of them off by 0.35; a grasp without probability is left out."""
    p = np.array([0.05, 0.05, 0.95, 0.95, 1.0, np.nan])
    diagram = reliability_diagram(p, np.array([0, 1, 1, 1, 1, 0], bool))
    assert diagram.grasps == 5
    assert [(one.low, one.reached.hits, one.reached.total) for one in diagram.bins] == [
        (0.0, 1, 2),
        (0.9, 3, 3),
    ]
    gaps = 2 * abs(0.05 - 0.5) + 3 * abs((0.95 + 0.95 + 1.0) / 3 - 1.0)
    assert diagram.error == pytest.approx(gaps / 5)


def test_probabilities_that_are_right_have_next_to_no_error():
    """Outcomes drawn with their own probabilities; and a constant that is wrong."""
    rng = np.random.default_rng(0)
    p = rng.random(20_000)
    reached = rng.random(20_000) < p
    assert reliability_diagram(p, reached).error < 0.02
    assert reliability_diagram(np.full(20_000, 0.9), reached).error > 0.35


@pytest.mark.parametrize("rate", [lambda s: s**3, lambda s: 0.3 + 0.6 * (s > 0.5)])
def test_a_known_curve_is_found_from_other_grasps(rate):
    """Grasps that calibrate and grasps that judge are different draws."""
    rng = np.random.default_rng(1)
    share = rng.random(1500)
    found = calibrate("a" * 64, share, rng.random(1500) < rate(share), {})
    assert (np.diff(found.probability) >= 0).all()
    other = rng.random(20_000)
    fresh = rng.random(20_000) < rate(other)
    assert reliability_diagram(found(other), fresh).error < 0.05
    assert reliability_diagram(other, fresh).error > 0.1
    assert found.error < 0.06


def test_too_few_grasps_are_refused():
    """Grasps that the map says nothing about do not count."""
    share = np.r_[np.full(49, 0.5), np.full(100, np.nan)]
    with pytest.raises(SettingsError, match=r"needs 50 grasps or more .*got 49"):
        calibrate("a" * 64, share, np.ones(149, bool), {})


def run(*arguments):
    """Run the command line in this process."""
    return CliRunner().invoke(group, list(map(str, arguments)))


def test_validate_calibrates_and_rank_uses_it(folder):
    """One file beside the map; an existing one is kept unless told otherwise."""
    call = ["validate", "bin.h5", "--random", 60, "--repeats", 1, "-j", 1,
            "--no-progress", "--calibrate"]  # fmt: skip
    before = json.loads(run("rank", "toy.json").stdout)
    assert before["reachmap"]["calibration"] is None
    result = run(*call)
    assert result.exit_code == 0, result.stderr
    assert "bin.calibration.json: 60 grasps" in result.stderr
    again = run(*call)
    assert again.exit_code == 2
    assert "bin.calibration.json: exists already" in again.stderr
    after = json.loads(run("rank", "toy.json").stdout)
    assert after["reachmap"]["calibration"]["grasps"] == 60
    known = json.loads((folder / "bin.calibration.json").read_text())
    for old, new in zip(before["grasps"], after["grasps"], strict=True):
        p = np.interp(old["reachmap"]["probability"], known["share"],
                      known["probability"])  # fmt: skip
        assert new["reachmap"]["probability"] == pytest.approx(p)


def test_a_changed_cell_does_not_calibrate_the_map(folder):
    """Probabilities would be those of another cell."""
    result = run("validate", "bin.h5", "toy.json", "--calibrate", "--set", "seed=3")
    assert result.exit_code == 2
    assert "--calibrate: plans in the cell of the map" in result.stderr


def test_too_few_grasps_are_refused_before_planning(folder, monkeypatch):
    """Nobody waits for a plan to every grasp to hear that there are too few."""
    monkeypatch.setattr("reachmap.tools.validate.plan_picks", None)
    monkeypatch.setattr("reachmap.tools.validate.plan_picks_over_routes", None)
    result = run("validate", "bin.h5", "--random", 49, "--calibrate", "-j", 1)
    assert result.exit_code == 2
    assert "needs 50 grasps or more within the map (got 49)" in result.stderr


def test_a_map_with_levels_of_filling_is_calibrated(tmp_path, monkeypatch):
    """Its grasps are planned to in a bin that is filled up to each."""
    monkeypatch.chdir(tmp_path)
    levels = ["--set", "bin_scan.fill=[0.25, 1]", "--set", "bin_scan.repeats=1"]
    scan = run("bin-scan", "--cell", "planar-toy", *levels, "-j", 1, "-o", "bin.h5")
    assert scan.exit_code == 0, scan.stderr
    result = run("validate", "bin.h5", "--random", 60, "-j", 1, "--calibrate")
    assert result.exit_code == 0, result.stderr
    assert "with the bin filled up to it" in result.stderr
    known = json.loads((tmp_path / "bin.calibration.json").read_text())
    assert known["grasps"] == 60
