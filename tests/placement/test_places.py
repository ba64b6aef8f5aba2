"""From many poses to a few good places far from each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reachmap.placement.mapped.candidates import Candidate, CandidateTable
from reachmap.placement.mapped.exact import PoseScore
from reachmap.placement.predicted.places import apart_m, pose_grid, rank_key, spread_out
from reachmap.placement.predicted.region import Region


def candidate(pose, score, worst=50.0, length=1.0):
    """A candidate with a score."""
    return Candidate(
        pose=pose,
        score=PoseScore(
            score=score,
            worst_point=worst,
            reachable_share=100.0,
            path_length_rad=length,
        ),
    )


coordinates = st.integers(-5, 5).map(lambda k: k / 10)
candidates = st.lists(
    st.builds(
        candidate,
        st.tuples(coordinates, coordinates, coordinates, st.sampled_from([0.0, 1.5])),
        st.sampled_from([0.0, 50.0, 90.0, 97.5]),
        st.sampled_from([0.0, 40.0]),
    ),
    max_size=30,
)


@given(found=candidates, count=st.integers(0, 6), distance_m=st.floats(0.0, 0.8))
def test_spread_out_is_greedy_and_apart(found, count, distance_m):
    """Chosen ones are apart; whatever is left out is near a better one, or late."""
    chosen = spread_out(found, count, distance_m)
    keys = [rank_key(c) for c in chosen]
    assert len(chosen) <= count
    assert keys == sorted(keys)
    for k, one in enumerate(chosen):
        for other in chosen[:k]:
            assert apart_m(one.pose, other.pose) >= distance_m
    if len(chosen) < count:
        for other in found:
            near = [c for c in chosen if apart_m(c.pose, other.pose) < distance_m]
            assert other in chosen or any(rank_key(c) <= rank_key(other) for c in near)


def test_excluded_candidates_are_passed_over():
    """What has a reason and no score is never chosen, and has no rank."""
    excluded = Candidate(pose=(0.0, 0.0, 0.0, 0.0), reason="the bin meets a post")
    good = candidate((0.1, 0.0, 0.0, 0.0), 90.0)
    assert spread_out([excluded, good], 5, 0.5) == [good]
    with pytest.raises(ValueError, match="no rank"):
        rank_key(excluded)


def test_score_then_worst_point_then_path_then_pose():
    """Ties are broken by the worst point, the path length and last by the pose."""
    ordered = [
        candidate((0.0, 0.0, 0.0, 0.0), 96.0, 10.0, 9.0),
        candidate((0.0, 0.0, 0.0, 0.0), 95.0, 60.0, 3.0),
        candidate((0.0, 0.0, 0.0, 0.0), 95.0, 50.0, 2.0),
        candidate((0.1, 0.0, 0.0, 0.0), 95.0, 50.0, 2.0),
        candidate((0.0, 0.0, 0.0, 0.0), 95.0, 50.0, 2.5),
    ]
    mixed = [ordered[k] for k in (3, 0, 4, 2, 1)]
    assert sorted(mixed, key=rank_key) == ordered


def test_differences_in_the_last_digits_decide_nothing():
    """Scores that differ by rounding are equal, so that the pose decides."""
    left, right = candidate((0.0, 0, 0, 0), 95.0), candidate((0.1, 0, 0, 0), 95 + 1e-9)
    assert min([right, left], key=rank_key) is left


@given(
    low=st.tuples(*[st.floats(-1.0, 1.0)] * 3, st.floats(0.0, 1.5)),
    size=st.tuples(*[st.sampled_from([0.0, 0.04, 0.5])] * 3, st.floats(0.0, np.pi)),
)
def test_a_grid_of_poses_fills_the_region(low, size):
    """The grid has both ends of each range, steps of a quarter square, no half turn."""
    low, high = np.array(low), np.array(low) + size
    region = Region(low=low, high=high)
    x, y, z = (np.arange(5.0) * step for step in (0.1, 0.2, 0.1))
    grid = pose_grid(region, x, y, z)
    for k, (values, step) in enumerate(
        zip((grid.x, grid.y, grid.z), (0.1, 0.2, 0.1), strict=True)
    ):
        assert np.isclose(values[0], low[k])
        assert np.isclose(values[-1], high[k])
        assert (np.diff(values) <= step / 4 + 1e-6).all()
    assert np.ptp(grid.yaw) < np.pi - 1e-9
    assert all(
        region.outside(np.array([grid.x[0], grid.y[0], grid.z[0], yaw])) == ""
        for yaw in grid.yaw
    )


def test_a_table_keeps_rows_with_and_without_scores():
    """Rows come back as arrays, NaN and a reason where there is no score."""
    table = CandidateTable()
    first = table.add(candidate((0.1, 0.2, 0.3, 0.4), 90.0))
    second = table.add(Candidate(pose=(0.0, 0.0, 0.0, 0.0), reason="in the post"))
    assert (first, second) == (0, 1)
    assert table.poses().shape == (2, 4)
    assert np.array_equal(table.values("score"), [90.0, np.nan], equal_nan=True)
    assert table.reasons() == ("", "in the post")
    assert CandidateTable().poses().shape == (0, 4)
