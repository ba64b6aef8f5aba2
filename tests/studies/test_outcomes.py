"""Objectives of a bin map against what else is known of the same map."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.errors import SettingsError
from reachmap.maps.records import Status
from reachmap.maps.study.record import OBJECTIVES
from reachmap.maps.summary.bin import clearance_shares
from reachmap.maps.summary.emptying import emptying_of
from reachmap.runtime.options import RunOptions
from reachmap.studies.assembly import best_rows
from reachmap.studies.outcomes import compare_outcomes, of_bin
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.study import study

LAYERS = ("bin_scan.grid=[3,2]", "bin_scan.repeats=1", "bin_scan.layers=[0.1,0.2]")


@pytest.fixture(scope="module")
def bin_map(tmp_path_factory):
    """The toy's bin at two heights, of which the lower is out of the plane."""
    output = tmp_path_factory.mktemp("outcomes") / "bin.h5"
    return bin_scan(
        None, output, cell="planar-toy", overrides=LAYERS, run=RunOptions(quiet=True)
    )


def test_objectives_agree_with_the_summaries(bin_map):
    """Share by share and mean by mean."""
    found = of_bin(bin_map)
    hit = bin_map.status == Status.PATH_FOUND
    assert found["bin_reachability"].value == pytest.approx(100 * hit.mean())
    assert found["motion_time_s"].value == pytest.approx(
        np.nanmean(bin_map.best.execution_time)
    )
    ten_mm = next(s for s in clearance_shares(bin_map) if s.clearance_m == 0.010)
    assert found["robust_reachability"].value == pytest.approx(ten_mm.frames)
    emptying = emptying_of(bin_map)
    assert emptying is not None
    assert found["emptied"].value == pytest.approx(100 - emptying.left)
    assert "cycle_time_s" not in found
    assert set(found) <= set(OBJECTIVES)


def test_a_map_does_not_differ_from_itself(bin_map):
    """No change, and nothing significant, whatever the objective."""
    found = of_bin(bin_map)
    for name, outcomes in found.items():
        change = compare_outcomes(name, outcomes, outcomes)
        assert change.change == 0.0
        assert change.p_value == 1.0
        assert (change.gained, change.lost) == (0, 0)


@pytest.mark.parametrize("name", ["cycle_time_s", "emptied"])
def test_what_a_cell_does_not_have_is_refused(name, tmp_path):
    """A cycle needs a part, emptying needs layers."""
    with pytest.raises(SettingsError, match=f"{name}: "):
        study("planar-toy", tmp_path / "s.h5", vary=["seed=1,2"], objectives=[name])
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("costs", "base", "wanted"),
    [
        ([3.0, 1.0, 1.0, 2.0], 2, (2, 1)),
        ([3.0, 1.0, 1.0, 2.0], 0, (1, 2)),
        ([np.nan, 2.0], 0, (1, -1)),
        ([np.nan, np.nan], 1, (-1, -1)),
    ],
)
def test_of_equal_variants_the_base_is_the_best(costs, base, wanted):
    """A change that gains nothing is not proposed; what failed is never chosen."""
    assert best_rows(np.array(costs)[:, None], base) == wanted


def test_of_equal_changes_the_next_objective_decides():
    """The base stays first; a cost that is not known comes last."""
    costs = np.array([[1.0, 4.0], [1.0, 3.0], [1.0, 2.0], [1.0, np.nan], [2.0, 0.0]])
    assert best_rows(costs, 4) == (2, 1)
    assert best_rows(costs, 0) == (0, 2)
    assert best_rows(costs[[3, 0]], -1) == (1, 0)
