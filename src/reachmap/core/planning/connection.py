"""Connects the scan configuration to what exploring the roadmap did not reach.

Components are tried largest first. For each, straight motions from reached
configurations near by come first, since they cost next to nothing; then the planner,
from the nearest reached configuration and from the scan configuration, to goals spread
over the component. Failure is not proof of absence: the budget spent is recorded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.planner import PlannerSpec, SimplificationSpec
from reachmap.core.planning.planner import Planner
from reachmap.core.planning.roadmap import (
    START,
    CandidateMotions,
    Explorer,
    Roadmap,
    components_of_open_goals,
)
from reachmap.core.planning.timing import path_length_rad

GOALS_PER_ATTEMPT = 16
STRAIGHT_TRIES = 12
SMALL_COMPONENT = 40
CHECKS_LARGE = 20_000
CHECKS_SMALL = 2_000

# Where in a component a plan arrives does not matter.
ROADMAP_PLANNER = PlannerSpec(
    name="RRTConnect",
    range_rad=0.5,
    max_checks=CHECKS_LARGE,
    simplification=SimplificationSpec(other_goals=False),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Connection:
    """A roadmap as far as it could be connected, and what that took.

    Attributes
    ----------
    roadmap : Roadmap
    component : int array, shape (goals,)
        Component of each goal: 0 was explored from the scan configuration, the others
        from where a plan arrived, or were not reached; -1 for goals not needed.
    attempts, paths_found : int array, shape (components,)
        Attempts at joining each component to the scan configuration, by a plan or a
        straight motion, and whether one succeeded.
    """

    roadmap: Roadmap
    component: IntArray
    attempts: IntArray
    paths_found: IntArray


def connect(
    start: FloatArray,
    goals: FloatArray,
    frame: IntArray,
    planner: Planner,
    *,
    attempts: int,
    seed: int,
    on_frame: Callable[[], object] = lambda: None,
) -> Connection:
    """Find which frames the scan configuration is connected to.

    Parameters
    ----------
    start : array, shape (dof,)
    goals : array, shape (n, dof)
        Free configurations of all frames.
    frame : int array, shape (n,)
        Frame of each goal.
    planner : Planner
        For components, see :data:`ROADMAP_PLANNER`.
    attempts : int
        Attempts of the planner per component.
    seed : int
    on_frame : callable
        Called for each frame that is reached by exploring, to report progress.
    """
    roadmap = Roadmap.of(start, goals, frame)
    motions = planner.motions
    candidates = CandidateMotions.of(roadmap.goal_array, motions.checker.reach_m)
    connector = _Connector(roadmap, planner, seed)
    explorer = Explorer(roadmap, candidates, motions, on_frame)
    connector.explore(explorer, attempts)
    connector.connect(components_of_open_goals(roadmap, candidates, motions), attempts)
    return connector.connection()


class _Connector:
    """Collects components, as sets of nodes, with what it took to join them."""

    def __init__(self, roadmap: Roadmap, planner: Planner, seed: int) -> None:
        self._roadmap, self._planner, self._seed = roadmap, planner, seed
        self._Q = roadmap.goal_array
        self._weight = planner.motions.checker.reach_m
        self._components: list[IntArray] = []
        self._attempts: list[int] = []
        self._tree: cKDTree | None = None

    def explore(self, explorer: Explorer, attempts: int) -> None:
        """Explore from the start, then from wherever plans arrive.

        Plans go to goals spread over all that is open, until ``attempts`` of them
        fail in a row.
        """
        self._components.append(explorer.explore(START, START, 0.0))
        self._attempts.append(1)
        failures = plans = 0
        while failures < attempts:
            nodes = np.flatnonzero(self._roadmap.open_goals())
            if not len(nodes):
                break
            found = self._plan(START, nodes, (0, plans), CHECKS_LARGE)
            plans += 1
            failures += 1
            if found is not None:
                node, length_rad = found
                self._components.append(explorer.explore(node, START, length_rad))
                self._attempts.append(failures)
                failures = 0

    def connect(self, components: list[IntArray], attempts: int) -> None:
        """Plan to each component; afterwards look once more at what lies near."""
        first = len(self._components)
        self._components += components
        self._attempts += [0] * len(components)
        for label in range(first, len(self._components)):
            if self._roadmap.open_goals()[self._components[label]].any():
                self._connect(label, attempts)
        for label in range(first, len(self._components)):
            if not self._is_reached(label):
                self._join_straight(label)

    def connection(self) -> Connection:
        """Sum up."""
        component = np.full(len(self._Q), -1, np.int64)
        for label, members in enumerate(self._components):
            component[members] = label
        reached = [self._is_reached(k) for k in range(len(self._components))]
        return Connection(
            roadmap=self._roadmap,
            component=component[1:],
            attempts=np.array(self._attempts, np.int64),
            paths_found=np.array(reached, np.int64),
        )

    def _is_reached(self, label: int) -> bool:
        return bool(self._roadmap.reached[self._components[label][0]])

    def _connect(self, label: int, attempts: int) -> None:
        if self._join_straight(label):
            return
        members = self._components[label]
        budget = CHECKS_SMALL if len(members) < SMALL_COMPONENT else CHECKS_LARGE
        for attempt in range(attempts):
            self._attempts[label] += 1
            start = START if attempt % 2 else int(self._nearest_pairs(label)[1][0])
            if self._plan(start, members, (label, attempt), budget) is not None:
                self._accept(label)
                return

    def _join_straight(self, label: int) -> bool:
        for goal, node in zip(*self._nearest_pairs(label), strict=True):
            if self._planner.motions.is_verified(self._Q[node], self._Q[goal]):
                self._roadmap.edges.append((int(node), int(goal)))
                self._attempts[label] += 1
                self._accept(label)
                return True
        return False

    def _plan(
        self, start: int, nodes: IntArray, key: tuple[int, int], budget: int
    ) -> tuple[int, float] | None:
        """Plan to some of the nodes; the one reached, and the length of the path."""
        rng = np.random.default_rng([self._seed, *key])
        if len(nodes) > GOALS_PER_ATTEMPT:
            nodes = np.sort(rng.choice(nodes, GOALS_PER_ATTEMPT, replace=False))
        result = self._planner.plan(
            self._Q[start],
            self._Q[nodes],
            int(rng.integers(1, 2**31)),
            max_checks=budget,
        )
        if result.path is None:
            return None
        node = int(nodes[result.goal])
        self._roadmap.add_path(result.path, start, node)
        return node, path_length_rad(result.path)

    def _accept(self, label: int) -> None:
        self._roadmap.reached[self._components[label]] = True
        self._tree = None

    def _nearest_pairs(self, label: int) -> tuple[IntArray, IntArray]:
        """Members of a component and their nearest reached nodes, nearest first."""
        reached = np.flatnonzero(self._roadmap.reached)
        if self._tree is None:
            self._tree = cKDTree(self._Q[reached] * self._weight)
        members = self._components[label]
        distance, row = self._tree.query(self._Q[members] * self._weight)
        order = np.argsort(distance, kind="stable")[:STRAIGHT_TRIES]
        return members[order], reached[row[order]]
