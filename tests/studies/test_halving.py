"""Successive halving: poor variants are left out, said so, and nothing else changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.cli.text.study import study_lines
from reachmap.errors import SettingsError
from reachmap.maps.study.record import Study, VariantStatus
from reachmap.maps.summary.study import summarise_study
from reachmap.runtime.options import RunOptions
from reachmap.tools.halved_study import coarse, poor
from reachmap.tools.study import study

GRID = ("bin_scan.grid=[6,3]", "bin_scan.repeats=1")
VARY = ["bin.pose.xyz.0=0.15,0.35,0.55,0.75,0.95"]


def made(path: Path, **settings) -> Study:
    """A study of five places of the bin, from good to out of reach."""
    return study(
        "planar-toy",
        path,
        vary=VARY,
        overrides=GRID,
        objectives=["bin_reachability"],
        **settings,
    )


@pytest.mark.slow
def test_halving_finds_what_all_maps_find(tmp_path: Path) -> None:
    """The best is the best of the whole study; what is mapped is mapped the same."""
    every = made(tmp_path / "every.h5")
    halved = made(tmp_path / "halved.h5", halving=True)
    assert halved.best == every.best
    assert halved.base == every.base
    out = halved.status == VariantStatus.LEFT_OUT
    assert 1 <= out.sum() <= 3
    assert not out[halved.base]
    value = every.objective[:, 0]
    assert value[out].max() < value[every.best]
    for row in np.flatnonzero(~out):
        assert halved.bin_sha256[row] == every.bin_sha256[row]
        assert halved.objective[row, 0] == every.objective[row, 0]
    for row in np.flatnonzero(out):
        assert "left out after coarse maps: bin_reachability" in halved.cause[row]
        assert np.isnan(halved.objective[row]).all()
    text = "\n".join(study_lines(summarise_study(halved)))
    assert f"{out.sum()} left out" in text
    assert "Variants that were left out" in text


@pytest.mark.slow
def test_halving_is_the_same_with_more_workers(tmp_path: Path) -> None:
    """Who computes what decides nothing."""
    one, two = (
        made(
            tmp_path / f"{n}.h5",
            halving=True,
            run=RunOptions(workers=n, quiet=True),
        )
        for n in (1, 2)
    )
    assert one.stamp.config_sha256 == two.stamp.config_sha256
    assert one.cause == two.cause
    assert one.bin_sha256 == two.bin_sha256


def test_a_coarse_cell_has_fewer_points_and_the_same_rest() -> None:
    """Grids shrink along each side, never below two points, and nothing grows."""
    loaded = read_cell("ur5-eye-in-hand")
    cell = coarse(loaded, 1 / 3).cell
    assert cell.bin_scan.grid == (7, 5)
    assert cell.bin_scan.repeats == 1
    assert [cube.grid for cube in cell.workspace_scan.cubes] == [(4, 2)] * 2
    assert cell.bodies == loaded.cell.bodies
    assert coarse(loaded, 1e-3).cell.bin_scan.grid == (2, 2)


def test_an_optimiser_is_not_halved(tmp_path: Path) -> None:
    """It leaves out by itself."""
    with pytest.raises(SettingsError, match="leaves out poor variants itself"):
        made(tmp_path / "s.h5", halving=True, optimise=4)


def found(value: float, half: float = 1.0, name: str = "bin_reachability"):
    """What a coarse map has come to, with its interval."""
    outcome = {"value": value, "low": value - half, "high": value + half}
    return {"cause": "", "outcomes": {name: outcome}}


def test_only_what_is_surely_worse_is_left_out() -> None:
    """Of the worse half; never the base, nor what failed or may be as good."""
    maps = [found(90), found(40), found(88, 30), found(60), found(50), found(20, 75)]
    failed = {"cause": "no place", "outcomes": {}}
    out = poor([*range(7)], [*maps, failed], 4, "bin_reachability", ())
    # Better half: 90, 88, 60, 50; 20 ± 75 may be as good, and what failed is tried.
    assert [*out] == [1]
    assert out[1] == (
        "left out after coarse maps: bin_reachability 40 %, the best 90 %"
    )
    out = poor([*range(4)], maps[:2] + maps[3:5], 1, "bin_reachability", ())
    assert [*out] == [3]
    nothing = poor([0, 1], [failed, failed], 0, "bin_reachability", ())
    assert nothing == {}


def test_short_paths_are_the_better_ones() -> None:
    """A length is judged the other way round."""
    lengths = [found(v, 0.1, "path_length_rad") for v in (3.0, 2.0, 5.0, 4.0)]
    out = poor([*range(4)], lengths, 0, "path_length_rad", ())
    assert sorted(out) == [2, 3]
    assert "5 rad, the best 2 rad" in out[2]
