"""Connects the scan configuration to what exploring the roadmap did not reach.

Planners of different kinds take turns, with budgets that rise: what one misses another
often finds at once. First they aim at goals spread over all that is open; then at each
component by itself, the largest first, after straight motions from reached
configurations near by, which cost next to nothing. They begin at the scan configuration
or at the reached configuration that is nearest, and wherever a plan arrives, exploring
goes on. What stays open is looked at once more by a lazy roadmap of samples, a method
that is independent of the planners. Failure is not proof of absence: what was spent,
and by which method, is recorded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.cell.model.planner import PlannerSpec, RoadmapSpec, SimplificationSpec
from reachmap.core.kinematics.windings import TURN_RAD, Windings
from reachmap.core.planning.candidates import CandidateMotions
from reachmap.core.planning.exploring import (
    Explorer,
    KnownMotions,
    NearestReached,
    components_of_open_goals,
)
from reachmap.core.planning.lazy_prm import LazySamples
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.planning.planner import Planner
from reachmap.core.planning.roadmap import START, Goals, Roadmap

# Parts of the budget of a plan to all that is open: for the try from what is reached
# near by, which finds most of what is easy, and for the two at each component, of which
# there are many where something is unreachable. Chosen on six hard cells, by checks.
_LEAST, _FEW, _SOME = 0.05, 0.1, 0.2
# Where more than this share of the frames is open, a longer search, by this factor: one
# passage may open all of it. Of six searches into a cage two end within 20,000 checks,
# the other four between 24,000 and 39,000.
_MUCH, _LONG = 0.1, 3
# What the components that are open at the end share among them, and what one of them
# may have at most (_LONG). From several starts: under a ceiling 16 of 16 such searches
# into a pocket along the limit of a joint end, after 11,000 checks on average, and 1 of
# 6 from the scan configuration alone.
_LAST = 4.0
# Where many components stay open, this many searches of samples have their full budget,
# and the others, which are smaller, a part of it.
_FULL_SEARCHES, _LEAST_SHARE = 3, 8
# A tree of LBKPIECE1 that found nothing soon is restarted; RRTConnect finds 1 of 6
# frames in a cage when restarted every 150 checks, and 6 of 6 when it is left to grow.
_RESTARTS = {"RRTConnect": None}
_RESTART_CHECKS = 150
_TURNS_PER_GOAL = 3
STRAIGHT, SAMPLES = "straight", "samples"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Connection:
    """A roadmap as far as it could be connected, and what that took.

    Attributes
    ----------
    roadmap : Roadmap
    component : int array, shape (goals,)
        Component of each goal: 0 was explored from the scan configuration, the others
        from where a path arrived, or were not reached; -1 for goals not needed.
    attempts : int array, shape (components,)
        Attempts at joining each component, by plans, straight motions and samples.
    reached : bool array, shape (components,)
        Whether one succeeded.
    methods : tuple of str
        Exploring, the planners, the lazy roadmap.
    checks : int array, shape (components, methods)
        State checks that each method spent on each component.
    agreed : bool array, shape (components,)
        Whether the verdict rests on more than the planners: there is a verified path,
        or the lazy roadmap found none with the checks that it had either.
    """

    roadmap: Roadmap
    component: IntArray
    attempts: IntArray
    reached: BoolArray
    methods: tuple[str, ...]
    checks: IntArray
    agreed: BoolArray


def connect(
    start: FloatArray,
    goals: Goals,
    motions: MotionChecker,
    spec: RoadmapSpec,
    *,
    seed: int,
    on_frame: Callable[[], object] = lambda: None,
    is_enough: Callable[[BoolArray], bool] = lambda reached: False,
    known: dict[bytes, bool] | None = None,
) -> Connection:
    """Find which frames the scan configuration is connected to.

    Parameters
    ----------
    start : array, shape (dof,)
    goals : Goals
        Free configurations of all frames.
    motions : MotionChecker
    spec : RoadmapSpec
    seed : int
    on_frame : callable
        Called for each frame that is reached, to report progress.
    is_enough : callable
        Is told which frames straight motions reach; where that will do, nothing is
        planned, and the rest is in no component.
    known : dict, optional
        Motions that were verified for another start or other goals, see
        :class:`.KnownMotions`.
    """
    windings = Windings(motions.checker.robot)
    turns = windings.nearest(goals.Q, start, goals.low, goals.high)
    roadmap = Roadmap.of(start, goals.turned(turns))
    connector = _Connector(roadmap, motions, windings, spec, seed, on_frame, known)
    connector.connect(is_enough)
    return connector.connection()


@dataclass(slots=True, eq=False)
class _Component:
    """Goals that are reached or lost together, and what was tried."""

    members: IntArray
    checks: IntArray
    attempts: int = 0
    agreed: bool = False


class _Connector:
    """Collects components with what it took to join them."""

    def __init__(
        self,
        roadmap: Roadmap,
        motions: MotionChecker,
        windings: Windings,
        spec: RoadmapSpec,
        seed: int,
        on_frame: Callable[[], object],
        known: dict[bytes, bool] | None,
    ) -> None:
        self._roadmap, self._motions = roadmap, motions
        self._windings, self._spec, self._seed = windings, spec, seed
        self._Q = roadmap.goal_array
        self._weight = motions.checker.reach_m
        self._planners = [Planner(motions, s) for s in portfolio(spec)]
        self._methods = (STRAIGHT, *spec.planners, SAMPLES)
        self._reached: list[_Component] = []
        self._open: list[_Component] = []
        self._plans = 0
        self._order = list(range(len(spec.planners)))
        self._samples: LazySamples | None = None
        self._sample_checks_left = _FULL_SEARCHES * spec.sample_checks
        self._nearest = NearestReached(roadmap, self._Q, self._weight, windings)
        self._candidates = CandidateMotions.of(self._Q, self._weight, windings, spec)
        self._known = KnownMotions(motions, len(self._Q), known)
        self._explorer = Explorer(
            roadmap, self._candidates, self._known, windings, on_frame
        )

    def connect(self, is_enough: Callable[[BoolArray], bool]) -> None:
        """Explore, then plan to whatever is open."""
        first = self._component(np.zeros(0, np.int64))
        with _Meter(self, first, STRAIGHT):
            first.members = self._explorer.explore_start()
        first.attempts = 1
        self._reached.append(first)
        if is_enough(np.asarray(self._roadmap.frame_reached, bool)):
            return
        self._plan_to_all()
        nodes = components_of_open_goals(
            self._roadmap, self._candidates, self._known, self._windings
        )
        self._open = [self._component(members) for members in nodes]
        few, some = self._share(_FEW), self._share(_SOME)
        several = self._spec.starts_per_plan
        self._each_open(self._join_straight)
        self._each_open(lambda part: self._plan_to(part, few, several))
        self._each_open(self._search_samples)
        self._each_open(self._join_straight)
        self._each_open(lambda part: self._plan_to(part, some, several))
        last = self._share(min(_LONG, max(_SOME, _LAST / max(1, len(self._open)))))
        self._each_open(lambda part: self._plan_to(part, last, several))
        # New samples: half of them lie around what is still open, which is less now.
        self._samples = None
        self._each_open(self._search_samples)

    def _share(self, share: float) -> int:
        return max(1, int(self._spec.max_checks * share))

    def connection(self) -> Connection:
        """Sum up."""
        component = np.full(len(self._Q), -1, np.int64)
        parts = [*self._reached, *self._open]
        for label, part in enumerate(parts):
            component[part.members] = label
        is_reached = np.arange(len(parts)) < len(self._reached)
        return Connection(
            roadmap=self._roadmap,
            component=component[1:],
            attempts=np.array([part.attempts for part in parts], np.int64),
            reached=is_reached,
            methods=self._methods,
            checks=np.array([part.checks for part in parts], np.int64),
            agreed=is_reached | np.array([part.agreed for part in parts], bool),
        )

    def _component(self, members: IntArray) -> _Component:
        return _Component(members, np.zeros(len(self._methods), np.int64))

    def _plan_to_all(self) -> None:
        """Plan to goals spread over all that is open, until no planner arrives."""
        attempt = self._component(np.zeros(0, np.int64))
        least, several = self._share(_LEAST), self._spec.starts_per_plan
        while True:
            attempt.members = np.flatnonzero(self._roadmap.open_goals())
            if not len(attempt.members):
                return
            if not (
                self._join_straight(attempt)
                or self._plan(attempt, self._order[0], least, several)
                or self._plan_to(attempt, self._spec.max_checks, starts=1)
                or self._search_long(attempt)
            ):
                return
            attempt = self._component(np.zeros(0, np.int64))

    def _search_long(self, part: _Component) -> bool:
        """Plan once more, for longer, where many frames are open."""
        done = self._roadmap.frame_reached
        frames = np.unique(self._roadmap.goals.frame)
        if np.mean(~done[frames]) <= _MUCH:
            return False
        budget, spec = _LONG * self._spec.max_checks, self._spec
        # A search that is restarted gains little from more of the same.
        restarted = [
            spec.planners[m] not in _RESTARTS for m in range(len(spec.planners))
        ]
        order = sorted(range(len(restarted)), key=restarted.__getitem__)
        return any(self._plan(part, m, budget, 1) for m in order)

    def _each_open(self, attempt: Callable[[_Component], bool]) -> None:
        """Try each open component; what is reached in passing is left out."""
        for part in tuple(self._open):
            if part in self._open:
                attempt(part)

    def _plan_to(self, part: _Component, budget: int, starts: int) -> bool:
        """Let the planners take turns, the one that arrived last first."""
        return any(self._plan(part, m, budget, starts) for m in tuple(self._order))

    def _plan(self, part: _Component, method: int, budget: int, count: int) -> bool:
        """Plan to some members of a component and explore from where that arrives.

        It may begin at ``count`` configurations, the first being the scan one.
        """
        self._plans += 1
        rng = np.random.default_rng([self._seed, self._plans])
        nodes = part.members
        if len(nodes) > self._spec.goals_per_plan:
            nodes = np.sort(rng.choice(nodes, self._spec.goals_per_plan, replace=False))
        starts = self._starts(nodes)[:count]
        goals = self._roadmap.goals
        row, turns = self._windings.spread(
            self._Q[nodes],
            self._roadmap.configurations[starts[0]],
            goals.low[nodes - 1],
            goals.high[nodes - 1],
            each=_TURNS_PER_GOAL,
        )
        goal_nodes = nodes[row]
        part.attempts += 1
        with _Meter(self, part, self._spec.planners[method]):
            result = self._planners[method].plan(
                np.array([self._roadmap.configurations[k] for k in starts]),
                self._Q[goal_nodes] + TURN_RAD * turns,
                int(rng.integers(1, 2**31)),
                max_checks=budget,
            )
        if result.path is None:
            return False
        self._order.remove(method)
        self._order.insert(0, method)
        goal, start = result.goal, starts[result.start]
        self._arrive(part, int(goal_nodes[goal]), turns[goal], start, result.path)
        return True

    def _starts(self, nodes: IntArray) -> list[int]:
        """The scan configuration, and the reached nodes that are nearest to goals."""
        near = self._nearest_pairs(nodes)[1][: self._spec.starts_per_plan - 1]
        return [START, *(k for k in dict.fromkeys(near.tolist()) if k != START)]

    def _join_straight(self, part: _Component) -> bool:
        """Try the straight motions to a component from what is reached near by."""
        with _Meter(self, part, STRAIGHT):
            for goal, node in zip(*self._nearest_pairs(part.members), strict=True):
                q = self._roadmap.configurations[node]
                change, _ = self._windings.shortest(self._Q[goal] - q)
                turns = np.round((q + change - self._Q[goal]) / TURN_RAD)
                turns = np.where(self._windings.turns, turns, 0).astype(np.int64)
                q_goal = self._Q[goal] + TURN_RAD * turns
                if self._roadmap.allows(
                    int(goal), turns, self._windings
                ) and self._motions.is_verified(q, q_goal):
                    break
            else:
                return False
        part.attempts += 1
        self._arrive(part, int(goal), turns, int(node), np.array([q, q_goal]))
        return True

    def _search_samples(self, part: _Component) -> bool:
        """Look for a way out of a component with the lazy roadmap of samples."""
        if not self._spec.samples:
            return False
        if self._samples is None:
            self._samples = LazySamples(
                self._roadmap,
                self._motions,
                self._windings,
                self._spec,
                np.random.default_rng([self._seed, 1 << 20, self._plans]),
            )
        part.attempts += 1
        most, before = self._spec.sample_checks, self._motions.checker.checks
        budget = max(most // _LEAST_SHARE, min(most, self._sample_checks_left))
        with _Meter(self, part, SAMPLES):
            way = self._samples.way_out(part.members, budget)
        self._sample_checks_left -= self._motions.checker.checks - before
        part.agreed = way is None
        if way is None:
            return False
        self._arrive(part, way.goal_node, way.turns, way.node, way.path)
        return True

    def _arrive(
        self,
        part: _Component,
        goal_node: int,
        turns: IntArray,
        before: int,
        path: FloatArray,
    ) -> None:
        """Explore from where a path arrives, and see what is left open."""
        with _Meter(self, part, STRAIGHT):
            members = self._explorer.explore(goal_node, turns, before, path)
        arrived = self._component(members)
        arrived.checks, arrived.attempts = part.checks.copy(), part.attempts
        self._reached.append(arrived)
        is_open = self._roadmap.open_goals()
        for other in self._open:
            other.members = other.members[is_open[other.members]]
        self._open = [other for other in self._open if len(other.members)]

    def _nearest_pairs(self, nodes: IntArray) -> tuple[IntArray, IntArray]:
        """Goals and the reached nodes nearest to them, nearest first."""
        self._nearest.look_at(np.flatnonzero(self._roadmap.open_goals()))
        distance, node = self._nearest.distance[nodes], self._nearest.node[nodes]
        order = np.argsort(distance, kind="stable")[: self._spec.straight_tries]
        return nodes[order], node[order]


class _Meter:
    """Adds the state checks made within it to what a method spent on a component."""

    def __init__(self, connector: _Connector, part: _Component, method: str) -> None:
        self._checker = connector._motions.checker
        self._checks, self._row = part.checks, connector._methods.index(method)

    def __enter__(self) -> None:
        self._begin = self._checker.checks

    def __exit__(self, *_: object) -> None:
        self._checks[self._row] += self._checker.checks - self._begin


def portfolio(spec: RoadmapSpec) -> Iterator[PlannerSpec]:
    """Planners of a roadmap; where in a component they arrive does not matter."""
    for name in spec.planners:
        yield PlannerSpec(
            name=name,
            range_rad=spec.range_rad,
            projection_cell_rad=spec.projection_cell_rad,
            max_checks=spec.max_checks,
            restart_checks=_RESTARTS.get(name, _RESTART_CHECKS),
            simplification=SimplificationSpec(other_goals=False),
        )
