"""Forward and inverse kinematics of a robot: from joints to TCP poses and back."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.cell import IkSpec
from reachmap.core.kinematics.analytic import AnalyticSolver, can_use_eaik
from reachmap.core.kinematics.follow import Follower
from reachmap.core.kinematics.nominal import NominalSolver, nominal_chain
from reachmap.core.kinematics.numeric import NumericSolver
from reachmap.core.kinematics.redundant import RedundantSolver
from reachmap.core.kinematics.solutions import Rows, within_limits
from reachmap.core.robot.chain import SerialChain
from reachmap.core.robot.model import RobotModel
from reachmap.errors import SceneError


class BranchSolver(Protocol):
    """A way to solve inverse kinematics."""

    method: str
    complete: bool

    def branches(self, T: FloatArray) -> Rows:
        """Solutions of poses (n, 4, 4), without whole turns."""
        ...


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

    Attributes
    ----------
    method : str
        ``analytic``, ``nominal-analytic``, ``redundant-grid`` or ``numeric``.
    complete : bool
        Whether a pose without solutions is proved to have none.

    Raises
    ------
    SceneError
        The robot cannot be solved as `spec` asks.
    """

    def __init__(self, robot: RobotModel, spec: IkSpec | None = None) -> None:
        self.robot = robot
        self.chain = SerialChain.from_robot(robot)
        self._spec = spec or robot.ik
        self._solver = _solver(robot, self.chain, self._spec)
        self._follower = Follower(robot)
        self._data = robot.model.createData()

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
        solver = self._solver
        if solver.complete:
            return ""
        if isinstance(solver, RedundantSolver):
            name = self.robot.joint_names[solver.joint]
            low, high = np.rad2deg([solver.values[0], solver.values[-1]])
            return (
                f"{name} sampled at {len(solver.values)} values from {low:.0f} to "
                f"{high:.0f} deg, the other joints in closed form"
            )
        if isinstance(solver, NominalSolver):
            return "closed form of the nominal arm, corrected by Newton steps"
        return f"least squares from {self._spec.restarts} starts"

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
        self, T: FloatArray, *, windings: bool = True
    ) -> tuple[FloatArray, IntArray]:
        """All solutions for many poses.

        Each solution is within the joint limits and misses its pose by less than
        1e-6 m and 1e-6 rad. A pose's solutions do not depend on the other poses.
        At a singularity where they form a curve, some of its points are returned.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        windings : bool
            Whether a solution is repeated for every whole turn of its joints that
            is within the limits. There may be many: 32 for each solution of a UR5
            with limits of ±2π. Otherwise the one nearest to the middle of the limits.

        Returns
        -------
        Q : array, shape (m, dof)
            Solutions, poses in order [rad].
        frame_index : array of int, shape (m,)
            Pose of each; ``np.bincount(frame_index, minlength=n)`` counts them.
        """
        T = np.ascontiguousarray(T, float).reshape(-1, 4, 4)
        return within_limits(
            self._solver.branches(T),
            self.robot.lower_rad,
            self.robot.upper_rad,
            self.robot.is_revolute,
            windings=windings,
        )

    def follow(
        self,
        q_start: FloatArray,
        T: FloatArray,
        *,
        tolerance: float = 1e-6,
        largest_step_rad: float = 0.2,
    ) -> FloatArray | None:
        """Follow poses that lie close to each other, a straight approach for example.

        Parameters
        ----------
        q_start : array, shape (dof,)
            Configuration at, or next to, the first pose.
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        tolerance : float
            Largest miss of a pose [m and rad].
        largest_step_rad : float
            Largest change of a joint from pose to pose.

        Returns
        -------
        array, shape (n, dof), or None
            A configuration for each pose; None if the branch ends, turns over or
            leaves the joint limits on the way.
        """
        return self._follower.follow(
            q_start, T, tolerance=tolerance, largest_step_rad=largest_step_rad
        )


def _solver(robot: RobotModel, chain: SerialChain, spec: IkSpec) -> BranchSolver:
    lower, upper = robot.lower_rad, robot.upper_rad
    if spec.redundant_joint is not None:
        _check_redundant_joint(robot, spec.redundant_joint)
    if spec.method != "numeric":
        if can_use_eaik(chain):
            return AnalyticSolver(chain)
        nominal = nominal_chain(chain)
        if nominal is not None:
            return NominalSolver(chain, nominal)
        joint = _redundant_joint(robot, chain, spec)
        if joint is not None:
            return RedundantSolver(chain, lower, upper, joint, spec.redundant_samples)
        if spec.method == "analytic":
            raise SceneError(
                "robot.ik.method: this arm has no closed form that is known to EAIK; "
                "use auto or numeric"
            )
    return NumericSolver(chain, lower, upper, spec.restarts)


def _redundant_joint(robot: RobotModel, chain: SerialChain, spec: IkSpec) -> int | None:
    """Joint to sample, None if the arm is not one of seven axes that EAIK knows."""
    if chain.dof != 7:
        return None
    candidates = list(reversed(range(chain.dof)))
    if spec.redundant_joint is not None:
        candidates = [robot.joint_names.index(spec.redundant_joint)]
    # A value that is special for no arm: held at zero, axes may become parallel.
    values = robot.lower_rad + 0.37 * (robot.upper_rad - robot.lower_rad)
    usable = (k for k in candidates if can_use_eaik(chain, [(k, float(values[k]))]))
    return next(usable, None)


def _check_redundant_joint(robot: RobotModel, name: str) -> None:
    if name not in robot.joint_names:
        raise SceneError(
            f"robot.ik.redundant_joint: no joint {name!r} moves "
            f"(joints: {', '.join(robot.joint_names)})"
        )
    if robot.dof != 7:
        raise SceneError(
            "robot.ik.redundant_joint: only arms of seven joints have one, "
            f"this one has {robot.dof}"
        )
