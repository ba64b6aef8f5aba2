"""J is a function of the map's content: equal hashes rank every list alike."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from reachmap.cli import group
from reachmap.maps import read_bin_map, write_bin_map
from reachmap.ranking import (
    CostBasis,
    Ranker,
    document_text,
    rank_list,
    ranked_document,
)
from reachmap.validation.random_grasps import random_grasps
from tests.support.optional import present
from tests.support.synthetic_maps import synthetic_bin_map
from tests.support.synthetic_parts import bin_with_parts

LISTS = 20
MEASURED_TIMES = ("planning_time", "planning_cpu_time", "simplification_time")


def documents(ranker: Ranker, bin_map) -> list[str]:
    """Ranked documents of twenty lists of thirty random grasps."""
    lists = (random_grasps(bin_map, 30, seed) for seed in range(LISTS))
    return [document_text(ranked_document(rank_list(one, ranker))) for one in lists]


@pytest.fixture(scope="module")
def two_maps(tmp_path_factory):
    """One scan on a quiet machine and on a busy one, as files."""
    folder = tmp_path_factory.mktemp("maps")
    record = bin_with_parts(synthetic_bin_map(0.7, shape=(1, 6, 8, 5, 3)))
    rng = np.random.default_rng(8)
    busy = {
        name: getattr(record, name) * rng.lognormal(0, 1, record.path_found.shape)
        for name in MEASURED_TIMES
    }
    paths = folder / "quiet.h5", folder / "busy.h5"
    hashes = {
        write_bin_map(paths[0], record),
        write_bin_map(paths[1], dataclasses.replace(record, **busy)),
    }
    assert len(hashes) == 1
    return [read_bin_map(path) for path in paths]


def test_maps_of_one_hash_rank_twenty_lists_identically(two_maps):
    """To the last digit of every cost, whatever the clocks said."""
    rankers = [Ranker(one) for one in two_maps]
    assert rankers[0].cost_table_sha256 == rankers[1].cost_table_sha256
    quiet, busy = (
        documents(ranker, one) for ranker, one in zip(rankers, two_maps, strict=True)
    )
    assert quiet == busy


def test_measured_times_would_rank_them_differently(two_maps):
    """The paper's J is still to be had, and depends on the run."""
    basis = CostBasis(planning_time="measured")
    rankers = [Ranker(one, basis) for one in two_maps]
    assert rankers[0].cost_table_sha256 != rankers[1].cost_table_sha256
    quiet, busy = (
        documents(ranker, one) for ranker, one in zip(rankers, two_maps, strict=True)
    )
    orders = [
        [[grasp["id"] for grasp in json.loads(text)["grasps"]] for text in texts]
        for texts in (quiet, busy)
    ]
    assert sum(a != b for a, b in zip(*orders, strict=True)) > LISTS / 2


def test_a_list_names_what_it_was_ranked_with(two_maps):
    """Content hash of the map, hash of the costs, and what they are made of."""
    ranker = Ranker(two_maps[0])
    said = json.loads(documents(ranker, two_maps[0])[0])["reachmap"]
    assert said["map_sha256"] == two_maps[0].stamp.content_sha256
    assert said["cost_table_sha256"] == ranker.cost_table_sha256
    assert (said["normalise"], said["planning_time"]) == ("quantile", "checks")


def test_a_map_without_counts_falls_back_and_says_so(two_maps, tmp_path, monkeypatch):
    """Files of version 1.0 hold measured times only; the warning goes to stderr."""
    monkeypatch.chdir(tmp_path)
    write_bin_map(Path("bin.h5"), dataclasses.replace(two_maps[0], effort=None))
    lists = [random_grasps(two_maps[0], 5, 1)]
    Path("grasps.json").write_text(json.dumps(lists[0].document))
    answer = CliRunner().invoke(group, ["rank", "grasps.json"])
    assert answer.exit_code == 0
    assert "no counts of state checks" in answer.stderr
    assert json.loads(answer.stdout)["reachmap"]["planning_time"] == "measured"
    asked = ["rank", "grasps.json", "--planning-time", "measured"]
    assert "no counts" not in CliRunner().invoke(group, asked).stderr


def test_the_roadmap_s_own_path_has_a_cost():
    """Where every attempt missed it, the best path is looked up; nothing is lost."""
    found = np.zeros((1, 2, 3, 4, 2), bool)
    found[0, 0] = True
    record = bin_with_parts(
        synthetic_bin_map(found, connected=np.ones((1, 2, 3, 4), bool))
    )
    table = Ranker(record).table
    assert table.reachable.all()
    means = table.means.reshape(1, 2, 3, 4, 3)[0, 1]
    best, effort = present(record.best), present(record.effort)
    np.testing.assert_array_equal(means[..., 0], best.path_length[0, 1])
    seconds = best.effort_checks * effort.seconds_per_check
    np.testing.assert_allclose(means[..., 1], seconds[0, 1])
    np.testing.assert_array_equal(means[..., 2], best.execution_time[0, 1])
    old = Ranker(dataclasses.replace(record, best=None)).table
    assert not old.reachable.reshape(1, 2, 3, 4)[0, 1].any()


def test_the_recommended_orientation_is_the_roll_that_won():
    """R_test times a rotation about the approach axis, by SciPy's rotations."""
    record = bin_with_parts(synthetic_bin_map(1.0, shape=(1, 2, 2, 3, 1)))
    ranker = Ranker(record)
    points = np.repeat(record.position.reshape(-1, 3), 3, axis=0)
    R_test = Rotation.from_quat(
        np.roll(record.quaternion_wxyz.reshape(-1, 4), -1, axis=1)
    )
    ranking = ranker.rank(points, rotations=R_test.as_matrix())
    roll = present(record.winning_roll).reshape(-1, 1)
    turn = Rotation.from_rotvec(roll * [0.0, 0.0, 1.0])
    got = Rotation.from_quat(np.roll(ranking.orientation_wxyz, -1, axis=1))
    assert (got.inv() * (R_test * turn)).magnitude().max() < 1e-7


@pytest.mark.slow
def test_two_runs_of_a_scan_rank_every_list_identically(tmp_path, monkeypatch):
    """Scanned twice, with one worker and with two."""
    monkeypatch.chdir(tmp_path)
    texts = []
    for workers in ("1", "2"):
        name = f"bin{workers}.h5"
        arguments = ["bin-scan", "--cell", "planar-toy", "-o", name, "-j", workers]
        answer = CliRunner().invoke(group, [*arguments, "--no-progress"])
        assert answer.exit_code == 0, answer.output
        bin_map = read_bin_map(Path(name))
        texts.append(documents(Ranker(bin_map), bin_map))
    assert texts[0] == texts[1]
