"""Directions, evidence and reliability against loops and known variances."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from reachmap.geometry import rotation_from_quaternion_wxyz
from reachmap.maps.parts import confidence_of
from reachmap.maps.records import Status
from reachmap.maps.summary.directions import (
    direction_percent,
    reached_shares,
    same_direction,
)
from reachmap.maps.summary.evidence import evidence_of
from reachmap.maps.summary.reliability import reliability_of, term_reliability
from reachmap.maps.summary.statistics import are_independent
from tests.support.optional import present
from tests.support.ranking_maps import make_bin_map
from tests.support.synthetic_parts import synthetic_components


def shares_by_loops(found, tried, quaternions, axis):
    """Directions and points of each point, one orientation at a time."""
    sign, column = (1 if axis[0] == "+" else -1), "xyz".index(axis[1])
    directions, points = (
        np.full(found.shape[:-1], np.nan),
        np.full(found.shape[:-1], np.nan),
    )
    for at in np.ndindex(found.shape[:-1]):
        seen: list[tuple[np.ndarray, bool]] = []
        for o in np.flatnonzero(tried[at]):
            R = rotation_from_quaternion_wxyz(quaternions[(*at, o)])
            v, hit = sign * R[:, column], bool(found[(*at, o)])
            for k, (w, before) in enumerate(seen):
                if np.linalg.norm(v - w) < 1e-6:
                    seen[k] = (w, before or hit)
                    break
            else:
                seen.append((v, hit))
        if seen:
            hits = [hit for _, hit in seen]
            directions[at] = 100.0 * np.mean(hits)
            points[at] = 100.0 * any(hits)
    return directions, points


@pytest.mark.parametrize("axis", ["+z", "-x"])
@pytest.mark.parametrize("alike", [True, False])
def test_directions_are_what_loops_count(axis: str, alike: bool) -> None:
    """Three rolls of nine directions; at each point turned differently, or not."""
    record = make_bin_map(shape=(2, 2, 3), reachable=0.3, approach_axis=axis, seed=4)
    found = record.status == Status.PATH_FOUND
    tried = np.random.default_rng(0).random(found.shape) < 0.8
    quaternions = record.quaternion_wxyz.copy()
    if not alike:
        quaternions = quaternions[..., ::-1, :].copy()
        quaternions[0, 0, 0] = record.quaternion_wxyz[0, 0, 0]
    assert len(set(same_direction(quaternions[0, 0, 0], axis))) == 9
    got = direction_percent(found, tried, quaternions, axis)
    expected = shares_by_loops(found & tried, tried, quaternions, axis)
    np.testing.assert_allclose(got, expected)


def test_a_part_needs_one_roll() -> None:
    """One roll of each direction reached: a third of frames, everything else whole."""
    record = make_bin_map(shape=(1, 1, 2), seed=1)
    group = same_direction(record.quaternion_wxyz[0, 0, 0], "+z")
    first = np.array([list(group).index(g) == k for k, g in enumerate(group)])
    status = np.where(first, Status.PATH_FOUND, Status.NO_IK).astype(np.uint8)
    whole = np.broadcast_to(status, record.status.shape)
    shares = reached_shares(dataclasses.replace(record, status=whole))
    assert (shares.directions, shares.points) == (100.0, 100.0)
    assert shares.frames == pytest.approx(100.0 / 3.0)


def test_reliability_is_the_analysis_of_variance() -> None:
    """SciPy's F gives the same share of balanced groups; unequal ones recover it."""
    rng = np.random.default_rng(3)
    true = rng.normal(0.0, 2.0, 400)
    values = true[:, None] + rng.normal(0.0, 1.0, (400, 4))
    found = reliability_of(values)
    F = stats.f_oneway(*values).statistic
    assert found.share == pytest.approx((F - 1) / (F - 1 + 4))
    assert found.share == pytest.approx(0.8, abs=0.04)
    holes = np.where(rng.random(values.shape) < 0.4, np.nan, values)
    assert reliability_of(holes).share == pytest.approx(0.8, abs=0.06)
    assert not found.is_noise
    noise = reliability_of(rng.normal(size=(300, 5)))
    assert noise.share < 0.1
    assert noise.is_noise


def test_one_attempt_says_nothing_of_luck() -> None:
    """Without repetition there is no share, and no warning."""
    found = reliability_of(np.array([[1.0], [2.0], [4.0]]))
    assert np.isnan(found.share)
    assert not found.is_noise
    assert (found.grasps, found.repeated) == (3, 0)


def test_the_terms_of_a_map_count_successes_alone() -> None:
    """Checks of attempts that failed do not count."""
    record = make_bin_map(seed=2)
    shares = term_reliability(record)
    checks = np.where(record.path_found == 1, present(record.effort).checks, np.nan)
    again = reliability_of(checks.reshape(-1, checks.shape[-1]))
    assert shares["effort_checks"] == again
    shared = dataclasses.replace(
        record,
        provenance=dataclasses.replace(
            record.provenance, settings={"attempts": "roadmap"}
        ),
    )
    assert "planning_cpu_time" in shares
    assert "planning_cpu_time" not in term_reliability(shared)
    assert are_independent(record)
    assert not are_independent(shared)
    without = term_reliability(dataclasses.replace(record, effort=None))
    assert "effort_checks" not in without


def test_evidence_counts_each_component_once() -> None:
    """Attempts, checks and methods are those of the components that frames lie in."""
    components = synthetic_components(np.array([True, False, False]))
    status = np.array([1, 4, 4, 4, 2], np.uint8)
    component = np.array([0, 1, 2, 1, -1])
    found = evidence_of(
        [(status, component, np.zeros(5, np.uint8))], Status.NO_PATH_FOUND, components
    )
    assert (found.frames, found.components, found.attempts) == (3, 2, 3 + 4)
    assert found.checks == int(components.checks[1:].sum())
    assert sum(found.method_checks.values()) == found.checks
    assert found.agreed == 2  # the frames of component 1
    sure = confidence_of(components.checks, components.reached)
    assert found.confidence == sure[1:].min()


def test_confidence_is_the_share_that_was_reached_with_no_more_checks() -> None:
    """It grows with the checks, never says certain, and needs none for a path."""
    checks = np.array([0, 3_500, 20_000, 10**9, 5], np.int32)
    found = confidence_of(checks, np.array([0, 0, 0, 0, 1], np.uint8))
    np.testing.assert_allclose(found, [0, 0.4, 0.89, 0.99, 1])
