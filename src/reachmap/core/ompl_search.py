"""Searches with a planner of OMPL; the only module that knows OMPL."""

from __future__ import annotations

from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from reachmap._typing import FloatArray
from reachmap.cell.planner import PlannerSpec
from reachmap.core.budget import Budget
from reachmap.core.motion import MotionChecker
from reachmap.errors import EngineError

ou.setLogLevel(ou.LogLevel.LOG_NONE)

_OPTIMISING = frozenset(
    {"RRTstar", "BITstar", "InformedRRTstar", "SORRTstar", "AORRTC"}
)
# Their samples are drawn beforehand: begun anew they would have to be connected again.
_BATCH = frozenset({"FMT", "BFMT"})


class FoundPath:
    """A path as OMPL found it, with the space it lives in."""

    def __init__(self, information: Any, path: Any, dof: int) -> None:
        self._information, self._path, self._dof = information, path, dof

    def waypoints(self) -> FloatArray:
        """Way-points, shape (n, dof)."""
        states = (self._path.getState(row) for row in range(self._path.getStateCount()))
        return np.array([[state[i] for i in range(self._dof)] for state in states])

    def simplified(self) -> FloatArray:
        """Way-points after OMPL's own ``simplifyMax``."""
        og.PathSimplifier(self._information).simplifyMax(self._path)
        return self.waypoints()


class OmplSearch:
    """A planner of the cell's kind, made anew for each search.

    Parameters
    ----------
    motions : MotionChecker
    spec : PlannerSpec
    """

    def __init__(self, motions: MotionChecker, spec: PlannerSpec) -> None:
        self._motions, self._spec = motions, spec

    @property
    def may_begin_anew(self) -> bool:
        """Whether a search that is cut short has lost little."""
        return self._spec.name not in _OPTIMISING | _BATCH

    def search(
        self,
        start: FloatArray,
        goals: FloatArray,
        seed: np.random.SeedSequence,
        budget: Budget,
    ) -> FoundPath | None:
        """Run the planner once; None without an exact solution.

        Parameters
        ----------
        start : array, shape (dof,)
        goals : array, shape (m, dof)
            Within the limits.
        seed : SeedSequence
            Of this search.
        budget : Budget
            Says when to give up.
        """
        # The seed is global in OMPL, and acts on what is built after it.
        ou.RNG.setSeed(int(seed.generate_state(1)[0]) or 1)
        space = self._space()
        information = ob.SpaceInformation(space)
        checker, dof = self._motions.checker, range(len(start))
        information.setStateValidityChecker(
            lambda state: checker.is_free(np.array([state[i] for i in dof]))
        )
        information.setMotionValidator(_MotionValidator(information, self._motions))
        information.setup()
        problem = ob.ProblemDefinition(information)
        problem.addStartState(_state(information, start))
        goal = ob.GoalStates(information)
        for q in goals:
            goal.addState(_state(information, q))
        problem.setGoal(goal)
        if self._spec.name in _OPTIMISING:
            problem.setOptimizationObjective(
                ob.PathLengthOptimizationObjective(information)
            )
        planner = self._planner(information)
        planner.setProblemDefinition(problem)
        planner.setup()
        planner.solve(ob.PlannerTerminationCondition(budget.search_ends))
        if not problem.hasExactSolution():
            return None
        return FoundPath(information, problem.getSolutionPath(), len(start))

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
