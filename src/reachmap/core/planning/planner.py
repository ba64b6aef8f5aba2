"""Plans with OMPL from a configuration to any of a set of goals.

A plan is found at the planning step, shortened, and counts only when it passes the
verification distance; otherwise the attempt continues with what is left of its budget.
The straight motion to the nearest goal is tried before any search; a search that takes
long is restarted, for its length is more often bad luck than need.
Budgets are state checks, so the same seed gives the same path on any machine; the
limit in seconds is a safety net that is recorded when it strikes.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.planner import PlannerSpec
from reachmap.core.memo import memoized_part
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.planning.ompl import Budget, FoundPath, Goals, OmplSearch
from reachmap.core.planning.shortcut import shorten


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanResult:
    """One attempt.

    Attributes
    ----------
    path : array, shape (n, dof), or None
        Verified, from the start to a goal [rad].
    goal : int
        Row of the goal reached, -1 without a path.
    start : int
        Row of the start it begins at, 0 without a path.
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
    start: int = 0

    @classmethod
    def without_search(cls, path: FloatArray, goal: int = 0) -> PlanResult:
        """Result for a path that was already known."""
        return cls(
            path=path,
            goal=goal,
            checks=0,
            planning_time_s=0.0,
            planning_cpu_time_s=0.0,
            simplification_time_s=0.0,
            hit_time_limit=False,
            unverified=0,
        )


class Planner:
    """The cell's planner, created for each attempt.

    Parameters
    ----------
    motions : MotionChecker
    spec : PlannerSpec
    """

    def __init__(self, motions: MotionChecker, spec: PlannerSpec) -> None:
        self.motions = motions
        self.spec = spec
        self._spec_text = spec.model_dump_json()
        self._ompl = OmplSearch(motions, spec)

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
        start : array, shape (dof,) or (k, dof)
            Free configuration, or several, any of which will do.
        goals : array, shape (m, dof)
            Free configurations, any of which will do.
        seed : int
            Of this attempt; the result depends on nothing else.
        max_checks : int, optional
            Budget in state checks; default: the cell's.
        """
        return memoized_part(
            "plan",
            lambda: self._plan(start, goals, seed, max_checks),
            self._spec_text,
            start,
            goals,
            seed,
            max_checks,
        )

    def _plan(
        self, start: FloatArray, goals: FloatArray, seed: int, max_checks: int | None
    ) -> PlanResult:
        starts = np.atleast_2d(start)
        ends = Goals(self.motions.checker.robot, goals)
        budget = Budget(
            self.motions.checker,
            max_checks or self.spec.max_checks,
            self.spec.time_limit_s,
        )
        clock = _Clock()
        unverified, path = 0, None
        for found in self._found(starts, ends, seed, budget):
            clock.end_search()
            with budget.paused():
                path = self._shorten_and_verify(found, ends.Q, seed)
            clock.end_shortening()
            if path is not None:
                break
            unverified += 1
        else:
            clock.end_search()
        return PlanResult(
            path=path,
            goal=-1 if path is None else int(ends.rows[_nearest_row(ends.Q, path[-1])]),
            checks=budget.used(),
            planning_time_s=clock.search_wall_s,
            planning_cpu_time_s=clock.search_cpu_s,
            simplification_time_s=clock.shortening_cpu_s,
            hit_time_limit=budget.out_of_time,
            unverified=unverified,
            start=0 if path is None else _nearest_row(starts, path[0]),
        )

    def _found(
        self, starts: FloatArray, goals: Goals, seed: int, budget: Budget
    ) -> Iterator[_Straight | FoundPath]:
        """Paths at the planning step, until the budget is spent."""
        if goals.none_left():
            return
        if self.spec.straight_first:
            # Free, it is the shortest path there is: nothing is left to search for.
            away = np.linalg.norm(goals.Q - starts[:, None], axis=2)
            first, nearest = np.unravel_index(np.argmin(away), away.shape)
            if self.motions.is_free(starts[first], goals.Q[nearest]):
                yield _Straight(np.array([starts[first], goals.Q[nearest]]))
        seeds = np.random.SeedSequence(seed)
        allowance = self._first_allowance(budget)
        while not budget.spent():
            budget.begin_search(allowance)
            search = self._ompl.search(starts, goals, seeds.spawn(1)[0], budget)
            if search is not None:
                yield search
            elif budget.search_interrupted:
                allowance *= 2
            else:
                return

    def _first_allowance(self, budget: Budget) -> int:
        """Checks of the first search, all there are for planners that make one."""
        restart = self.spec.restart_checks
        if restart is None or not self._ompl.may_restart:
            return budget.checks
        return restart

    def _shorten_and_verify(
        self, found: _Straight | FoundPath, goals: FloatArray, seed: int
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


def _nearest_row(goals: FloatArray, q: FloatArray) -> int:
    return int(np.argmin(np.abs(goals - q).max(axis=1)))
