"""Studies of the planar toy: the same whatever happens, honest about noise."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from reachmap.cli.text.study import study_lines
from reachmap.errors import CellError, SettingsError
from reachmap.maps.comparison.significance import (
    clustered_shares,
    paired_interval,
    paired_means,
)
from reachmap.maps.study.format import read_study
from reachmap.maps.study.record import Study
from reachmap.maps.study.words import sentence
from reachmap.maps.summary.study import main_effect, summarise_study
from reachmap.runtime.options import RunOptions
from reachmap.runtime.store import store_path
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.place_bin import place_bin
from reachmap.tools.study import study
from reachmap.tools.workspace_scan import workspace_scan
from tests.support.command_line import reachmap

CUBE = '{"name":"all","min":[-0.6,-0.6,0],"max":[0.6,0.6,0],"grid":[7,7]}'
SMALL = (f"workspace_scan.cubes=[{CUBE}]", "bin_scan.grid=[3,2]", "bin_scan.repeats=1")
RADIUS = "bodies.post.shape.cylinder.radius"
HEIGHT = "bodies.post.shape.cylinder.length"
MAPS = ("workspace", "placement", "bin")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Two radii of the post by two places of the bin, and a radius that is none."""
    return study(
        "planar-toy",
        tmp_path_factory.mktemp("study") / "study.h5",
        vary=[f"{RADIUS}=0.01,0.035,-1", "bin.pose.xyz.0=0.15,0.25"],
        overrides=SMALL,
    )


def test_maps_are_those_of_separate_runs(small: Study, tmp_path: Path) -> None:
    """By content hash, though variants share the work of their workspace maps."""
    for row in (0, 3):
        changes = (*SMALL, *small.assignment[row].split(", "))
        one = tmp_path / f"{row}.h5"
        workspace_scan("planar-toy", one, overrides=changes)
        bin_scan(None, tmp_path / f"bin{row}.h5", cell="planar-toy", overrides=changes)
        from reachmap.maps import read_bin_map, read_workspace_map

        made = read_workspace_map(one)
        assert small.workspace_sha256[row] == made.stamp.content_sha256
        assert small.cell_sha256[row] == made.stamp.cell_sha256
        bin_map = read_bin_map(tmp_path / f"bin{row}.h5")
        assert small.bin_sha256[row] == bin_map.stamp.content_sha256
        reached = 100.0 * (bin_map.status == 1).mean()
        assert small.objective[row, 0] == pytest.approx(reached)


def test_a_wrong_variant_is_a_row_with_its_cause(small: Study) -> None:
    """The others are done; its numbers are NaN."""
    assert small.status.tolist() == [1, 1, 1, 1, 2, 2]
    assert "radius" in small.cause[4]
    assert np.isnan(small.objective[4:]).all()
    assert small.cell_sha256[4] == ""
    assert (small.base, small.best) == (0, 0)


def test_what_is_wrong_in_every_variant_is_wrong_input(tmp_path: Path) -> None:
    """A misspelt key ends the study before any work."""
    with pytest.raises(CellError, match="did you mean 'pose'"):
        study("planar-toy", tmp_path / "s.h5", vary=["bin.pse.xyz=1,2"])
    with pytest.raises(SettingsError, match="expected 'NAME >= NUMBER'"):
        study("planar-toy", tmp_path / "s.h5", vary=["seed=1,2"], require=["x > 1"])
    assert not [*tmp_path.iterdir()]


def test_a_study_whose_variants_all_fail_ends_as_wrong_input(tmp_path: Path) -> None:
    """Like a cell that cannot be read at all; its file still tells the causes."""
    made = reachmap(
        tmp_path, "study", "planar-toy", "--require", "points >= 1", "-o", "s.h5", "-q",
        "--vary", "scan_configuration.q_deg.joint_1=0,1",
    )  # fmt: skip
    assert made.returncode == 2
    lines = made.stderr.splitlines()
    assert [line for line in lines if "no variant could be mapped" in line] == lines[
        -1:
    ]
    assert "link_1 touches post" in lines[-1]
    assert "Variants that failed" in made.stdout
    assert all("touches" in cause for cause in read_study(tmp_path / "s.h5").cause)


@pytest.mark.parametrize("mode", ["--place", "--keep-bin"])
def test_a_bin_that_leans_is_placed_upright_with_a_warning(
    tmp_path: Path, mode: str
) -> None:
    """Where the bin stays, its lean does."""
    made = reachmap(
        tmp_path, "study", "planar-toy", mode, "-o", "s.h5", "-j", "1",
        "--set", "bin.pose={xyz: [0.3, 0.3, -0.2], rpy_deg: [0, 20, 0]}",
        "--vary", "scan_configuration.q_deg.joint_1=0,1",
    )  # fmt: skip
    assert made.returncode == 2, made.stderr
    assert ("it is placed upright" in made.stderr) == (mode == "--place")


