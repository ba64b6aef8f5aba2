"""Plans with OMPL from a configuration to any of a set of goals.

A plan is found at the planning step, shortened, and counts only when it passes the
verification distance; otherwise the attempt goes on with what is left of its budget.
The straight motion to the nearest goal is tried before any search; a search that takes
long is begun anew, for its length is luck more often than need.
Budgets are state checks, so the same seed gives the same path on any machine; the
limit in seconds is a safety net that is recorded when it strikes.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from reachmap._typing import FloatArray
from reachmap.cell.planner import PlannerSpec
from reachmap.core.budget import Budget
from reachmap.core.motion import MotionChecker
from reachmap.core.simplification import shorten
from reachmap.errors import EngineError

ou.setLogLevel(ou.LogLevel.LOG_NONE)

_OPTIMISING = frozenset(
    {"RRTstar", "BITstar", "InformedRRTstar", "SORRTstar", "AORRTC"}
)
# Their samples are drawn beforehand: begun anew they would have to be connected again.
_BATCH = frozenset({"FMT", "BFMT"})


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanResult:
    """One attempt.

    Attributes
    ----------
    path : array, shape (n, dof), or None
        Verified, from the start to a goal [rad].
    goal : int
        Row of the goal reached, -1 without a path.
    checks : int
        State checks spent on searching.
    planning_time_s, planning_cpu_time_s : float
        Of the search alone, wall and thread CPU.
    simplification_time_s : float
        Thread CPU of shortening and verification.
    hit_time_limit : bool
        Whether the safety net in seconds ended the attempt.
    unverified : int
        Paths that were found and did not pass the verification distance.
    """

    path: FloatArray | None
    goal: int
    checks: int
    planning_time_s: float
    planning_cpu_time_s: float
    simplification_time_s: float
    hit_time_limit: bool
    unverified: int


class Planner:
    """A planner of the cell's kind, made anew for each attempt.

    Parameters
    ----------
    motions : MotionChecker
    lower_rad, upper_rad : array, shape (dof,)
    spec : PlannerSpec
    """

    def __init__(
        self,
        motions: MotionChecker,
        lower_rad: FloatArray,
        upper_rad: FloatArray,
        spec: PlannerSpec,
    ) -> None:
        self.motions = motions
        self.spec = spec
        self._lower, self._upper = lower_rad, upper_rad

    def plan(
        self,
        start: FloatArray,
        goals: FloatArray,
        seed: int,
        *,
        max_checks: int | None = None,
    ) -> PlanResult:
        """Make one attempt.

        Parameters
        ----------
        start : array, shape (dof,)
            Free configuration.
        goals : array, shape (m, dof)
            Free configurations, any of which will do.
        seed : int
            Of this attempt; the result depends on nothing else.
        max_checks : int, optional
            Budget in state checks; default: the cell's.
        """
        inside = ((goals >= self._lower) & (goals <= self._upper)).all(axis=1)
        rows = np.flatnonzero(inside)
        goals = goals[rows]
        budget = Budget(
            self.motions.checker,
            max_checks or self.spec.max_checks,
            self.spec.time_limit_s,
        )
        clock = _Clock()
        unverified, path = 0, None
        for found in self._found(start, goals, seed, budget):
            clock.end_search()
            with budget.paused():
                path = self._shorten_and_verify(found, goals, seed)
            clock.end_shortening()
            if path is not None:
                break
            unverified += 1
        else:
            clock.end_search()
        return PlanResult(
            path=path,
            goal=-1 if path is None else int(rows[_nearest_row(goals, path[-1])]),
            checks=budget.used(),
            planning_time_s=clock.search_wall_s,
            planning_cpu_time_s=clock.search_cpu_s,
            simplification_time_s=clock.shortening_cpu_s,
            hit_time_limit=budget.out_of_time,
            unverified=unverified,
        )

    def _found(
        self, start: FloatArray, goals: FloatArray, seed: int, budget: Budget
    ) -> Iterator[_Straight | _Search]:
        """Paths at the planning step, until the budget is spent."""
        if not len(goals):
            return
        if self.spec.straight_first:
            # Free, it is the shortest path there is: nothing is left to search for.
            nearest = goals[np.argmin(np.linalg.norm(goals - start, axis=1))]
            if self.motions.is_free(start, nearest):
                yield _Straight(np.array([start, nearest]))
        seeds = np.random.SeedSequence(seed)
        allowance = self._first_allowance(budget)
        while not budget.spent():
            budget.begin_search(allowance)
            search = self._search(start, goals, seeds.spawn(1)[0], budget)
            if search is not None:
                yield search
            elif budget.search_interrupted:
                allowance *= 2
            else:
                return

    def _first_allowance(self, budget: Budget) -> int:
        """Checks of the first search, all there are for planners that make one."""
        restart = self.spec.restart_checks
        if restart is None or self.spec.name in _OPTIMISING | _BATCH:
            return budget.checks
        return restart

    def _search(
        self,
        start: FloatArray,
        goals: FloatArray,
        seed: np.random.SeedSequence,
        budget: Budget,
    ) -> _Search | None:
        """One run of the OMPL planner, or None without an exact solution."""
        # The seed is global in OMPL, and acts on what is built after it.
        ou.RNG.setSeed(int(seed.generate_state(1)[0]) or 1)
        space = self._space()
        information = ob.SpaceInformation(space)
        checker, dof = self.motions.checker, range(len(start))
        information.setStateValidityChecker(
            lambda state: checker.is_free(np.array([state[i] for i in dof]))
        )
        information.setMotionValidator(_MotionValidator(information, self.motions))
        information.setup()
        problem = ob.ProblemDefinition(information)
        problem.addStartState(_state(information, start))
        goal = ob.GoalStates(information)
        for q in goals:
            goal.addState(_state(information, q))
        problem.setGoal(goal)
        if self.spec.name in _OPTIMISING:
            problem.setOptimizationObjective(
                ob.PathLengthOptimizationObjective(information)
            )
        planner = self._planner(information)
        planner.setProblemDefinition(problem)
        planner.setup()
        planner.solve(ob.PlannerTerminationCondition(budget.search_ends))
        if not problem.hasExactSolution():
            return None
        return _Search(information, problem.getSolutionPath(), len(start))

    def _space(self) -> Any:
        space = ob.RealVectorStateSpace(len(self._lower))
        bounds = ob.RealVectorBounds(len(self._lower))
        for index, (low, high) in enumerate(zip(self._lower, self._upper, strict=True)):
            bounds.setLow(index, float(low))
            bounds.setHigh(index, float(high))
        space.setBounds(bounds)
        return space

    def _planner(self, information: Any) -> Any:
        try:
            planner = getattr(og, self.spec.name)(information)
        except AttributeError as error:
            raise EngineError(f"OMPL has no planner {self.spec.name}") from error
        if self.spec.range_rad is not None and hasattr(planner, "setRange"):
            planner.setRange(self.spec.range_rad)
        if self.spec.goal_bias is not None and hasattr(planner, "setGoalBias"):
            planner.setGoalBias(self.spec.goal_bias)
        if self.spec.projection_cell_rad and hasattr(planner, "setProjectionEvaluator"):
            planner.setProjectionEvaluator(
                self._projection(information, self.spec.projection_cell_rad)
            )
        return planner

    def _projection(self, information: Any, cell_rad: float) -> Any:
        """Coarse cells over the two joints that move the tool furthest.

        A random projection, as OMPL would take, costs three times the checks, and
        their number depends on luck rather than on the way to the goal.
        """
        joints = np.sort(np.argsort(-self.motions.checker.reach_m, kind="stable")[:2])
        return ob.RealVectorOrthogonalProjectionEvaluator(
            information.getStateSpace(), [cell_rad] * len(joints), joints.tolist()
        )

    def _shorten_and_verify(
        self, found: _Straight | _Search, goals: FloatArray, seed: int
    ) -> FloatArray | None:
        """Shorten at the planning step; where that fails to verify, more carefully."""
        motions, settings = self.motions, self.spec.simplification
        raw = found.waypoints()
        if settings.method == "none" or isinstance(found, _Straight):
            return raw if motions.path_is_verified(raw) else None
        if settings.method == "simplify_max":
            short = found.simplified()
            return short if motions.path_is_verified(short) else None
        for is_free in (motions.is_free, motions.is_verified):
            rng = np.random.default_rng(seed)
            short = shorten(
                raw,
                is_free,
                tries=settings.tries,
                rng=rng,
                goals=goals if settings.other_goals else None,
            )
            if motions.path_is_verified(short):
                return short
        return None


@dataclass(frozen=True, slots=True)
class _Straight:
    """The straight motion to a goal."""

    path: FloatArray

    def waypoints(self) -> FloatArray:
        """Start and goal, shape (2, dof)."""
        return self.path


class _Search:
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


class _Clock:
    """Adds up what searching and shortening take."""

    def __init__(self) -> None:
        self.search_wall_s = self.search_cpu_s = self.shortening_cpu_s = 0.0
        self._wall, self._cpu = time.perf_counter(), time.thread_time()

    def end_search(self) -> None:
        """Count the time since the last call as searching."""
        # The thread's clock takes long to read; it is read no more than needed.
        wall, cpu = time.perf_counter(), time.thread_time()
        self.search_wall_s += wall - self._wall
        self.search_cpu_s += cpu - self._cpu
        self._cpu = cpu

    def end_shortening(self) -> None:
        """Count the time since the last call as shortening and verifying."""
        cpu = time.thread_time()
        self.shortening_cpu_s += cpu - self._cpu
        self._wall, self._cpu = time.perf_counter(), cpu


def _state(information: Any, q: FloatArray) -> Any:
    state = information.allocState()
    for index, value in enumerate(q):
        state[index] = float(value)
    return state


def _nearest_row(goals: FloatArray, q: FloatArray) -> int:
    return int(np.argmin(np.abs(goals - q).max(axis=1)))
