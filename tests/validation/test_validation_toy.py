"""Predictions and findings on the planar toy arm, whose truth is a closed form."""

from __future__ import annotations

import json

import numpy as np
import pytest

from reachmap.maps import Status, read_bin_map
from reachmap.ranking import RankSettings
from reachmap.runtime.options import RunOptions
from reachmap.tools.validate import PickOptions, validate
from tests.support.optional import present
from tests.support.toy_truth import clear_rows, slack_of, toy_grasps

COUNT = 60
ROWS = clear_rows(COUNT, seed=1)
TRUTH = np.array([slack_of(*row) > 0 for row in ROWS])


@pytest.fixture(scope="module")
def answer(toy_map, tmp_path_factory):
    """Sixty oriented grasps, planned to three times each."""
    path = tmp_path_factory.mktemp("lists") / "toy.json"
    path.write_text(json.dumps(toy_grasps(ROWS)))
    return validate(toy_map, [path], pick=PickOptions(repeats=3, seed=5))


def nearest_slack(bin_map, row):
    """Slack of the test grasp that Algorithm 1 picks, by plain loops."""
    p = np.array([row[0], row[1], 0.0])
    distance = np.linalg.norm(bin_map.position - p, axis=-1)
    point = np.unravel_index(np.argmin(distance), distance.shape)
    q = bin_map.quaternion_wxyz[point]
    yaws = 2 * np.arctan2(q[:, 3], q[:, 0])
    turn = np.abs((yaws - row[2] + np.pi) % (2 * np.pi) - np.pi)
    x, y = bin_map.position[point][:2]
    return slack_of(x, y, yaws[np.argmin(turn)])


def test_planning_finds_the_closed_form(answer):
    """A grasp is reached exactly where the arm's geometry says that it can be."""
    (judged,) = answer.validation.lists
    assert 0.2 < TRUTH.mean() < 0.9
    np.testing.assert_array_equal(judged.reached, TRUTH)
    causes = judged.results.status[~TRUTH]
    assert set(causes.tolist()) <= {Status.NO_IK, Status.IK_IN_COLLISION,
                                    Status.NO_PATH_FOUND}  # fmt: skip
    assert (judged.results.status[TRUTH] == Status.PATH_FOUND).all()


def test_the_confusion_matrix_follows_from_geometry(answer, toy_map):
    """Predicted and found, both from closed forms, give the same four counts."""
    bin_map = read_bin_map(toy_map)
    predicted = np.array([nearest_slack(bin_map, row) > 0 for row in ROWS])
    c = answer.validation.overall.confusion
    assert c.true_positive == (predicted & TRUTH).sum()
    assert c.false_positive == (predicted & ~TRUTH).sum() > 0
    assert c.false_negative == (~predicted & TRUTH).sum()
    assert c.true_negative == (~predicted & ~TRUTH).sum() > 0
    assert c.outside_reached == c.outside_missed == 0


def test_measured_costs_are_the_map_s_own_measure(answer, toy_map):
    """J is the mean of path, state checks and execution time over 95 % quantiles."""
    bin_map = read_bin_map(toy_map)
    found = bin_map.path_found == 1
    # One attempt per test grasp, so that each value is its own mean.
    maxima = [
        np.percentile(values[found], 95)
        for values in (
            bin_map.path_length,
            present(bin_map.effort).checks,
            bin_map.execution_time,
        )
    ]
    (judged,) = answer.validation.lists
    values = judged.results.measured[TRUTH][..., [0, 4, 6]].copy()
    checks = judged.results.checks[TRUTH]
    values[..., 1] = np.where(np.isnan(values[..., 0]), np.nan, checks)
    by_hand = (np.nanmean(values, axis=1) / maxima).sum(axis=1)
    np.testing.assert_allclose(judged.cost[TRUTH], by_hand)
    assert np.isinf(judged.cost[~TRUTH]).all()
    first = np.nanmean((values[:, ::2] / maxima).sum(axis=-1), axis=1)
    np.testing.assert_allclose(judged.halves[TRUTH, 0], first)


def test_groups_average_the_first_of_each_order(answer):
    """By quadrant of the bin: N is +y of the bin, E is +x; ties in supplied order."""
    (judged,) = answer.validation.lists
    for group in answer.validation.groups:
        north, east = group.label[0] == "N", group.label[1] == "E"
        inside = ((ROWS[:, 1] >= 0.22) == north) & ((ROWS[:, 0] >= 0.42) == east)
        rows = np.flatnonzero(inside)
        assert group.grasps == len(rows)
        predicted = judged.predicted_cost[rows]
        best_first = rows[np.argsort(np.round(predicted, 12), kind="stable")]
        for name, order in (("supplied", rows), ("re-ranked", best_first)):
            first = order[:10]
            reached = first[TRUTH[first]]
            figures = group.orders[name]
            assert (figures.considered, figures.reached) == (len(first), len(reached))
            assert figures.cost == pytest.approx(judged.cost[reached].mean())
            hits = np.flatnonzero(TRUTH[order])
            assert figures.calls_first == hits[0] + 1