@pytest.mark.slow
def test_a_placed_bin_is_that_of_place_bin(tmp_path: Path) -> None:
    """With --place each variant rests on a placement, by content hash."""
    limits = (*SMALL, "placement.z=[-0.2,-0.2]")
    made = study(
        "planar-toy",
        tmp_path / "study.h5",
        vary=[f"{RADIUS}=0.01,0.02"],
        overrides=limits,
        place=True,
        objectives=["bin_reachability"],
    )
    changes = (*limits, made.assignment[1])
    workspace_scan("planar-toy", tmp_path / "w.h5", overrides=changes)
    placed = place_bin(tmp_path / "w.h5", tmp_path / "p.h5")
    from reachmap.maps import read_placement

    assert placed.rule == "search"
    stored = read_placement(tmp_path / "p.h5").stamp.content_sha256
    assert made.placement_sha256[1] == stored
    bin_map = bin_scan(tmp_path / "p.h5", tmp_path / "b.h5")
    assert bin_map is not None
    assert made.objective[1, 0] == pytest.approx(100 * (bin_map.status == 1).mean())


@pytest.mark.slow
def test_the_study_does_not_depend_on_workers(small: Study, tmp_path: Path) -> None:
    """Two workers, the same content."""
    output = tmp_path / "study.h5"
    study(
        "planar-toy",
        output,
        vary=[f"{RADIUS}=0.01,0.035,-1", "bin.pose.xyz.0=0.15,0.25"],
        overrides=SMALL,
        run=RunOptions(workers=2),
    )
    again = read_study(output)
    for name in ("objective", "change_low", "p_value", "pairs", "parameter"):
        assert np.array_equal(getattr(small, name), getattr(again, name), True)
    assert again.bin_sha256 == small.bin_sha256


@pytest.mark.slow
def test_a_killed_study_goes_on_to_the_same_content(tmp_path: Path) -> None:
    """SIGKILL at several moments; what was done is not done again."""
    arguments = ["study", "planar-toy", "-j", "1", "--vary", f"{RADIUS}=0.01:0.03:3"]
    arguments += [part for text in SMALL for part in ("--set", text)]
    for name in ("whole", "killed"):
        (tmp_path / name).mkdir()
    assert reachmap(tmp_path / "whole", *arguments).returncode == 0
    folder = tmp_path / "killed"
    sizes = []
    for _ in range(3):
        process = subprocess.Popen(
            [sys.executable, "-m", "reachmap", *arguments],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        store = store_path(folder / "study.h5")
        before = store.stat().st_size if store.exists() else 0
        deadline = time.monotonic() + 100
        while process.poll() is None and time.monotonic() < deadline:
            if store.exists() and store.stat().st_size > before + 2000:
                break
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        sizes.append(store.stat().st_size if store.exists() else -1)
    done = reachmap(folder, *arguments)
    assert done.returncode == 0, done.stderr
    assert max(sizes) > 2000
    whole, killed = (
        read_study(tmp_path / name / "study.h5").stamp.content_sha256
        for name in ("whole", "killed")
    )
    assert whole == killed


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))]
)
def test_nothing_is_called_nothing_and_an_effect_an_effect(
    seed: int, tmp_path: Path
) -> None:
    """A longer post does nothing in the plane; a thicker one blocks joint 1."""
    made = study(
        "planar-toy",
        tmp_path / "study.h5",
        vary=[f"{HEIGHT}=0.10,0.14", f"{RADIUS}=0.01,0.035"],
        overrides=SMALL,
        objectives=["level_average"],
        seed=seed,
    )
    # Rows: (0.10, 0.01), (0.10, 0.035), (0.14, 0.01), (0.14, 0.035).
    assert made.significant[:, 0].tolist() == [0, 1, 0, 1]
    assert made.gained[2, 0] == made.lost[2, 0] == 0
    assert "+0.0 points, not distinguishable from" in sentence(made, 2, 0)
    assert sentence(made, 1, 0).startswith(f"{RADIUS} 0.01 → 0.035: level_average −")
    effects = [main_effect(made, k, 0) for k in range(2)]
    nothing, effect = (found.mean for found in effects)
    assert nothing[0] == nothing[1]
    # Means of two: half the root of the squares of their own halves.
    for k, rows in enumerate(([0, 2], [1, 3])):
        value = made.objective[rows, 0]
        low, high = (
            np.hypot(*(bound[rows, 0] - value)) / 2
            for bound in (made.objective_low, made.objective_high)
        )
        assert effects[1].low[k] == pytest.approx(value.mean() - low)
        assert effects[1].high[k] == pytest.approx(value.mean() + high)
        assert 0.0 < low < 100.0
    assert effect[1] < effect[0]
    # The closed form of the toy: joint 1 is blocked within asin((r + 0.012) / 0.06).
    blocked = [np.arcsin((r + 0.012) / 0.06) for r in (0.01, 0.035)]
    assert blocked[1] > 2 * blocked[0]


def test_a_study_needs_no_map_that_no_objective_rests_on(tmp_path: Path) -> None:
    """Level averages need no bin map, bin reachability no workspace map."""
    only = {}
    for name in ("level_average", "points"):
        only[name] = study(
            "planar-toy",
            tmp_path / f"{name}.h5",
            vary=["bin.wall=0.01,0.02"],
            overrides=SMALL,
            objectives=[name],
        )
    assert set(only["level_average"].bin_sha256) == {""}
    assert set(only["points"].workspace_sha256) == {""}


