"""Ranking by predicted seconds: sums by hand, refusals, picks per hour."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.spatial.transform import Rotation

from reachmap.errors import SettingsError
from reachmap.maps import write_bin_map
from reachmap.maps.cycle.seconds import throughput_of
from reachmap.maps.parts import StageStatus
from reachmap.ranking import Ranker
from reachmap.ranking.lookup.costs import status_name
from reachmap.ranking.lookup.probability import Surroundings
from reachmap.ranking.lookup.queries import queries_from_arrays
from reachmap.tools.schema import schema
from tests.support.command_line import reachmap
from tests.support.cycle_maps import WAITS_S, with_cycles
from tests.support.ranking_maps import make_bin_map

DOWN = np.array([[0.0, 0.0, -1.0]])


def shares_whole(bin_map: Any, ranker: Ranker, grasps: np.ndarray) -> np.ndarray:
    """Share of what is reached around test grasps that has a whole cycle.

    From two maps: one as it is, and one where nothing else counts as reached.
    """
    queries = queries_from_arrays(
        ranker.table,
        bin_map.position[tuple(grasps[:, :3].T)],
        rotations=Rotation.from_quat(
            bin_map.quaternion_wxyz[tuple(grasps.T)], scalar_first=True
        ).as_matrix(),
        roll="fixed",
    )
    whole = np.isfinite(bin_map.cycle.cycle_time).reshape(ranker.table.reachable.shape)
    table = dataclasses.replace(ranker.table, reachable=whole)
    near = Surroundings(table).share_reached(queries)
    return np.minimum(near / ranker.share_reached(queries), 1.0)


def test_seconds_of_a_pick_by_hand():
    """Cycle, planning effort and the risk of failure, test grasp by test grasp."""
    bin_map = with_cycles()
    ranker = Ranker(bin_map)
    grasps = np.argwhere(bin_map.best.row >= 0)
    ranking = ranker.rank(
        bin_map.position[tuple(grasps[:, :3].T)],
        quaternions_wxyz=bin_map.quaternion_wxyz[tuple(grasps.T)],
        cost="cycle",
        failure_cost_s=7.0,
        roll="fixed",
    )
    share = shares_whole(bin_map, ranker, grasps)
    for row, place in enumerate(map(tuple, grasps.tolist())):
        cycle_s = bin_map.cycle.cycle_time[place]
        if np.isnan(cycle_s):
            assert ranking.cost[row] == np.inf
            assert status_name(ranking.status[row]) == "ik_in_collision"
            continue
        found = bin_map.path_found[place] == 1
        checks = bin_map.effort.checks[place][found]
        if not found.any():
            checks = np.array([bin_map.best.effort_checks[place]])
        planning_s = checks.mean() * bin_map.effort.seconds_per_check
        failing_s = 7.0 * (1 - ranking.probability[row] * share[row])
        terms = dict(zip(ranking.term_names, ranking.terms[row], strict=True))
        assert ranking.cost[row] == pytest.approx(cycle_s + planning_s + failing_s)
        assert terms["to_grasp_s"] == pytest.approx(bin_map.best.execution_time[place])
        assert terms["waits_s"] == pytest.approx(WAITS_S)
        assert terms["planning_s"] == pytest.approx(planning_s)
        assert terms["failure_s"] == pytest.approx(failing_s)
        stages = [terms[f"{name}_s"] for name in bin_map.cycle.stages]
        np.testing.assert_allclose(stages, bin_map.cycle.time[place])
    reached = np.isfinite(ranking.cost)
    assert 5 < reached.sum() < len(grasps)
    assert (np.diff(ranking.cost[ranking.order][: reached.sum()]) >= 0).all()


def test_a_failure_costs_the_median_cycle_unless_told():
    """Of the whole map, as stated with the answer."""
    bin_map = with_cycles()
    ranker: Any = Ranker(bin_map)
    whole = bin_map.cycle.cycle_time[np.isfinite(bin_map.cycle.cycle_time)]
    assert ranker.table.cycle.usual_failure_s() == pytest.approx(np.median(whole))


def test_the_stage_that_fails_is_the_state():
    """A grasp whose lift is blocked is not reached, and says so."""
    bin_map = with_cycles()
    status = bin_map.cycle.status.copy()
    status[status == StageStatus.IK_IN_COLLISION] = StageStatus.LIFT_BLOCKED
    cycle = dataclasses.replace(bin_map.cycle, status=status)
    ranker = Ranker(dataclasses.replace(bin_map, cycle=cycle))
    lost = np.argwhere((status == StageStatus.LIFT_BLOCKED).any(axis=-1))[0]
    ranking = ranker.rank(
        bin_map.position[tuple(lost[:3])],
        quaternions_wxyz=bin_map.quaternion_wxyz[tuple(lost)],
        cost="cycle",
        roll="fixed",
    )
    assert status_name(ranking.status[0]) == "lift_blocked"
    paper = ranker.rank(
        bin_map.position[tuple(lost[:3])],
        quaternions_wxyz=bin_map.quaternion_wxyz[tuple(lost)],
        roll="fixed",
    )
    assert status_name(paper.status[0]) == "path_found"


def test_what_does_not_go_with_seconds_is_refused():
    """Maps without cycles, weights, and costs that there are none of."""
    ways_in = Ranker(make_bin_map())
    point = ways_in.table.points[:1]
    with pytest.raises(SettingsError, match="no whole cycles; give the cell part"):
        ways_in.rank(point, DOWN, cost="cycle")
    ranker = Ranker(with_cycles())
    cases: list[tuple[dict[str, Any], str]] = [
        ({"weights": (1, 0, 0)}, "weights belong to cost paper"),
        ({"margins": {"clearance": 1.0}}, "weights belong to cost paper"),
        ({"neighbours": 4}, "neighbours is 1"),
        ({"failure_cost_s": -1.0}, "failure_cost_s must be 0"),
        ({"cost": "time"}, "cost must be one of paper, cycle"),
        ({"cost": "paper", "failure_cost_s": 1.0}, "needs cost cycle"),
    ]
    for changes, message in cases:
        with pytest.raises(SettingsError, match=message):
            ranker.rank(point, DOWN, **{"cost": "cycle", **changes})


def test_picks_per_hour_by_hand():
    """3600 over the mean, with the mean's normal interval; nothing of nothing."""
    made: Any = throughput_of(np.array([8.0, 12.0, np.inf]))
    assert made.picks == 2
    assert made.picks_per_hour == pytest.approx(360.0)
    error = 1.96 * np.sqrt(8.0) / np.sqrt(2)
    assert made.low == pytest.approx(3600 / (10 + error))
    assert made.high == pytest.approx(3600 / (10 - error))
    assert throughput_of(np.array([np.inf])) is None
    single: Any = throughput_of(np.array([5.0]))
    assert np.isnan(single.low)


