"""Searches with a planner of OMPL; the only module that knows OMPL."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from reachmap._typing import FloatArray
from reachmap.cell.model.planner import PlannerSpec
from reachmap.core.collision.checker import CollisionChecker
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.robot.model import RobotModel
from reachmap.errors import EngineError

_CLOCK_EVERY = 64
# A planner asks once per iteration whether to go on. Some iterations check nothing;
# a planner that only makes such iterations is to end by a count as well.
_CALLS_PER_CHECK = 20


class Budget:
    """State checks left for searching; shortening does not count.

    Parameters
    ----------
    checker : CollisionChecker
        Counts the checks.
    checks : int
    seconds : float
        Wall-clock time after which the attempt ends in any case.
    """

    def __init__(self, checker: CollisionChecker, checks: int, seconds: float) -> None:
        self.checks = checks
        self._checker = checker
        self._limit = checker.checks + checks
        self._search_limit = self._limit
        self._begin = checker.checks
        self._deadline = time.monotonic() + seconds
        self._calls = 0
        self._most_calls = _CALLS_PER_CHECK * checks
        self._most_search_calls = self._most_calls
        self.search_interrupted = False
        self.out_of_time = False

    def used(self) -> int:
        """State checks spent on searching."""
        return self._checker.checks - self._begin

    def spent(self) -> bool:
        """Whether the checks, or the seconds of the safety net, are used up."""
        self._calls += 1
        if self._checker.checks >= self._limit or self._calls >= self._most_calls:
            return True
        if self._calls % _CLOCK_EVERY == 0 and time.monotonic() > self._deadline:
            self.out_of_time = True
        return self.out_of_time

    def begin_search(self, checks: int) -> None:
        """Give the search that begins a share of the remaining checks."""
        self._search_limit = self._checker.checks + checks
        self._most_search_calls = self._calls + _CALLS_PER_CHECK * checks
        self.search_interrupted = False

    def search_ends(self) -> bool:
        """Whether the search has to end: the budget is spent, or its part of it."""
        if self.spent():
            return True
        self.search_interrupted = (
            self._checker.checks >= self._search_limit
            or self._calls >= self._most_search_calls
        )
        return self.search_interrupted

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Context in which checks are not counted."""
        used = self.used()
        yield
        unpaid = self.used() - used
        self._limit += unpaid
        self._begin += unpaid


class Goals:
    """Where a path may end; those that cannot be entered are left out.

    Outside the limits is known beforehand, in collision when OMPL looks at a goal: it
    is rare, as where a verified motion leads nearer to a body than the margin. Without
    any goal left OMPL would wait for others until the budget ends.

    Parameters
    ----------
    robot : RobotModel
    goals : array, shape (m, dof)

    Attributes
    ----------
    rows : array of int, shape (k,)
        Those within the limits.
    Q : array, shape (k, dof)
    """

    def __init__(self, robot: RobotModel, goals: FloatArray) -> None:
        inside = ((goals >= robot.lower_rad) & (goals <= robot.upper_rad)).all(axis=1)
        self.rows = np.flatnonzero(inside)
        self.Q = goals[self.rows]
        self._left = {q.tobytes() for q in self.Q}

    def leave_out(self, q: FloatArray) -> None:
        """Count a configuration in collision as no goal, if it was one."""
        self._left.discard(q.tobytes())

    def none_left(self) -> bool:
        """Whether no goal can be entered."""
        return not self._left


ou.setLogLevel(ou.LogLevel.LOG_NONE)

_OPTIMISING = frozenset(
    {"RRTstar", "BITstar", "InformedRRTstar", "SORRTstar", "AORRTC"}
)
# Their samples are drawn beforehand: restarted, they would have to be connected again.
_BATCH = frozenset({"FMT", "BFMT"})


class FoundPath:
    """A path as OMPL found it, with the space it lives in."""

    def __init__(self, information: Any, path: Any, dof: int) -> None:
        self._information, self._path, self._dof = information, path, dof

    def waypoints(self) -> FloatArray:
        """Waypoints, shape (n, dof)."""
        states = (self._path.getState(row) for row in range(self._path.getStateCount()))
        return np.array([[state[i] for i in range(self._dof)] for state in states])

    def simplified(self) -> FloatArray:
        """Waypoints after OMPL's own ``simplifyMax``."""
        og.PathSimplifier(self._information).simplifyMax(self._path)
        return self.waypoints()


