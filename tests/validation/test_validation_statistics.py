"""Shares, correlations and expected calls against brute force and hand counts."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from reachmap.maps.comparison.significance import Z_95
from reachmap.validation.statistics import (
    confusion_of,
    expected_calls,
    rank_correlation,
    share_of,
)


@pytest.mark.parametrize(("hits", "total"), [(0, 7), (5, 9), (96, 100), (12, 12)])
def test_intervals_end_where_the_score_test_rejects(hits, total):
    """A Wilson bound p solves (p̂ − p)² = z² p (1 − p) / n, or is 0 or 1."""
    share = share_of(hits, total)
    assert share.low <= share.share <= share.high
    for bound in (share.low, share.high):
        gap = (share.share - bound) ** 2 - Z_95**2 * bound * (1 - bound) / total
        assert gap == pytest.approx(0.0, abs=1e-12)


def test_a_share_of_nothing_is_unknown():
    """No grasp, no percentage."""
    assert np.isnan([share_of(0, 0).share, share_of(0, 0).low]).all()


def test_counts_by_prediction_and_finding():
    """Ten grasps counted by hand; those outside the map in neither prediction."""
    predicted = np.array([1, 1, 1, 1, 0, 0, 0, 0, 0, 0], bool)
    reached = np.array([1, 1, 1, 0, 1, 0, 0, 1, 1, 0], bool)
    outside = np.array([0, 0, 0, 0, 0, 0, 0, 1, 1, 1], bool)
    counts = confusion_of(predicted, reached, outside)
    assert (counts.true_positive, counts.false_positive) == (3, 1)
    assert (counts.false_negative, counts.true_negative) == (1, 2)
    assert (counts.outside_reached, counts.outside_missed) == (2, 1)
    assert counts.precision.share == 3 / 4
    assert counts.recall.share == 3 / 4
    assert counts.false_positive_rate.share == 1 / 3
    assert counts.agreement.share == 5 / 7


def average_ranks(values):
    """Rank of each value, equal ones sharing the mean of their places."""
    smaller = (values[None] < values[:, None]).sum(axis=1)
    equal = (values[None] == values[:, None]).sum(axis=1)
    return smaller + (equal + 1) / 2


def tau_b(a, b):
    """Kendall's τ-b, pair by pair."""
    first, second = np.triu_indices(len(a), 1)
    u, v = np.sign(a[first] - a[second]), np.sign(b[first] - b[second])
    return (u @ v) / np.sqrt((u @ u) * (v @ v))


def test_rank_correlation_is_what_its_definition_says():
    """Pearson of average ranks, and concordant pairs; ties included."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        a, b = rng.integers(0, 6, (2, 12)).astype(float)
        found = rank_correlation(a, b)
        ranks = np.corrcoef(average_ranks(a), average_ranks(b))[0, 1]
        assert found.spearman == pytest.approx(ranks)
        assert found.kendall == pytest.approx(tau_b(a, b))


def test_rank_correlation_leaves_out_what_has_no_cost():
    """Infinite and missing costs take no part; no spread, no correlation."""
    a = np.array([1.0, 2.0, np.inf, 3.0, 4.0])
    b = np.array([2.0, 4.0, 1.0, np.nan, 8.0])
    assert rank_correlation(a, b).count == 3
    assert rank_correlation(a, b).spearman == pytest.approx(1.0)
    assert np.isnan(rank_correlation(a, np.ones(5)).kendall)
    assert np.isnan(rank_correlation(a[:1], b[:1]).spearman)


@pytest.mark.parametrize("successes", [1, 2, 4, 6])
def test_expected_calls_average_over_every_course_of_events(successes):
    """All 2⁵ courses, weighted: stop at the wanted success or at the list's end."""
    rng = np.random.default_rng(successes)
    chance = rng.choice([0.0, 0.2, 0.5, 0.9, 1.0], 5)
    order = rng.permutation(5)
    mean = 0.0
    for course in product((False, True), repeat=5):
        weight = np.prod(np.where(course, chance[order], 1 - chance[order]))
        done = np.flatnonzero(np.cumsum(course) >= successes)
        mean += weight * (done[0] + 1 if len(done) else 5)
    assert expected_calls(chance, order, successes) == pytest.approx(mean)


def test_no_grasps_need_no_calls():
    """An empty order is over at once."""
    assert expected_calls(np.zeros(3), np.zeros(0, int)) == 0.0
