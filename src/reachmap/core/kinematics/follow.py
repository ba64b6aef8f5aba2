"""Follow a path of poses with one branch of the inverse kinematics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.robot.assembly import TCP_FRAME
from reachmap.core.robot.chain import SerialChain, pose_error
from reachmap.core.robot.model import RobotModel

# From a neighbouring pose Newton's method needs a few; more mean a singularity.
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
        free_axis: FloatArray | None = None,
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
        free_axis : array, shape (3,), optional
            Unit vector in the TCP frame that poses may be turned about.

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
            met = self._meet(q + change, goal, tolerance, largest_step_rad, free_axis)
            if met is None or np.abs(met - q).max() > largest_step_rad:
                return None
            change = met - q if k else change
            found[k] = q = met
        return found

    def _meet(
        self,
        q_start: FloatArray,
        goal: pin.SE3,
        tolerance: float,
        largest: float,
        free_axis: FloatArray | None,
    ) -> FloatArray | None:
        robot, data = self._robot, self._data
        q = q_start
        for _ in range(_ITERATIONS):
            pin.computeJointJacobians(robot.model, data, q)
            T_root_tcp = pin.updateFramePlacement(robot.model, data, self._tcp)
            T_tcp_goal = T_root_tcp.actInv(goal)
            if free_axis is not None:
                T_tcp_goal = _least_turned(T_tcp_goal, free_axis)
            error = pin.log6(T_tcp_goal).vector
            if max(error[:3] @ error[:3], error[3:] @ error[3:]) <= tolerance**2:
                inside = (q >= robot.lower_rad).all() and (q <= robot.upper_rad).all()
                return q if inside else None
            J = pin.getFrameJacobian(robot.model, data, self._tcp, pin.LOCAL)
            if free_axis is not None:
                J[3:] -= np.outer(free_axis, free_axis @ J[3:])
            damping = 1e-2 * (error @ error) + 1e-12
            normal = J.T @ J
            normal.flat[:: len(q) + 1] += damping
            q = q + np.linalg.solve(normal, J.T @ error)
            if np.abs(q - q_start).max() > largest:
                return None
        return None


def _least_turned(T: pin.SE3, axis: FloatArray) -> pin.SE3:
    """Turn a pose about an axis of its own, so that it is rotated the least."""
    R = pin.Quaternion.FromTwoVectors(axis, T.rotation @ axis).toRotationMatrix()
    return pin.SE3(R, T.translation)


def follow_many(
    robot: RobotModel,
    chain: SerialChain,
    Q_start: FloatArray,
    T: FloatArray,
    *,
    tolerance: float,
    largest_step_rad: float,
) -> tuple[FloatArray, BoolArray]:
    """Track many rows of poses at once, each as :meth:`Follower.follow` does.

    Parameters
    ----------
    robot : RobotModel
    chain : SerialChain
        Of the robot.
    Q_start : array, shape (n, dof)
    T : array, shape (n, k, 4, 4)
    tolerance, largest_step_rad : float

    Returns
    -------
    Q : array, shape (n, k, dof)
    is_met : bool array, shape (n,)
        Rows that are followed to their end; the others hold no solution.
    """
    q, change = np.array(Q_start, float), np.zeros_like(Q_start)
    found = np.empty((len(q), T.shape[1], q.shape[1]))
    going = np.arange(len(q))
    for k in range(T.shape[1]):
        start = q[going] + change[going]
        met, fine = _meet_many(chain, start, T[going, k], tolerance, largest_step_rad)
        fine &= ((met >= robot.lower_rad) & (met <= robot.upper_rad)).all(axis=1)
        fine &= np.abs(met - q[going]).max(axis=1, initial=0.0) <= largest_step_rad
        going, met = going[fine], met[fine]
        if k:
            change[going] = met - q[going]
        found[going, k] = q[going] = met
    is_met = np.zeros(len(q), bool)
    is_met[going] = True
    return found, is_met


def _meet_many(
    chain: SerialChain,
    Q_start: FloatArray,
    T: FloatArray,
    tolerance: float,
    largest: float,
) -> tuple[FloatArray, BoolArray]:
    """Newton steps to one pose a row; which of them arrive, (n,)."""
    q, fine = np.array(Q_start), np.zeros(len(Q_start), bool)
    going = np.arange(len(q))
    for _ in range(_ITERATIONS):
        T_now, J = chain.jacobian_many(q[going])
        error = pose_error(T[going], T_now)
        squares = error * error
        miss = np.maximum(squares[:, :3].sum(axis=1), squares[:, 3:].sum(axis=1))
        there = miss <= tolerance**2
        fine[going[there]] = True
        going, J, error = going[~there], J[~there], error[~there]
        if not len(going):
            break
        normal = np.swapaxes(J, 1, 2) @ J
        damping = 1e-2 * (error * error).sum(axis=1) + 1e-12
        normal[:, range(q.shape[1]), range(q.shape[1])] += damping[:, None]
        right = np.swapaxes(J, 1, 2) @ error[:, :, None]
        q[going] += np.linalg.solve(normal, right)[..., 0]
        near = np.abs(q[going] - Q_start[going]).max(axis=1) <= largest
        going = going[near]
    return q, fine
