"""Short paths from a shared network of routes.

A planner's path is an accident of its seed; what is short is found by combining and
shortening many. Routes from the scan configuration to goals spread over all that is
reached are shortened and cut into pieces, and the pieces of different routes are joined
where straight motions allow it (path hybridisation: Raveh, Enosh and Halperin, "A
little more, a lot better: improving path quality by a path-merging algorithm", 2011).
The shortest ways through this network begin the next round. Every path to a goal then
branches off where that is shortest, and is shortened until it stops gaining.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.roadmap import RoadmapSpec
from reachmap.core.memo import memoized_part
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.planning.planner import Planner
from reachmap.core.planning.shortcut import cut_corners, skip_waypoints
from reachmap.core.planning.timing import path_length_rad
from reachmap.geometry import pieces

# Pieces as long as the arm sees of its way between two of them: longer ones miss
# places to branch off, shorter ones are not worth their checks.
_PIECE_RAD = 0.25
_NEIGHBOURS = 8
_LONGEST_JOIN_RAD = 1.5
# A path this near to the straight distance has nothing to gain from other routes.
_STRAIGHT = 1.02
# Corners cut between two looks at the length, and a bound that is hardly ever met.
_BLOCK, _MOST_BLOCKS = 15, 40
# Routes of a network need not be perfect: what branches off is shortened once more.
_ROUGH = 3.0


def shorten_until(
    path: FloatArray,
    motions: MotionChecker,
    rng: np.random.Generator,
    least_gain: float,
) -> FloatArray:
    """Cut corners and skip waypoints until that no longer shortens the path.

    Parameters
    ----------
    path : array, shape (n, dof)
        Verified.
    motions : MotionChecker
    rng : numpy.random.Generator
    least_gain : float
        A block of tries that gains a smaller share of the length is the last one.

    Returns
    -------
    array, shape (m, dof)
        Verified, never longer.
    """
    path = skip_waypoints(path, motions.is_verified)
    length = path_length_rad(path)
    for _ in range(_MOST_BLOCKS):
        if len(path) < 3:
            break
        path = cut_corners(path, motions.is_verified, tries=_BLOCK, rng=rng)
        path = skip_waypoints(path, motions.is_verified)
        now = path_length_rad(path)
        if length - now < least_gain * length:
            break
        length = now
    return path


@dataclass(frozen=True, kw_only=True, eq=False)  # no slots: it keeps its tree
class RouteNetwork:
    """Verified routes from a configuration, joined where they come near each other.

    Attributes
    ----------
    Q : array, shape (nodes, dof)
        Node 0 is where all routes begin.
    length_rad : array, shape (nodes,)
        Of the shortest way to each.
    before : int array, shape (nodes,)
        Previous node on it, -1 for the first.
    """

    Q: FloatArray
    length_rad: FloatArray
    before: IntArray

    @classmethod
    def of(cls, routes: Sequence[FloatArray], motions: MotionChecker) -> RouteNetwork:
        """Join routes, verified paths of shape (n, dof) from one configuration."""
        nodes = [routes[0][0]]
        along: list[list[int]] = [[]]
        for route in routes:
            last = 0
            for q in pieces(route, _PIECE_RAD)[1:]:
                along[last].append(len(nodes))
                along.append([last])
                last = len(nodes)
                nodes.append(q)
        Q = np.array(nodes)
        length_rad, before = _shortest_ways(Q, along, motions)
        return cls(Q=Q, length_rad=length_rad, before=before)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.Q)

    def route_to(self, node: int) -> FloatArray:
        """Shortest way from the start to a node, shape (n, dof)."""
        nodes = [node]
        while nodes[-1] != 0:
            nodes.append(int(self.before[nodes[-1]]))
        return self.Q[nodes[::-1]]

    def ways_to(
        self, goals: FloatArray, motions: MotionChecker, spec: RoadmapSpec
    ) -> list[FloatArray]:
        """Verified paths to any of a set of goals, the shortest first.

        Parameters
        ----------
        goals : array, shape (m, dof)
        motions : MotionChecker
        spec : RoadmapSpec
            ``ways`` is the most paths, ``way_tries`` the most motions tried from the
            network to a goal.

        Returns
        -------
        list of array, shape (n, dof)
            Each leaves the start another way and ends at a goal; a single one where
            that is straight.
        """
        near = min(spec.way_tries, len(self.Q))
        distance, node = self._tree.query(goals, k=[*range(1, near + 1)])
        # From the start itself, however far it is: nothing is shorter.
        distance = np.column_stack(
            [np.linalg.norm(goals - self.Q[0], axis=1), distance]
        )
        node = np.column_stack([np.zeros(len(goals), np.int64), node])
        total = self.length_rad[node] + distance
        ways: list[FloatArray] = []
        used: set[int] = set()
        for entry in np.argsort(total, axis=None, kind="stable")[: spec.way_tries]:
            row, column = divmod(int(entry), near + 1)
            origin = int(node[row, column])
            if self._first_on_way(origin) in used:
                continue
            # At the planning step first, as planners search: its checks grow evenly
            # with the length, and foretell those of a neighbouring grasp.
            ends = self.Q[origin], goals[row]
            if motions.is_free(*ends) and motions.is_verified(*ends):
                ways.append(np.vstack([self.route_to(origin), goals[row]]))
                used.add(self._first_on_way(origin))
                if origin == 0 or len(ways) == spec.ways:
                    break
        return ways

    def _first_on_way(self, node: int) -> int:
        while self.before[node] > 0:
            node = int(self.before[node])
        return node


def _shortest_ways(
    Q: FloatArray, along: Sequence[Sequence[int]], motions: MotionChecker
) -> tuple[FloatArray, IntArray]:
    """Shortest ways from node 0 along routes and over joins between them.

    A join is verified when the search wants to walk it.
    """
    length_rad, before = np.full(len(Q), np.inf), np.full(len(Q), -1, np.int64)
    count = min(_NEIGHBOURS + 1, len(Q))
    _, near = cKDTree(Q).query(Q, k=[*range(1, count + 1)])
    pending = [(0.0, 0, -1, True)]
    while pending:
        length, node, previous, is_known = heapq.heappop(pending)
        if length_rad[node] < np.inf:
            continue
        if not is_known and not motions.is_verified(Q[previous], Q[node]):
            continue
        length_rad[node], before[node] = length, previous
        for others, known in ((along[node], True), (near[node].tolist(), False)):
            for other in others:
                step = float(np.linalg.norm(Q[other] - Q[node]))
                if length_rad[other] == np.inf and (known or step <= _LONGEST_JOIN_RAD):
                    heapq.heappush(pending, (length + step, other, node, known))
    return length_rad, before


def spread_over(Q: FloatArray, count: int) -> IntArray:
    """Rows of configurations far from each other (farthest point first)."""
    if not len(Q):
        return np.zeros(0, np.int64)
    chosen = [0]
    away = np.linalg.norm(Q - Q[0], axis=1)
    while len(chosen) < min(count, len(Q)) and away.max() > 0:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(Q - Q[chosen[-1]], axis=1))
    return np.array(chosen, np.int64)


def build_network(
    routes: Sequence[FloatArray],
    goals: Sequence[FloatArray],
    planners: Sequence[Planner],
    spec: RoadmapSpec,
    seed: int,
) -> RouteNetwork:
    """Improve routes by plans, by joining them, and by shortening.

    Parameters
    ----------
    routes : sequence of array, shape (n, dof)
        A verified path to each of some goals, all from one configuration; at least one.
    goals : sequence of array, shape (m, dof)
        For each route, the configurations at any of which it may end.
    planners : sequence of Planner
        For more routes, in turns.
    spec : RoadmapSpec
    seed : int
    """
    motions, rng = planners[0].motions, np.random.default_rng([seed, len(routes)])
    rough = _ROUGH * spec.least_gain

    def shortened(route: FloatArray) -> FloatArray:
        def compute() -> tuple[FloatArray, Any]:
            short = shorten_until(route, motions, rng, rough)
            return short, rng.bit_generator.state

        short, rng.bit_generator.state = memoized_part(
            "shorten", compute, route, rng.bit_generator.state
        )
        return short

    routes = [shortened(route) for route in routes]
    bent = [k for k, route in enumerate(routes) if not _is_straight(route, goals[k])]
    more = []
    for number in range(spec.route_plans if bent else 0):
        k = bent[number % len(bent)]
        plan = planners[number % len(planners)].plan(
            routes[k][0], goals[k], int(rng.integers(1, 2**31))
        )
        if plan.path is not None:
            more.append(shortened(plan.path))
    network = _network_of([*routes, *more], motions)
    for _ in range(spec.route_rounds if bent else 0):
        better = []
        for k, route in enumerate(routes):
            ways = network.ways_to(goals[k], motions, spec) if k in bent else []
            better += [shortened(way) for way in ways or [route]]
        network = _network_of(better, motions)
    return network


def _network_of(routes: Sequence[FloatArray], motions: MotionChecker) -> RouteNetwork:
    return memoized_part(
        "network", lambda: RouteNetwork.of(routes, motions), list(routes)
    )


def _is_straight(route: FloatArray, goals: FloatArray) -> bool:
    straight = np.linalg.norm(goals - route[0], axis=1).min()
    return path_length_rad(route) <= _STRAIGHT * float(straight)
