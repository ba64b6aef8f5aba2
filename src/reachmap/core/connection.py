"""Connects the scan configuration to what exploring the roadmap did not reach.

Components are tried largest first. For each, straight motions from reached
configurations near by come first, since they cost next to nothing; then the planner,
from the nearest reached configuration and from the scan configuration, to goals spread
over the component. Failure is not proof of absence: the budget spent is recorded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.planner import PlannerSpec
from reachmap.core.connectivity import (
    START,
    CandidateMotions,
    Explorer,
    Roadmap,
    components_of_open_goals,
)
from reachmap.core.planning import Planner
from reachmap.core.timing import path_length_rad

GOALS_PER_ATTEMPT = 16
STRAIGHT_TRIES = 12
SMALL_COMPONENT = 40
CHECKS_LARGE = 20_000
CHECKS_SMALL = 2_000

ROADMAP_PLANNER = PlannerSpec(name="RRTConnect", range_rad=0.5, max_checks=CHECKS_LARGE)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Connection:
    """A roadmap as far as it could be connected, and what that took.

    Attributes
    ----------
    roadmap : Roadmap
    component : int array, shape (goals,)
        0 for goals reached by exploring from the scan configuration, k for the k-th
        component that was planned to, -1 for goals that were not needed.
    attempts, paths_found : int array, shape (components,)
        Attempts of the planner; a component joined without it has none and
        counts one path found.
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
    """
    roadmap = Roadmap.of(start, goals, frame)
    motions = planner.motions
    candidates = CandidateMotions.of(roadmap.goal_array, motions.checker.reach_m)
    explorer = Explorer(roadmap, candidates, motions)
    explorer.explore(START, START, 0.0)
    plan_outwards(explorer, roadmap, planner, attempts=attempts, seed=seed)
    connector = _Connector(
        roadmap, planner, components_of_open_goals(roadmap, candidates, motions), seed
    )
    connector.run(attempts)
    return Connection(
        roadmap=roadmap,
        component=connector.labels(),
        attempts=connector.attempts,
        paths_found=connector.paths_found,
    )


def plan_outwards(
    explorer: Explorer, roadmap: Roadmap, planner: Planner, *, attempts: int, seed: int
) -> int:
    """Plan to goals spread over all that is open, and explore from what is reached.

    Ends after ``attempts`` failures in a row; returns the number of plans made.
    """
    Q, failures, plans = roadmap.goal_array, 0, 0
    while failures < attempts:
        nodes = np.flatnonzero(roadmap.open_goals())
        if not len(nodes):
            break
        rng = np.random.default_rng([seed, plans])
        plans += 1
        if len(nodes) > GOALS_PER_ATTEMPT:
            nodes = np.sort(rng.choice(nodes, GOALS_PER_ATTEMPT, replace=False))
        result = planner.plan(
            Q[START], Q[nodes], int(rng.integers(1, 2**31)), max_checks=CHECKS_LARGE
        )
        if result.path is None:
            failures += 1
            continue
        failures = 0
        node = int(nodes[result.goal])
        roadmap.add_path(result.path, START, node)
        explorer.explore(node, START, path_length_rad(result.path))
    return plans


class _Connector:
    """Component k (from 1) is ``components[k - 1]``; 0 is what was explored."""

    def __init__(
        self, roadmap: Roadmap, planner: Planner, components: list[IntArray], seed: int
    ) -> None:
        self._roadmap, self._planner, self._seed = roadmap, planner, seed
        self._Q = roadmap.goal_array
        self._weight = planner.motions.checker.reach_m
        self._explored = roadmap.reached.copy()
        self._components = components
        self.attempts = np.zeros(len(components) + 1, np.int64)
        self.paths_found = np.zeros(len(components) + 1, np.int64)
        self.paths_found[0] = 1
        self._tree: cKDTree | None = None

    def run(self, attempts: int) -> None:
        """Plan to each component; afterwards look once more at what lies near."""
        for label in self._unreached():
            self._connect(label, attempts)
        for label in self._unreached():
            self._join_straight(label)

    def labels(self) -> IntArray:
        """Component of each goal, shape (goals,)."""
        component = np.full(len(self._Q), -1, np.int64)
        component[self._explored] = 0
        for label, members in enumerate(self._components, start=1):
            component[members] = label
        return component[1:]

    def _unreached(self) -> list[int]:
        return [
            label
            for label, members in enumerate(self._components, start=1)
            if not self._roadmap.reached[members[0]]
        ]

    def _connect(self, label: int, attempts: int) -> None:
        if not self._roadmap.open_goals()[self._components[label - 1]].any():
            return
        if self._join_straight(label):
            return
        small = len(self._components[label - 1]) < SMALL_COMPONENT
        for attempt in range(attempts):
            self.attempts[label] += 1
            if self._plan(label, attempt, CHECKS_SMALL if small else CHECKS_LARGE):
                return

    def _join_straight(self, label: int) -> bool:
        for goal, node in zip(*self._nearest_pairs(label), strict=True):
            self._roadmap.motions_checked += 1
            if self._planner.motions.is_verified(self._Q[node], self._Q[goal]):
                self._roadmap.edges.append((int(node), int(goal)))
                self._accept(label)
                return True
        return False

    def _plan(self, label: int, attempt: int, budget: int) -> bool:
        rng = np.random.default_rng([self._seed, label, attempt])
        members = self._components[label - 1]
        if len(members) > GOALS_PER_ATTEMPT:
            members = np.sort(rng.choice(members, GOALS_PER_ATTEMPT, replace=False))
        start = START if attempt % 2 else int(self._nearest_pairs(label)[1][0])
        result = self._planner.plan(
            self._Q[start],
            self._Q[members],
            int(rng.integers(1, 2**31)),
            max_checks=budget,
        )
        if result.path is None:
            return False
        self._roadmap.add_path(result.path, start, int(members[result.goal]))
        self._accept(label)
        return True

    def _accept(self, label: int) -> None:
        self.paths_found[label] = 1
        self._roadmap.reached[self._components[label - 1]] = True
        self._tree = None

    def _nearest_pairs(self, label: int) -> tuple[IntArray, IntArray]:
        """Members of a component and their nearest reached nodes, nearest first."""
        reached = np.flatnonzero(self._roadmap.reached)
        if self._tree is None:
            self._tree = cKDTree(self._Q[reached] * self._weight)
        members = self._components[label - 1]
        distance, row = self._tree.query(self._Q[members] * self._weight)
        order = np.argsort(distance, kind="stable")[:STRAIGHT_TRIES]
        return members[order], reached[row[order]]