class OmplSearch:
    """The cell's planner, created for each search.

    Parameters
    ----------
    motions : MotionChecker
    spec : PlannerSpec
    """

    def __init__(self, motions: MotionChecker, spec: PlannerSpec) -> None:
        self._motions, self._spec = motions, spec

    @property
    def may_restart(self) -> bool:
        """Whether interrupting the search loses little."""
        return self._spec.name not in _OPTIMISING | _BATCH

    def search(
        self,
        starts: FloatArray,
        goals: Goals,
        seed: np.random.SeedSequence,
        budget: Budget,
    ) -> FoundPath | None:
        """Run the planner once; None without an exact solution.

        Parameters
        ----------
        starts : array, shape (k, dof)
        goals : Goals
        seed : SeedSequence
            Of this search.
        budget : Budget
            Says when to give up.
        """
        # The seed is global in OMPL, and acts on what is built after it.
        ou.RNG.setSeed(int(seed.generate_state(1)[0]) or 1)
        space = self._space()
        information = ob.SpaceInformation(space)
        checker, dof = self._motions.checker, range(starts.shape[1])

        def is_valid(state: Any) -> bool:
            q = np.array([state[i] for i in dof])
            free = checker.is_free(q)
            if not free:
                goals.leave_out(q)
            return free

        information.setStateValidityChecker(is_valid)
        information.setMotionValidator(_MotionValidator(information, self._motions))
        information.setup()
        problem = ob.ProblemDefinition(information)
        for q in starts:
            problem.addStartState(_state(information, q))
        goal = ob.GoalStates(information)
        for q in goals.Q:
            goal.addState(_state(information, q))
        problem.setGoal(goal)
        if self._spec.name in _OPTIMISING:
            problem.setOptimizationObjective(
                ob.PathLengthOptimizationObjective(information)
            )
        planner = self._planner(information)
        planner.setProblemDefinition(problem)
        planner.setup()
        planner.solve(
            ob.PlannerTerminationCondition(
                lambda: goals.none_left() or budget.search_ends()
            )
        )
        if not problem.hasExactSolution():
            return None
        return FoundPath(information, problem.getSolutionPath(), starts.shape[1])

    def _space(self) -> Any:
        robot = self._motions.checker.robot
        space = ob.RealVectorStateSpace(robot.dof)
        bounds = ob.RealVectorBounds(robot.dof)
        limits = zip(robot.lower_rad, robot.upper_rad, strict=True)
        for index, (low, high) in enumerate(limits):
            bounds.setLow(index, float(low))
            bounds.setHigh(index, float(high))
        space.setBounds(bounds)
        return space

    def _planner(self, information: Any) -> Any:
        try:
            planner = getattr(og, self._spec.name)(information)
        except AttributeError as error:
            raise EngineError(f"OMPL has no planner {self._spec.name}") from error
        if self._spec.range_rad is not None and hasattr(planner, "setRange"):
            planner.setRange(self._spec.range_rad)
        if self._spec.goal_bias is not None and hasattr(planner, "setGoalBias"):
            planner.setGoalBias(self._spec.goal_bias)
        if self._spec.projection_cell_rad and hasattr(
            planner, "setProjectionEvaluator"
        ):
            planner.setProjectionEvaluator(
                self._projection(information, self._spec.projection_cell_rad)
            )
        return planner

    def _projection(self, information: Any, cell_rad: float) -> Any:
        """Coarse cells over the two joints that move the tool furthest.

        A random projection, as OMPL would take, costs three times the checks, and
        their number depends on luck rather than on the way to the goal.
        """
        joints = np.sort(np.argsort(-self._motions.checker.reach_m, kind="stable")[:2])
        return ob.RealVectorOrthogonalProjectionEvaluator(
            information.getStateSpace(), [cell_rad] * len(joints), joints.tolist()
        )


class _MotionValidator(ob.MotionValidator):  # type: ignore[misc]
    """Our definition of a free motion, given to OMPL."""

    def __init__(self, information: Any, motions: MotionChecker) -> None:
        super().__init__(information)
        self._is_free = motions.is_free
        self._dof = range(information.getStateDimension())

    def checkMotion(self, first: Any, second: Any, *_: Any) -> bool:  # noqa: N802
        return self._is_free(
            np.array([first[i] for i in self._dof]),
            np.array([second[i] for i in self._dof]),
        )


def _state(information: Any, q: FloatArray) -> Any:
    state = information.allocState()
    for index, value in enumerate(q):
        state[index] = float(value)
    return state
