"""Follow a path of poses with one branch of the inverse kinematics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray
from reachmap.core.robot.assembly import TCP_FRAME
from reachmap.core.robot.model import RobotModel

_ITERATIONS = 12


class Follower:
    """Tracks poses from a start configuration by Newton steps.

    Parameters
    ----------
    robot : RobotModel
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._data = robot.model.createData()
        self._tcp = robot.model.getFrameId(TCP_FRAME)
        self._root_base = pin.SE3(robot.T_root_base)

    def follow(
        self,
        q_start: FloatArray,
        T: FloatArray,
        *,
        tolerance: float,
        largest_step_rad: float,
    ) -> FloatArray | None:
        """Meet poses one after the other.

        Parameters
        ----------
        q_start : array, shape (dof,)
            Configuration at, or next to, the first pose.
        T : array, shape (n, 4, 4)
            Poses T_base_tcp, close to each other.
        tolerance : float
            Largest miss of a pose [m and rad].
        largest_step_rad : float
            Largest change of a joint from pose to pose [rad or m].

        Returns
        -------
        array, shape (n, dof), or None
            None if a pose is not met, a joint would leave its limits, or it would
            move by more than `largest_step_rad` (the branch ends or turns over).
        """
        q = np.array(q_start, float)
        change = np.zeros_like(q)
        found = np.empty((len(T), len(q)))
        for k, pose in enumerate(T):
            goal = self._root_base * pin.SE3(np.asarray(pose, float))
            # Joints go on as they went: one step less to the goal.
            met = self._meet(q + change, goal, tolerance, largest_step_rad)
            if met is None or np.abs(met - q).max() > largest_step_rad:
                return None
            change = met - q if k else change
            found[k] = q = met
        return found

    def _meet(
        self, q_start: FloatArray, goal: object, tolerance: float, largest: float
    ) -> FloatArray | None:
        robot, data = self._robot, self._data
        q = q_start
        for _ in range(_ITERATIONS):
            pin.computeJointJacobians(robot.model, data, q)
            T_root_tcp = pin.updateFramePlacement(robot.model, data, self._tcp)
            error = pin.log6(T_root_tcp.actInv(goal)).vector
            if max(error[:3] @ error[:3], error[3:] @ error[3:]) <= tolerance**2:
                inside = (q >= robot.lower_rad).all() and (q <= robot.upper_rad).all()
                return q if inside else None
            J = pin.getFrameJacobian(robot.model, data, self._tcp, pin.LOCAL)
            damping = 1e-2 * (error @ error) + 1e-12
            normal = J.T @ J
            normal.flat[:: len(q) + 1] += damping
            q = q + np.linalg.solve(normal, J.T @ error)
            if np.abs(q - q_start).max() > largest:
                return None
        return None
