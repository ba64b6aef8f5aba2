"""The straight way from a pre-grasp to a grasp, on one branch of the kinematics."""

from __future__ import annotations

import math

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.planning.motion import MotionChecker
from reachmap.geometry import AXES

STEP_M = 0.01
_LARGEST_STEP_RAD = 0.2


class StraightApproach:
    """Finds and verifies straight approaches along the tool's approach axis.

    Parameters
    ----------
    kinematics : Kinematics
    motions : MotionChecker
    approach_axis : str
        Axis of the TCP that points into the object, as in ``"+z"``.
    distance_m : float
        From the pre-grasp to the grasp; 0 for none.
    """

    def __init__(
        self,
        kinematics: Kinematics,
        motions: MotionChecker,
        approach_axis: str,
        distance_m: float,
    ) -> None:
        self._kinematics, self._motions = kinematics, motions
        self.distance_m = distance_m
        steps = math.ceil(distance_m / STEP_M)
        axis, sign = AXES[approach_axis]
        self._retreats = np.tile(np.eye(4), (steps, 1, 1))
        along = np.arange(1, steps + 1) * (distance_m / max(steps, 1))
        self._retreats[:, axis, 3] = -sign * along

    def of(self, T_base_tcp: FloatArray, q_grasp: FloatArray) -> FloatArray | None:
        """Configurations from the pre-grasp to the grasp.

        Parameters
        ----------
        T_base_tcp : array, shape (4, 4)
            The grasp.
        q_grasp : array, shape (dof,)
            One of its free configurations.

        Returns
        -------
        array, shape (n, dof), or None
            Not checked for collision; None where the branch ends on the way.
        """
        if not len(self._retreats):
            return q_grasp[None]
        back = self._kinematics.follow(
            q_grasp, T_base_tcp @ self._retreats, largest_step_rad=_LARGEST_STEP_RAD
        )
        return None if back is None else np.vstack([back[::-1], q_grasp])

    def is_free(self, way: FloatArray) -> bool:
        """Whether an approach passes the verification distance."""
        return self._motions.path_is_verified(way)

    def blocking_pair(self, way: FloatArray) -> int:
        """Bodies that an approach brings together, nearest to the grasp first."""
        return self._motions.blocking_pair(way[::-1])
