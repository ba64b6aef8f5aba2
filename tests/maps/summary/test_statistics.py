"""Counts, intervals and tests against brute force and SciPy."""

from fractions import Fraction
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from reachmap.maps import Status
from reachmap.maps.comparison.significance import (
    benjamini_hochberg,
    fisher_exact,
    mcnemar_exact,
)
from reachmap.maps.summary.bin import in_quadrant, spread_of, summarise_bin
from reachmap.maps.summary.statistics import causes_of, saturation_of, wilson_interval
from reachmap.maps.summary.workspace import summarise_workspace
from tests.support.synthetic_maps import synthetic_bin_map, synthetic_workspace_map


@settings(max_examples=60, deadline=None)
@given(total=st.integers(1, 8000), data=st.data())
def test_wilson_intervals_are_those_of_scipy(total: int, data: st.DataObject) -> None:
    """Score intervals at 95 % confidence, at the ends of the range too."""
    hits = data.draw(st.integers(0, total))
    low, high = wilson_interval(np.array([float(hits)]), np.array([float(total)]))
    known = stats.binomtest(hits, total).proportion_ci(method="wilson")
    assert low[0] == pytest.approx(known.low, abs=1e-12)
    assert high[0] == pytest.approx(known.high, abs=1e-12)


def likelihood(hits_a: int, total_a: int, hits: int, total: int) -> Fraction:
    """Hypergeometric probability of a table with given margins, exactly."""
    ways = comb(total_a, hits_a) * comb(total - total_a, hits - hits_a)
    return Fraction(ways, comb(total, hits))


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[st.integers(0, 30)] * 4))
def test_fisher_sums_tables_that_are_no_likelier(
    counts: tuple[int, int, int, int],
) -> None:
    """Two-sided exact p-values by enumeration in fractions, for any margins."""
    hits_a, misses_a, hits_b, misses_b = counts
    total_a, total_b, hits = hits_a + misses_a, hits_b + misses_b, hits_a + hits_b
    found = fisher_exact(*(np.array([n]) for n in (hits_a, total_a, hits_b, total_b)))
    possible = range(max(0, hits - total_b), min(hits, total_a) + 1)
    shares = [likelihood(k, total_a, hits, total_a + total_b) for k in possible]
    observed = likelihood(hits_a, total_a, hits, total_a + total_b)
    known = sum(share for share in shares if share <= observed)
    assert found[0] == pytest.approx(float(known), rel=1e-8)


def test_fisher_takes_many_tables_at_once() -> None:
    """Batch against one by one; equal tables share their value; none at all is fine."""
    rng = np.random.default_rng(0)
    total = np.full(200, 27)
    a, b = rng.integers(0, 28, 200), rng.integers(0, 28, 200)
    found = fisher_exact(a, total, b, total)
    one = [fisher_exact(*(v[k : k + 1] for v in (a, total, b, total)))[0]
           for k in range(200)]  # fmt: skip
    np.testing.assert_array_equal(found, one)
    empty = np.zeros(0, int)
    assert fisher_exact(empty, empty, empty, empty).shape == (0,)


@settings(max_examples=60, deadline=None)
@given(gained=st.integers(0, 400), lost=st.integers(0, 400))
def test_mcnemar_is_the_binomial_test(gained: int, lost: int) -> None:
    """Under chance alone a changed frame is gained with probability one half."""
    changed = gained + lost
    tail = sum(comb(changed, k) for k in range(min(gained, lost) + 1))
    known = min(Fraction(1), Fraction(2 * tail, 2**changed))
    assert mcnemar_exact(gained, lost) == pytest.approx(float(known), rel=1e-8)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 1000), max_size=40))
def test_benjamini_hochberg_keeps_to_its_definition(thousandths: list[int]) -> None:
    """Named are the k least, k the largest with p(k) <= 5 % k / n; ties together."""
    p = sorted(Fraction(n, 1000) for n in thousandths)
    least = [k for k, v in enumerate(p, 1) if v <= Fraction(5, 100) * k / len(p)]
    # Where a value lies on the limit itself, rounding decides.
    on_limit = any(v == Fraction(5, 100) * k / len(p) for k, v in enumerate(p, 1))
    named = benjamini_hochberg(np.array([float(n) / 1000 for n in thousandths]))
    if not on_limit:
        assert named.sum() == (least[-1] if least else 0)
        assert named.tolist() == [
            Fraction(n, 1000) <= p[least[-1] - 1] if least else False
            for n in thousandths
        ]


def test_saturation_counts_by_brute_force() -> None:
    """Reached after k attempts, over the grasps that were tried, in a loop."""
    record = synthetic_bin_map(0.3, shape=(2, 3, 4, 5, 4))
    s = saturation_of(record)
    frames = record.path_found.reshape(-1, 4)
    for k in range(4):
        assert s.hits[k] == sum(1 for row in frames if row[: k + 1].any())
    assert s.total == len(frames)
    np.testing.assert_allclose(s.share, 100 * s.hits / s.total)
    assert (np.diff(s.share) >= 0).all()


