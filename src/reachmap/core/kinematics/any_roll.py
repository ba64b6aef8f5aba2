"""Poses met at any roll, for arms of few axes that cannot turn their tool.

Where the arm has a joint more, about the approach axis, it meets a pose just where the
true arm meets it at some roll: one more axis, and the same solvers.
"""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.kinematics.solutions import Rows, distinct
from reachmap.core.kinematics.solvers.choice import FULL_AXES, Arm, choose_solver
from reachmap.core.robot.chain import SerialChain
from reachmap.geometry import AXES, approach_directions

# Sine of the angle between two axes that are one: what rounded angles explain.
ALONG = 1e-4


class AnyRollSolver:
    """Solves for position and direction of a tool, its roll left to the arm.

    Parameters
    ----------
    arm : Arm
        That :func:`has_own_roll`.
    axis : str
        TCP axis that the tool may be turned about.
    """

    def __init__(self, arm: Arm, axis: str) -> None:
        chain = arm.chain
        T = chain.tcp_at_zero
        longer = Arm(
            chain=SerialChain.from_axes(
                np.vstack([chain.axes_base.T, approach_directions(T[:3, :3], axis)]),
                np.vstack([chain.points_base, T[:3, 3]]),
                T,
                np.append(chain.is_revolute, True),
            ),
            lower=np.append(arm.lower, -np.pi),
            upper=np.append(arm.upper, np.pi),
            joint_names=(*arm.joint_names, "roll"),
            spec=arm.spec,
        )
        self._is_revolute = chain.is_revolute
        self._solver = choose_solver(longer)
        self.method = self._solver.method
        self.complete = self._solver.complete
        self.approximation = self._solver.approximation
        self.tolerance = self._solver.tolerance

    def branches(self, T: FloatArray) -> Rows:
        """Solutions of poses (n, 4, 4) at any roll, without whole turns."""
        Q, frame = self._solver.branches(T)
        return distinct((Q[:, :-1].copy(), frame), self._is_revolute)


def has_own_roll(chain: SerialChain, axis: str) -> bool:
    """Whether an arm of few axes leaves its tool no choice of the roll.

    It has one where the last joint that turns is about the approach axis.
    """
    if chain.dof >= FULL_AXES:
        return False
    turning = np.flatnonzero(chain.is_revolute)
    if not len(turning):
        return True
    T_joint_tcp = np.eye(4)
    for T in chain.T_fixed[turning[-1] + 1 :]:
        T_joint_tcp = T_joint_tcp @ T
    return bool(np.hypot(*T_joint_tcp[:2, AXES[axis][0]]) > ALONG)