def test_the_ik_only_order_looks_at_solutions_alone(answer, toy_map):
    """Grasps whose test grasp has a solution come first, as supplied."""
    bin_map = read_bin_map(toy_map)
    (judged,) = answer.validation.lists
    solved = bin_map.status != Status.NO_IK
    expected = []
    for row in ROWS:
        p = np.array([row[0], row[1], 0.0])
        distance = np.linalg.norm(bin_map.position - p, axis=-1)
        point = np.unravel_index(np.argmin(distance), distance.shape)
        q = bin_map.quaternion_wxyz[point]
        turn = np.abs((2 * np.arctan2(q[:, 3], q[:, 0]) - row[2] + np.pi)
                      % (2 * np.pi) - np.pi)  # fmt: skip
        expected.append(bool(solved[(*point, np.argmin(turn))]))
    order = judged.orders["ik-only"]
    np.testing.assert_array_equal(order, np.argsort(~np.array(expected), kind="stable"))


def test_directions_take_any_roll(toy_map, tmp_path):
    """In the plane of the arm the recommended roll is the only one that fits."""
    rows = ROWS[:20]
    document = toy_grasps(rows)
    for grasp, (_, _, yaw) in zip(document["grasps"], rows, strict=True):
        del grasp["quaternion_wxyz"]
        grasp["direction"] = [float(np.cos(yaw)), float(np.sin(yaw)), 0.0]
    path = tmp_path / "directions.json"
    path.write_text(json.dumps(document))
    answer = validate(toy_map, [path], pick=PickOptions(repeats=1, rolls=6))
    (judged,) = answer.validation.lists
    np.testing.assert_array_equal(judged.reached, TRUTH[:20])
    np.testing.assert_array_equal(judged.reached_as_recommended, TRUTH[:20])
    assert (judged.results.poses == 6).all()
    assert (judged.results.poses_free[TRUTH[:20]] == 1).all()


def test_other_poses_are_tried_when_the_recommended_one_fails(toy_map, tmp_path):
    """With the roll of oriented grasps freed, the turned-over tool may still fit."""
    rows = ROWS[TRUTH][:4]
    document = toy_grasps(rows)
    path = tmp_path / "toy.json"
    path.write_text(json.dumps(document))
    answer = validate(
        toy_map,
        [path],
        settings=RankSettings(roll="free"),
        pick=PickOptions(repeats=1, rolls=2),
    )
    (judged,) = answer.validation.lists
    assert (judged.results.pose.ravel() == 0).all()
    assert (judged.results.poses == 2).all()


def test_grasps_outside_the_map_are_counted_apart(toy_map, tmp_path):
    """A grasp that the map says nothing about is neither a hit nor a miss of it."""
    rows = np.array([[-0.3, 0.4, 3.0], [0.42, 0.22, 1.0], [1.5, 0.0, 0.0]])
    assert slack_of(*rows[0]) > 0.01
    path = tmp_path / "toy.json"
    path.write_text(json.dumps(toy_grasps(rows)))
    c = validate(toy_map, [path]).validation.overall.confusion
    assert (c.outside_reached, c.outside_missed) == (1, 1)
    assert c.true_positive + c.false_positive + c.false_negative + c.true_negative == 1


def test_verdicts_do_not_depend_on_workers(toy_map, tmp_path):
    """One process or two: the same paths, found with the same checks."""
    path = tmp_path / "toy.json"
    path.write_text(json.dumps(toy_grasps(ROWS[:12])))

    def results(workers):
        answer = validate(
            toy_map, [path], random=3, run=RunOptions(workers=workers), top=5
        )
        return [one.results for one in answer.validation.lists]

    for one, two in zip(results(1), results(2), strict=True):
        for name in (
            "status",
            "blocking_pair",
            "poses_free",
            "found",
            "pose",
            "checks",
        ):
            np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
        np.testing.assert_array_equal(one.measured[..., :3], two.measured[..., :3])


def test_a_list_has_the_same_verdicts_in_any_company(toy_map, tmp_path):
    """Attempts are seeded by the place in the list, not by what was named before."""
    for name, rows in (("a", ROWS[:6]), ("b", ROWS[6:12])):
        (tmp_path / f"{name}.json").write_text(json.dumps(toy_grasps(rows)))
    alone = validate(toy_map, [tmp_path / "b.json"]).validation.lists[0]
    both = validate(toy_map, [tmp_path / "a.json", tmp_path / "b.json"]).validation
    np.testing.assert_array_equal(alone.results.checks, both.lists[1].results.checks)
    np.testing.assert_array_equal(
        alone.results.measured[..., :3], both.lists[1].results.measured[..., :3]
    )
    assert [one.label for one in both.summaries] == ["a", "b", "all"]
    assert both.overall.grasps == 12
