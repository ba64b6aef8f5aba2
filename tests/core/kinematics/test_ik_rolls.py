"""A pose at several rolls about the tool: solved once, or one roll after the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reachmap.core.kinematics.kinematics import Kinematics
from tests.support.kinematics_arms import pinocchio_tcp, ur5

ROLLS = 2.0 * np.pi * np.arange(8) / 8
UP, DOWN = [0.0, 0.0, 0.0], [180.0, 0.0, 30.0]
# Of each tool: where it is on the flange, the axis of the rolls, and how the last joint
# turns about it.
TOOLS: dict[str, tuple[list[float], list[float], str, int]] = {
    "along the last joint": ([0.0, 0.0, 0.2], UP, "+z", 1),
    "against the last joint": ([0.0, 0.0, 0.2], DOWN, "+z", -1),
    "against its own axis": ([0.0, 0.0, 0.2], DOWN, "-z", 1),
    "beside the last joint": ([0.02, 0.0, 0.2], UP, "+z", 0),
    "across the last joint": ([0.0, 0.0, 0.2], [0.0, 90.0, 0.0], "+z", 0),
    "a hair off": ([0.0, 0.0, 0.2], [0.001, 0.0, 0.0], "+z", 0),
}


@pytest.mark.parametrize("half_turn", [False, True])
@pytest.mark.parametrize("name", TOOLS)
def test_rolls_are_solved_as_poses_of_their_own(name: str, half_turn: bool) -> None:
    """Pinocchio says that each solution meets its roll, and as many are found."""
    xyz, rpy_deg, axis, sense = TOOLS[name]
    tcp = {"parent": "tool0", "xyz": xyz, "rpy_deg": rpy_deg}
    arm = ur5(half_turn=half_turn, tcp=tcp)
    kinematics = Kinematics(arm)
    assert kinematics.sense_of_last_joint(axis) == sense
    rng = np.random.default_rng(4)
    near = rng.uniform(-2.0, 2.0, arm.dof)
    T = np.array([pinocchio_tcp(arm, rng.uniform(-3, 3, arm.dof)) for _ in range(40)])
    T[-1, 0, 3] += 5.0
    Q, index = kinematics.solve_rolls(T, axis, ROLLS, near=near)
    assert (np.diff(index) >= 0).all()
    turn = Rotation.from_rotvec(
        np.outer(ROLLS, np.array([0.0, 0.0, 1.0 if axis == "+z" else -1.0]))
    )
    rolled = np.repeat(T[:, None], len(ROLLS), axis=1)
    rolled[:, :, :3, :3] = T[:, None, :3, :3] @ turn.as_matrix()
    rolled = rolled.reshape(-1, 4, 4)
    for q, k in zip(Q, index, strict=True):
        np.testing.assert_allclose(pinocchio_tcp(arm, q), rolled[k], atol=2e-7)
    alone, frame = kinematics.solve_many(rolled, windings=False, near=near)
    np.testing.assert_array_equal(index, frame)
    for k in np.unique(frame):
        ours, theirs = Q[index == k], alone[frame == k]
        apart = np.abs(ours[:, None] - theirs).max(axis=2).min(axis=0)
        assert apart.max() < 1e-6
    assert not (index >= 39 * len(ROLLS)).any()