def test_frames_proved_but_missed_are_counted() -> None:
    """Connected by the roadmap, found by no attempt: missed, and not in the share."""
    found = np.zeros((1, 1, 2, 2, 3), bool)
    found[0, 0, 0, 0, 2] = True
    connected = np.array([[[[1, 1], [0, 1]]]], bool)
    record = synthetic_bin_map(found, connected=connected)
    s = saturation_of(record)
    assert s.missed == 2
    assert s.hits.tolist() == [0, 0, 1]
    assert s.proved == 75.0
    assert summarise_bin(record).reachable == 3


def test_causes_are_counted_over_all_cubes() -> None:
    """States and pairs, each against its own count; the most frequent pair first."""
    fractions = np.random.default_rng(3).random((2, 5, 4))
    record = synthetic_workspace_map(fractions, shared_row=2)
    causes = causes_of(record)
    status = np.concatenate([c.status.ravel() for c in record.cubes.values()])
    pair = np.concatenate([c.blocking_pair.ravel() for c in record.cubes.values()])
    assert causes.states == {
        code: int((status == code).sum())
        for code in causes.states
    }  # fmt: skip
    assert sum(causes.states.values()) == causes.total == status.size
    assert dict(causes.pairs) == {
        name: int((pair == k).sum()) for k, name in enumerate(record.body_pairs)
    }
    counts = [count for _, count in causes.pairs]
    assert counts == sorted(counts, reverse=True)


def test_quadrants_share_the_bin_out() -> None:
    """N is +y, E is +x; each grasp is in one quadrant, the middle is north-east."""
    record = synthetic_bin_map(0.5, shape=(1, 3, 5, 2, 2))
    parts = {name: in_quadrant(record, name) for name in ("NE", "NW", "SE", "SW")}
    assert sum(part.astype(int) for part in parts.values()).min() == 1  # type: ignore[union-attr]
    assert parts["NE"][0, 1, 2].all()
    assert parts["SW"][0, 0, 0].all()
    assert parts["NW"][0, 2, 1].all()
    summary = summarise_bin(record)
    assert [q.name for q in summary.quadrants] == ["NE", "NW", "SE", "SW"]
    assert sum(q.saturation.total for q in summary.quadrants) == 30
    assert (
        sum(q.saturation.hits[-1] for q in summary.quadrants)
        == (summary.saturation.hits[-1])
    )


def test_spreads_leave_out_what_is_not_there() -> None:
    """Mean, sample deviation and extremes over numbers that are not NaN."""
    spread = spread_of(np.array([1.0, np.nan, 3.0, 8.0]))
    assert (spread.count, spread.mean, spread.low, spread.high) == (3, 4.0, 1.0, 8.0)
    assert spread.std == pytest.approx(np.std([1, 3, 8], ddof=1))
    assert spread.median == 3.0
    assert spread_of(np.array([2.0])).std == 0.0
    assert np.isnan(spread_of(np.array([np.nan])).mean)


def test_levels_add_up_and_the_best_is_the_highest_mean() -> None:
    """Counts per level against the cubes; the mean is over squares, not frames."""
    fractions = np.zeros((3, 5, 4))
    fractions[1] = 0.5
    fractions[2, 0, 0] = 1.0
    summary = summarise_workspace(synthetic_workspace_map(fractions, shared_row=2))
    assert summary.best_level == 1
    assert [level.path_percent for level in summary.levels] == [0.0, 50.0, 5.0]
    # Two cubes of 3 × 4 squares share a row; each has 4 frames at a point.
    assert [level.frames for level in summary.levels] == [96, 96, 96]
    assert [level.squares for level in summary.levels] == [20, 20, 20]
    assert [level.path for level in summary.levels] == [0, 48, 4]
    assert [level.full_squares for level in summary.levels] == [0, 0, 1]


def test_levels_without_attempts_are_not_the_best() -> None:
    """Not attempted is neither 0 % nor best."""
    status = np.full((2, 1, 2, 3), Status.NOT_ATTEMPTED)
    status[1, 0, 0] = Status.NO_IK
    record = synthetic_workspace_map(np.zeros((2, 1, 2, 3), bool), status=status)
    summary = summarise_workspace(record)
    assert summary.best_level == 1
    assert np.isnan(summary.levels[0].path_percent)
    assert summary.levels[1].squares == 1


def test_attempts_of_a_component_count_once() -> None:
    """A hundred frames of one component rest on its attempts, not a hundred times."""
    record = synthetic_workspace_map(np.full((1, 2, 2), 0.75))
    summary = summarise_workspace(record)
    assert (summary.reached.frames, summary.reached.components) == (12, 1)
    assert summary.reached.attempts == 5
    # Unreached frames of the synthetic map have no component: each counts.
    assert summary.unreached.components == 0
    assert summary.unreached.attempts == 5 * summary.unreached.frames