def test_the_command_answers_in_seconds(tmp_path):
    """The JSON fits its schema, names seconds and picks per hour; the table, too."""
    bin_map = with_cycles()
    path = tmp_path / "bin.h5"
    write_bin_map(path, bin_map)
    rows = np.argwhere(np.isfinite(bin_map.cycle.cycle_time))[:6]
    grasps = [
        {
            "id": f"g{k}",
            "position": bin_map.position[tuple(row[:3])].tolist(),
            "quaternion_wxyz": bin_map.quaternion_wxyz[tuple(row)].tolist(),
        }
        for k, row in enumerate(rows)
    ]
    document = {"format": "reachmap.grasps", "format_version": "1.0",
                "frame": "robot_base", "grasps": grasps}  # fmt: skip
    (tmp_path / "grasps.json").write_text(json.dumps(document))
    usual = ("rank", "grasps.json", "--roll", "fixed", "--cost", "cycle")
    answer = reachmap(tmp_path, *usual)
    assert answer.returncode == 0, answer.stderr
    ranked = json.loads(answer.stdout)
    Draft202012Validator(schema("ranked")).validate(ranked)
    seconds = [grasp["reachmap"]["seconds"] for grasp in ranked["grasps"]]
    assert seconds == sorted(seconds)
    made = ranked["reachmap"]["picks_per_hour"]
    assert made["picks_per_hour"] == pytest.approx(3600 / np.mean(seconds))
    table = reachmap(tmp_path, *usual, "-o", "ranked.json", "--chart", "chart.svg")
    assert "picks per hour" in table.stdout
    assert "Mean time per pick" in (tmp_path / "chart.svg").read_text()
    refused = reachmap(tmp_path, *usual, "--likeness", "1")
    assert refused.returncode == 2
    assert "--cost cycle is in seconds" in refused.stderr
