"""The straight way from a pre-grasp to a grasp, on one branch of the kinematics."""

from __future__ import annotations

import math

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.planning.motion import MotionChecker
from reachmap.geometry import rotation_angle

# Long enough to be few, short enough for Newton's method to stay on its branch.
STEP_M = 0.01
# A joint that moves further from step to step may have turned over to another branch;
# the step is halved until it does not, or until so little is left that it has.
_LARGEST_STEP_RAD = 0.2
_HALVINGS = 6
# Between two configurations the joints move straight and the tool does not; it stays
# this near to its line, or there are more configurations.
STRAIGHT_M, STRAIGHT_RAD = 1e-4, math.radians(0.05)


class StraightApproach:
    """Finds and verifies straight ways of the tool that end at a grasp.

    Parameters
    ----------
    kinematics : Kinematics
    motions : MotionChecker
    direction : array, shape (3,)
        Unit vector of the way in the TCP frame; the approach axis as a rule.
    distance_m : float
        From the pre-grasp to the grasp; 0 for none.
    """

    def __init__(
        self,
        kinematics: Kinematics,
        motions: MotionChecker,
        direction: FloatArray,
        distance_m: float,
    ) -> None:
        self._kinematics, self._motions = kinematics, motions
        self.distance_m = distance_m
        self._direction = direction
        steps = math.ceil(distance_m / STEP_M)
        self._retreats = np.tile(np.eye(4), (steps, 1, 1))
        along = np.arange(1, steps + 1) * (distance_m / max(steps, 1))
        self._retreats[:, :3, 3] = -along[:, None] * direction

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
        if back is None:
            back = self._in_smaller_steps(T_base_tcp, q_grasp)
        return None if back is None else np.vstack([back[::-1], q_grasp])

    def of_many(self, T_base_tcp: FloatArray, Q: FloatArray) -> list[FloatArray | None]:
        """:meth:`of` for many grasps at once, (n, 4, 4) and (n, dof)."""
        if not len(self._retreats) or not len(Q):
            return [q[None] for q in Q]
        T = T_base_tcp[:, None] @ self._retreats
        back, is_met = self._kinematics.follow_many(
            Q, T, largest_step_rad=_LARGEST_STEP_RAD
        )
        hopeful = is_met | self._has_solution(T[:, -1], ~is_met)
        ways: list[FloatArray | None] = [None] * len(Q)
        for k in np.flatnonzero(hopeful).tolist():
            way = back[k] if is_met[k] else self._in_smaller_steps(T_base_tcp[k], Q[k])
            if way is not None:
                ways[k] = np.vstack([way[::-1], Q[k]])
        return ways

    def _has_solution(self, T: FloatArray, among: BoolArray) -> BoolArray:
        """Which of some poses may be met on some branch, (n, 4, 4) to (n,).

        Where none is, no branch leads there, and following one to its end is saved.
        """
        if not among.any() or not self._kinematics.complete:
            return among
        _, pose = self._kinematics.solve_many(T[among], windings=False)
        found = np.zeros(len(T), bool)
        found[np.flatnonzero(among)[pose]] = True
        return found

    def _in_smaller_steps(
        self, T_base_tcp: FloatArray, q_grasp: FloatArray
    ) -> FloatArray | None:
        """Go back step by step, in halves where joints move far."""
        along_m, step_m, q = 0.0, STEP_M, q_grasp
        back = []
        while along_m < self.distance_m:
            if step_m < STEP_M / 2**_HALVINGS:
                return None
            further_m = min(along_m + step_m, self.distance_m)
            met = self._kinematics.follow(
                q,
                (T_base_tcp @ self._retreat(further_m))[None],
                largest_step_rad=_LARGEST_STEP_RAD,
            )
            if met is None:
                step_m /= 2
                continue
            q, along_m, step_m = met[0], further_m, min(2 * step_m, STEP_M)
            back.append(q)
        return np.array(back)

    def _retreat(self, distance_m: float) -> FloatArray:
        T = np.eye(4)
        T[:3, 3] = -distance_m * self._direction
        return T

    def straightened(self, way: FloatArray) -> FloatArray | None:
        """Add configurations until the tool keeps to its line.

        Parameters
        ----------
        way : array, shape (n, dof)
            Of :meth:`of`.

        Returns
        -------
        array, shape (m, dof), or None
            With no more than 0.1 mm and 0.05 degrees between the tool and its line;
            None where the branch does not follow it that closely.
        """
        T_end = self._kinematics.forward(way[-1])
        for _ in range(_HALVINGS):
            middle = (way[:-1] + way[1:]) / 2
            T = self._kinematics.forward_many(middle)
            offset = (T[:, :3, 3] - T_end[:3, 3]) @ T_end[:3, :3]
            along_m = -(offset @ self._direction)
            aside_m = offset + along_m[:, None] * self._direction
            bent = np.flatnonzero(
                (np.linalg.norm(aside_m, axis=1) > STRAIGHT_M)
                | (rotation_angle(T[:, :3, :3], T_end[:3, :3]) > STRAIGHT_RAD)
            )
            if not len(bent):
                return way
            for k in bent[::-1]:
                met = self._kinematics.follow(
                    middle[k],
                    (T_end @ self._retreat(float(along_m[k])))[None],
                    largest_step_rad=_LARGEST_STEP_RAD,
                )
                if met is None:
                    return None
                way = np.insert(way, k + 1, met[0], axis=0)
        return None

    def is_free(self, way: FloatArray) -> bool:
        """Whether an approach passes the verification distance."""
        return self._motions.path_is_verified(way)

    def free_and_straight(self, way: FloatArray) -> FloatArray | None:
        """A free approach that keeps to its line, None where there is none."""
        if not self.is_free(way):
            return None
        straight = self.straightened(way) if len(way) > 1 else way
        if straight is None or len(straight) == len(way) or self.is_free(straight):
            return straight
        return None

    def blocking_pair(self, way: FloatArray) -> int:
        """Bodies that an approach brings together, nearest to the grasp first."""
        return self._motions.blocking_pair(way[::-1])
