"""All branches of a UR5: complete, exact, within limits, the same every time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reachmap.core.kinematics.kinematics import Kinematics
from tests.support import ur_closed_form
from tests.support.kinematics_arms import misses, nearest_branch, turns_apart, ur5


@pytest.fixture(scope="module", name="half")
def _half() -> Kinematics:
    """UR5 with joints of ±π: one solution per branch."""
    return Kinematics(ur5(half_turn=True))


@pytest.fixture(scope="module", name="full")
def _full() -> Kinematics:
    """UR5 with joints of ±2π, the elbow ±π."""
    return Kinematics(ur5())


def test_the_original_is_among_the_solutions(half: Kinematics) -> None:
    """For 5,000 random configurations, and no solution misses its pose."""
    rng = np.random.default_rng(5)
    Q = rng.uniform(-np.pi, np.pi, (5000, 6))
    T = half.forward_many(Q)
    found, frame = half.solve_many(T)
    assert (half.method, half.complete) == ("analytic", True)
    assert nearest_branch(found, frame, Q).max() < 1e-6
    sample = rng.choice(len(found), 3000, replace=False)
    assert misses(half.robot, found[sample], T[frame[sample]]).max() < 1e-6
    assert np.abs(half.forward_many(found) - T[frame]).max() < 1e-6


def test_the_branches_are_those_of_the_closed_form() -> None:
    """Neither more nor fewer solutions than the published formulas give."""
    kinematics = Kinematics(ur5(half_turn=True, base_frame="base"))
    rng = np.random.default_rng(6)
    for q in rng.uniform(-np.pi, np.pi, (150, 6)):
        T = ur_closed_form.forward(q)
        ours, theirs = kinematics.solve(T), ur_closed_form.inverse(T)
        assert len(ours) == len(theirs)
        apart = turns_apart(ours[:, None] - theirs[None]).max(axis=2)
        assert apart.min(axis=1).max() < 1e-6
        assert apart.min(axis=0).max() < 1e-6


def test_unreachable_poses_have_no_solution(half: Kinematics) -> None:
    """Beyond reach, and closer to the base axis than the shoulder offset allows."""
    far = np.eye(4)
    far[:3, 3] = [2.0, 0, 0]
    inside = np.eye(4)
    inside[:3, 3] = [0.05, 0, 0.5]
    assert half.solve(far).shape == (0, 6)
    assert half.solve(inside).shape == (0, 6)
    found, frame = half.solve_many(np.stack([far, half.forward(np.ones(6)), inside]))
    assert set(frame.tolist()) == {1}
    assert len(found) == len(frame)


def test_one_pose_is_a_batch_of_one(half: Kinematics) -> None:
    """Solving poses one by one, in parts or all at once gives the same bits."""
    rng = np.random.default_rng(7)
    Q = rng.uniform(-np.pi, np.pi, (300, 6))
    Q[:20, 4] = 0.0  # singular poses as well
    Q[20:40, 2] = 0.0
    T = half.forward_many(Q)
    found, frame = half.solve_many(T)
    assert (np.diff(frame) >= 0).all()
    for k in range(60):
        np.testing.assert_array_equal(half.solve(T[k]), found[frame == k])
    parts = [half.solve_many(T[part])[0] for part in (slice(0, 7), slice(7, 300))]
    np.testing.assert_array_equal(np.concatenate(parts), found)


def test_two_solvers_agree_to_the_bit(half: Kinematics) -> None:
    """Nothing depends on the process, on time or on what was solved before."""
    Q = np.random.default_rng(8).uniform(-np.pi, np.pi, (100, 6))
    Q[:10, 4] = 0.0
    T = half.forward_many(Q)
    again = Kinematics(ur5(half_turn=True)).solve_many(T)
    for a, b in zip(half.solve_many(T), again, strict=True):
        np.testing.assert_array_equal(a, b)


def test_no_poses_have_no_solutions(half: Kinematics) -> None:
    """Empty in, empty out, with the right shapes."""
    found, frame = half.solve_many(np.zeros((0, 4, 4)))
    assert found.shape == (0, 6)
    assert frame.shape == (0,)


def test_windings_fill_the_limits(full: Kinematics, half: Kinematics) -> None:
    """Every whole turn within ±2π appears once; the elbow has ±π only."""
    T = full.forward(np.array([0.3, -1.2, 1.1, -1.4, -1.5, 0.2]))
    branches, all_turns = half.solve(T), full.solve(T)
    assert len(all_turns) == 2**5 * len(branches)
    assert len(np.unique(all_turns.round(6), axis=0)) == len(all_turns)
    assert (all_turns >= full.robot.lower_rad).all()
    assert (all_turns <= full.robot.upper_rad).all()
    assert misses(full.robot, all_turns, T).max() < 1e-6
    np.testing.assert_allclose(full.solve(T, windings=False), branches)


def test_a_joint_at_its_limit_may_stand_at_both_ends(half: Kinematics) -> None:
    """π and −π are two configurations, and rounding does not lose either."""
    q = np.array([np.pi, -1.2, 1.1, -1.4, -1.5, -np.pi])
    found = half.solve(half.forward(q))
    ends = found[turns_apart(found - q).max(axis=1) < 1e-6][:, [0, 5]]
    signs = {(a, b) for a, b in np.sign(ends)}
    assert signs == {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    assert np.abs(found).max() <= np.pi + 1e-9


def test_limits_leave_out_branches(half: Kinematics) -> None:
    """A narrowed elbow keeps exactly the solutions inside."""
    limits = {"acceleration_rad_s2": 5.0, "position_deg": {"elbow_joint": [0, 180]}}
    narrow = Kinematics(ur5(limits=limits))
    T = half.forward(np.array([0.3, -1.2, 1.1, -1.4, -1.5, 0.2]))
    wanted = half.solve(T)
    wanted = wanted[wanted[:, 2] >= 0]
    np.testing.assert_allclose(narrow.solve(T, windings=False), wanted)


angle = st.floats(-180.0, 180.0)
metre = st.floats(-0.5, 0.5)


@settings(max_examples=25, deadline=None)
@given(
    tcp_xyz=st.tuples(metre, metre, metre),
    tcp_rpy=st.tuples(angle, angle, angle),
    base=st.sampled_from(["base", "base_link", "world"]),
    seed=st.integers(0, 2**16),
)
def test_any_tool_and_base(
    tcp_xyz: tuple[float, ...], tcp_rpy: tuple[float, ...], base: str, seed: int
) -> None:
    """TCP and base frame may be anything: originals are found, nothing misses."""
    kinematics = Kinematics(
        ur5(
            half_turn=True,
            base_frame=base,
            base_pose={"xyz": tcp_xyz, "rpy_deg": tcp_rpy},
            tcp={"parent": "ee_link", "xyz": tcp_xyz, "rpy_deg": tcp_rpy},
        )
    )
    Q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (20, 6))
    T = kinematics.forward_many(Q)
    found, frame = kinematics.solve_many(T)
    assert nearest_branch(found, frame, Q).max() < 1e-5
    assert misses(kinematics.robot, found, T[frame]).max() < 1e-6