def test_intervals_hold_what_they_say() -> None:
    """Coverage of the paired interval by simulation; the t-test against scipy's."""
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(2000):
        gained, lost, _ = rng.multinomial(300, [0.04, 0.02, 0.94])
        low, high = paired_interval(int(gained), int(lost), 300)
        inside += low <= 0.02 <= high
    assert 0.93 < inside / 2000 < 0.98
    values = rng.normal(0.3, 1.0, 40)
    mean, low, high, p_value = paired_means(values)
    oracle = stats.ttest_1samp(values, 0.0)
    assert p_value == pytest.approx(oracle.pvalue)
    ends = oracle.confidence_interval(0.95)
    assert (low, high) == pytest.approx((ends.low, ends.high))
    assert mean == pytest.approx(values.mean())


def test_intervals_hold_where_frames_fail_together() -> None:
    """Points of nine frames that change alike: coverage by simulation, no more."""
    rng = np.random.default_rng(7)
    cluster, inside = np.repeat(np.arange(80), 9), 0
    for _ in range(1000):
        of_point = rng.choice([1.0, -1.0, 0.0], 80, p=[0.2, 0.1, 0.7])
        _, low, high = clustered_shares(np.repeat(of_point, 9), cluster)
        inside += low <= 0.1 <= high
    assert 0.92 < inside / 1000 < 0.975


@pytest.mark.slow
def test_the_commands_read_a_study(tmp_path: Path) -> None:
    """study, info, verify and heatmap; a requirement that nobody meets is exit 1."""
    arguments = ["study", "planar-toy", "-j", "1", "--vary", f"{RADIUS}=0.01,0.035"]
    arguments += ["--objective", "level_average"]
    arguments += [part for text in SMALL for part in ("--set", text)]
    made = reachmap(tmp_path, *arguments, "--require", "level_average >= 25")
    assert made.returncode == 0, made.stderr
    assert f"best: {RADIUS}=0.01: level_average" in made.stdout
    assert "below the requirements" in made.stdout
    shown = reachmap(tmp_path, "info", "study.h5")
    assert f"{RADIUS} 0.01 → 0.035: level_average −" in shown.stdout
    assert "study, whole" in reachmap(tmp_path, "verify", "study.h5").stdout
    drawn = reachmap(tmp_path, "heatmap", "study.h5").stdout.split()
    assert drawn == ["heatmaps/effects_level_average.png"]
    assert (tmp_path / drawn[0]).read_bytes().startswith(b"\x89PNG")
    none = reachmap(tmp_path, *arguments, "-o", "s.h5", "--require", "level_average>99")
    assert none.returncode == 1
    assert "no variant meets level_average > 99" in none.stderr


def test_an_optimised_study_is_the_same_when_it_is_resumed(tmp_path: Path) -> None:
    """Rounds that were done are not done again; the cell as it is comes first."""
    output = tmp_path / "study.h5"

    def optimised(count: int) -> Study:
        return study(
            "planar-toy",
            output,
            vary=[f"{RADIUS}=0.01,0.02,0.035", "bin.pose.xyz.0=0.1:0.3:5"],
            optimise=count,
            objectives=["bin_reachability"],
            overrides=SMALL,
            run=RunOptions(overwrite=True, quiet=True),
        )

    made = optimised(6)
    assert made.design == "optimised"
    assert made.assignment[0] == f"{RADIUS}=0.01, bin.pose.xyz.0=0.15"
    assert made.base == 0
    assert len(set(made.assignment)) == 6
    assert made.best == int(np.argmax(made.objective[:, 0]))
    again = optimised(6)
    assert again.stamp == made.stamp
    assert np.array_equal(again.objective, made.objective)


def test_what_is_wrong_with_every_variant_is_told_as_it_was_given(
    tmp_path: Path,
) -> None:
    """By the option, not as an override that nobody made."""
    with pytest.raises(CellError, match="did you mean 'wall'") as told:
        study("planar-toy", tmp_path / "s.h5", vary=["bin.wal=0.01,0.02"])
    assert told.value.lines[0].startswith("--vary bin.wal=0.02: bin has no key")


def test_a_study_of_which_nothing_can_be_mapped_says_so(tmp_path: Path) -> None:
    """Nothing was required, so no requirement is to blame."""
    made = study(
        "planar-toy",
        tmp_path / "s.h5",
        vary=["scan_configuration.q_deg.joint_1=0,5"],
        objectives=["bin_reachability"],
        overrides=SMALL,
    )
    assert not made.done.any()
    said = study_lines(summarise_study(made))
    assert "best: none, no variant could be mapped" in said


def test_two_designs_are_refused(tmp_path: Path) -> None:
    """A Latin hypercube is not optimised."""
    with pytest.raises(SettingsError, match="not both"):
        study("planar-toy", tmp_path / "s.h5", vary=["seed=1,2"], samples=3, optimise=3)
