"""Forward and inverse kinematics of a robot: from joints to TCP poses and back."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.cell.model.cell import IkSpec
from reachmap.core.kinematics.any_roll import AnyRollSolver, has_own_roll
from reachmap.core.kinematics.follow import Follower, follow_many
from reachmap.core.kinematics.solutions import Rows, within_limits
from reachmap.core.kinematics.solvers.choice import Arm, BranchSolver, choose_solver
from reachmap.core.robot.chain import SerialChain
from reachmap.core.robot.model import RobotModel
from reachmap.geometry import axis_turns, axis_vector


class Kinematics:
    """Kinematics of a robot between its base and its TCP.

    Poses are T_base_tcp: the TCP in robot_base [m]. Build one per process.

    Parameters
    ----------
    robot : RobotModel
    spec : IkSpec, optional
        How to solve; default: as the robot's cell says. ``auto`` takes the closed
        form if there is one, also of a calibrated arm's nominal one, then a
        seven-axis arm's grid, then the numeric solver.

    any_roll_about : str, optional
        TCP axis that the tool may be turned about at will. Where the arm has fewer
        than six axes and leaves it no choice of its roll, poses are met at whatever
        roll the arm has there.

    Attributes
    ----------
    any_roll : bool
        Whether solutions meet position and direction of a pose at a roll of their own.
    method : str
        ``analytic``, ``nominal-analytic``, ``redundant-grid`` or ``numeric``.
    complete : bool
        Whether a pose without solutions is proved to have none.

    Raises
    ------
    SceneError
        The robot cannot be solved as `spec` asks.
    """

    def __init__(
        self,
        robot: RobotModel,
        spec: IkSpec | None = None,
        *,
        any_roll_about: str | None = None,
    ) -> None:
        self.robot = robot
        self.chain = SerialChain.from_robot(robot)
        arm = Arm(
            chain=self.chain,
            lower=robot.lower_rad,
            upper=robot.upper_rad,
            joint_names=tuple(robot.joint_names),
            spec=spec or robot.ik,
        )
        axis = any_roll_about
        self.any_roll = axis is not None and has_own_roll(self.chain, axis)
        self._roll_axis: FloatArray | None = None
        self._solver: BranchSolver
        if axis is not None and self.any_roll:
            self._roll_axis = axis_vector(axis)
            self._solver = AnyRollSolver(arm, axis)
        else:
            self._solver = choose_solver(arm)
        self._data = robot.model.createData()

    @cached_property
    def _follower(self) -> Follower:
        return Follower(self.robot)

    @property
    def method(self) -> str:
        """Name of the way inverse kinematics is solved."""
        return self._solver.method

    @property
    def complete(self) -> bool:
        """Whether a pose without solutions is proved to have none."""
        return self._solver.complete

    @property
    def approximation(self) -> str:
        """How solutions are sought where that proves nothing; "" if complete."""
        return self._solver.approximation

    @property
    def tolerance(self) -> float:
        """Largest miss of a solution [m and rad].

        1e-7, or what rounded angles of the URDF explain where the arm has fewer than
        six axes: it could not meet a vertical tool if that is 7e-6 rad off.
        """
        return self._solver.tolerance

    def forward(self, q: FloatArray) -> FloatArray:
        """TCP pose T_base_tcp of a configuration, (dof,) to (4, 4)."""
        robot = self.robot
        pin.forwardKinematics(robot.model, self._data, np.asarray(q, float))
        T_root_joint = self._data.oMi[robot.tcp_joint].homogeneous
        return np.asarray(robot.T_base_root @ T_root_joint @ robot.T_joint_tcp)

    def forward_many(self, Q: FloatArray) -> FloatArray:
        """TCP poses T_base_tcp of configurations, (n, dof) to (n, 4, 4)."""
        return self.chain.forward_many(Q)

    def solve(self, T: FloatArray, *, windings: bool = True) -> FloatArray:
        """All solutions for one pose.

        Parameters
        ----------
        T : array, shape (4, 4)
            Pose T_base_tcp.
        windings : bool
            See `solve_many`.

        Returns
        -------
        array, shape (m, dof)
            As `solve_many`; no rows if there is no solution.
        """
        return self.solve_many(np.asarray(T, float)[None], windings=windings)[0]

    def solve_many(
        self, T: FloatArray, *, windings: bool = True, near: FloatArray | None = None
    ) -> tuple[FloatArray, IntArray]:
        """All solutions for many poses.

        Each solution is within the joint limits and misses its pose by no more than
        `tolerance`. A pose's solutions do not depend on the other poses.
        At a singularity where they form a curve, some of its points are returned.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        windings : bool
            Whether a solution is repeated for every whole turn of its joints that
            is within the limits. There may be many: 32 for each solution of a UR5
            with limits of ±2π. Otherwise the one nearest to `near`, joint by joint.
        near : array, shape (dof,), optional
            Default: the middle of the limits.

        Returns
        -------
        Q : array, shape (m, dof)
            Solutions, poses in order [rad].
        frame_index : array of int, shape (m,)
            Pose of each; ``np.bincount(frame_index, minlength=n)`` counts them.
        """
        T = np.ascontiguousarray(T, float).reshape(-1, 4, 4)
        return self._within_limits(self._solver.branches(T), windings, near)

    def solve_rolls(
        self,
        T: FloatArray,
        axis: str,
        rolls_rad: FloatArray,
        *,
        near: FloatArray | None = None,
    ) -> tuple[FloatArray, IntArray]:
        """One winding of all solutions for poses at several rolls.

        Where the last joint turns about the axis of the rolls, as on most tools with a
        round cup, a pose is solved once and its solutions are turned.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        axis : str
            TCP axis that the poses are turned about.
        rolls_rad : array, shape (m,)
        near : array, shape (dof,), optional
            See `solve_many`.

        Returns
        -------
        Q : array, shape (k, dof)
            Solutions, poses in order, each at one roll after the other [rad].
        index : array of int, shape (k,)
            Of each: pose · m + roll.
        """
        rolls = len(rolls_rad)
        sense = self.sense_of_last_joint(axis)
        if not (self.complete and sense):
            rolled = T[:, None] @ axis_turns(axis, rolls_rad)
            return self.solve_many(rolled, windings=False, near=near)
        Q, pose = self._solver.branches(np.ascontiguousarray(T, float))
        turned = np.repeat(Q[:, None], rolls, axis=1)
        turned[:, :, -1] += sense * rolls_rad
        index = (pose[:, None] * rolls + np.arange(rolls)).ravel()
        order = np.argsort(index, kind="stable")
        rows = turned.reshape(-1, Q.shape[1])[order], index[order]
        return self._within_limits(rows, False, near)

    def sense_of_last_joint(self, axis: str) -> int:
        """Sense in which the last joint turns the TCP about an axis; 0 if it does not.

        To a hundredth of what a solution may miss its pose by.
        """
        T_joint_tcp = self.chain.T_fixed[-1]
        joint_axis, p_joint_tcp = T_joint_tcp[2, :3], T_joint_tcp[:3, 3]
        sign = round(float(joint_axis @ axis_vector(axis)))
        tilted = np.abs(joint_axis - sign * axis_vector(axis)).max()
        is_aside = max(tilted, *np.abs(p_joint_tcp[:2])) > self.tolerance / 100
        return 0 if is_aside or not self.chain.is_revolute[-1] else sign

    def _within_limits(
        self, rows: Rows, windings: bool, near: FloatArray | None
    ) -> Rows:
        return within_limits(
            rows,
            self.robot.lower_rad,
            self.robot.upper_rad,
            self.robot.is_revolute,
            windings=windings,
            near=near,
        )

    def follow_many(
        self, Q_start: FloatArray, T: FloatArray, *, largest_step_rad: float = 0.2
    ) -> tuple[FloatArray, BoolArray]:
        """:meth:`follow` for many rows at once, in a fraction of the time.

        Parameters
        ----------
        Q_start : array, shape (n, dof)
        T : array, shape (n, k, 4, 4)
        largest_step_rad : float

        Returns
        -------
        Q : array, shape (n, k, dof)
        is_met : bool array, shape (n,)
        """
        return follow_many(
            self.robot,
            self.chain,
            Q_start,
            T,
            tolerance=self.tolerance,
            largest_step_rad=largest_step_rad,
        )

    def follow(
        self,
        q_start: FloatArray,
        T: FloatArray,
        *,
        tolerance: float | None = None,
        largest_step_rad: float = 0.2,
        own_roll: bool = False,
    ) -> FloatArray | None:
        """Follow poses that lie close to each other, a straight approach for example.

        Parameters
        ----------
        q_start : array, shape (dof,)
            Configuration at, or next to, the first pose.
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        tolerance : float
            Largest miss of a pose [m and rad]; default: 1e-6, or the tolerance of
            solutions if that is larger.
        largest_step_rad : float
            Largest change of a joint from pose to pose.
        own_roll : bool
            Whether poses are met at the roll that the arm has there, where it has
            `any_roll`.

        Returns
        -------
        array, shape (n, dof), or None
            A configuration for each pose; None if the branch ends, turns over or
            leaves the joint limits on the way.
        """
        if tolerance is None:
            tolerance = max(1e-6, self.tolerance)
        return self._follower.follow(
            q_start,
            T,
            tolerance=tolerance,
            largest_step_rad=largest_step_rad,
            free_axis=self._roll_axis if own_roll else None,
        )
