"""Short paths from a shared network of routes.

A planner's path is an accident of its seed; what is short is found by combining and
shortening many. Routes from the scan configuration to goals spread over all that is
reached are shortened and cut into pieces, and the pieces of different routes are joined
where straight motions allow it (path hybridisation: Raveh, Enosh and Halperin, "A
little more, a lot better: improving path quality by a path-merging algorithm", 2011).
The shortest ways through this network are settled, by time and length together, and
begin the next round. Every path to a goal then branches off a settled route where that
costs least. Shortened alone, routes of two seeds have waypoints at other places and
other numbers of them; settled and exchanged they nearly agree.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.planner import RoadmapSpec
from reachmap.core.memo import memoized_part
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.planning.planner import Planner
from reachmap.core.planning.shortcut import cut_corners, settle, skip_waypoints
from reachmap.core.planning.timing import Pace, path_length_rad
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
# Directions that differ by less are one: 1 less the cosine of their angle.
_SAME_WAY = 1e-9
# Routes that are joined need not be perfect: they are settled afterwards.
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
    """Verified routes from a configuration, and where they may be left.

    Attributes
    ----------
    Q : array, shape (nodes, dof)
        Node 0 is where all routes begin.
    before : int array, shape (nodes,)
        Previous node on the way to each, -1 for the first.
    length_rad, cost_s : array, shape (nodes,)
        Of the way to each; the cost is that of the pace.
    pace : Pace
    """

    Q: FloatArray
    before: IntArray
    length_rad: FloatArray
    cost_s: FloatArray
    pace: Pace

    @classmethod
    def of(cls, routes: Sequence[FloatArray], pace: Pace) -> RouteNetwork:
        """Routes, verified paths of shape (n, dof) from one configuration."""
        Q, before = _pieces_of(routes)
        length_rad = np.zeros(len(Q))
        for node in range(1, len(Q)):
            step = float(np.linalg.norm(Q[node] - Q[before[node]]))
            length_rad[node] = length_rad[before[node]] + step
        return cls._with_costs(Q, before, length_rad, pace)

    @classmethod
    def joined(
        cls, routes: Sequence[FloatArray], pace: Pace, motions: MotionChecker
    ) -> RouteNetwork:
        """Join routes where they come near each other."""
        Q, before = _pieces_of(routes)
        length_rad, before = _shortest_ways(Q, before, motions)
        return cls._with_costs(Q, before, length_rad, pace)

    @classmethod
    def _with_costs(
        cls, Q: FloatArray, before: IntArray, length_rad: FloatArray, pace: Pace
    ) -> RouteNetwork:
        order = np.argsort(length_rad, kind="stable")
        cost_s = _costs_along(Q, before, order, pace)
        return cls(Q=Q, before=before, length_rad=length_rad, cost_s=cost_s, pace=pace)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.Q)

    def route_to(self, node: int) -> FloatArray:
        """Way from the start to a node, shape (n, dof)."""
        nodes = [node]
        while nodes[-1] != 0:
            nodes.append(int(self.before[nodes[-1]]))
        return self.Q[nodes[::-1]]

    def ways_to(
        self, goals: FloatArray, motions: MotionChecker, spec: RoadmapSpec
    ) -> list[FloatArray]:
        """Verified paths to any of a set of goals, the cheapest first.

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
            the shortest is straight.
        """
        origin, row, length_rad, cost_s = self._branches(goals, spec.way_tries)
        tested: dict[int, bool] = {}

        def is_verified(k: int) -> bool:
            if k not in tested:
                ends = self.Q[origin[k]], goals[row[k]]
                # At the planning step first, as planners search: its checks grow
                # evenly with the length, and foretell those of a neighbouring grasp.
                tested[k] = motions.is_free(*ends) and motions.is_verified(*ends)
            return tested[k]

        by_length = np.argsort(length_rad, kind="stable")[: spec.way_tries].tolist()
        shortest = next((k for k in by_length if is_verified(k)), None)
        if shortest is None:
            return []
        if origin[shortest] == 0:
            return [np.array([self.Q[0], goals[row[shortest]]])]
        ways: dict[int, FloatArray] = {}
        by_cost = np.argsort(cost_s, kind="stable")[: spec.way_tries].tolist()
        for k in [*by_cost, shortest]:
            first = self._first_on_way(int(origin[k]))
            if first not in ways and is_verified(k):
                ways[first] = np.vstack([self.route_to(int(origin[k])), goals[row[k]]])
                if len(ways) == spec.ways:
                    break
        return list(ways.values())

    def _branches(
        self, goals: FloatArray, tries: int
    ) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Nodes to leave the network at, goals to go to, lengths and costs in all."""
        near = min(tries, len(self.Q))
        node = self._tree.query(goals, k=[*range(1, near + 1)])[1]
        # From the start itself, however far it is: nothing is shorter.
        origin = np.column_stack([np.zeros(len(goals), np.int64), node]).ravel()
        row = np.repeat(np.arange(len(goals)), near + 1)
        change = goals[row] - self.Q[origin]
        length_rad = self.length_rad[origin] + np.linalg.norm(change, axis=1)
        return (
            origin,
            row,
            length_rad,
            self.cost_s[origin] + self.pace.of_motions(change),
        )

    def _first_on_way(self, node: int) -> int:
        while self.before[node] > 0:
            node = int(self.before[node])
        return node


def _pieces_of(routes: Sequence[FloatArray]) -> tuple[FloatArray, IntArray]:
    """Nodes along routes, and the previous one of each."""
    nodes, before = [routes[0][0]], [-1]
    for route in routes:
        last = 0
        for q in pieces(route, _PIECE_RAD)[1:]:
            before.append(last)
            last = len(nodes)
            nodes.append(q)
    return np.array(nodes), np.array(before, np.int64)


def _costs_along(
    Q: FloatArray, before: IntArray, order: IntArray, pace: Pace
) -> FloatArray:
    """Cost of the way to each node; it stops at corners, not between pieces."""
    cost_s, corner = np.zeros(len(Q)), np.zeros(len(Q), np.int64)
    for node in order.tolist():
        last = int(before[node])
        if last < 0:
            continue
        step, along = Q[node] - Q[last], Q[last] - Q[corner[last]]
        product = float(np.linalg.norm(step) * np.linalg.norm(along))
        goes_on = last > 0 and product - float(step @ along) <= _SAME_WAY * product
        corner[node] = corner[last] if goes_on else last
        cost_s[node] = cost_s[corner[node]] + float(
            pace.of_motions(Q[node] - Q[corner[node]])
        )
    return cost_s


def _shortest_ways(
    Q: FloatArray, along: IntArray, motions: MotionChecker
) -> tuple[FloatArray, IntArray]:
    """Shortest ways from node 0 along routes and over joins between them.

    ``along`` is the previous node on each route. A join is verified when the search
    wants to walk it.
    """
    length_rad, before = np.full(len(Q), np.inf), np.full(len(Q), -1, np.int64)
    count = min(_NEIGHBOURS + 1, len(Q))
    _, near = cKDTree(Q).query(Q, k=[*range(1, count + 1)])
    known: list[list[int]] = [[] for _ in Q]
    for node, last in enumerate(along.tolist()):
        if last >= 0:
            known[last].append(node)
            known[node].append(last)
    pending = [(0.0, 0, -1, True)]
    while pending:
        length, node, previous, is_known = heapq.heappop(pending)
        if length_rad[node] < np.inf:
            continue
        if not is_known and not motions.is_verified(Q[previous], Q[node]):
            continue
        length_rad[node], before[node] = length, previous
        for others, sure in ((known[node], True), (near[node].tolist(), False)):
            for other in others:
                step = float(np.linalg.norm(Q[other] - Q[node]))
                if length_rad[other] == np.inf and (sure or step <= _LONGEST_JOIN_RAD):
                    heapq.heappush(pending, (length + step, other, node, sure))
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
    pace: Pace,
    seed: int,
) -> RouteNetwork:
    """Improve routes by plans, by joining them, by shortening and by settling.

    Parameters
    ----------
    routes : sequence of array, shape (n, dof)
        A verified path to each of some goals, all from one configuration; at least one.
    goals : sequence of array, shape (m, dof)
        For each route, the configurations at any of which it may end.
    planners : sequence of Planner
        For more routes, in turns.
    spec : RoadmapSpec
    pace : Pace
    seed : int
    """
    motions, rng = planners[0].motions, np.random.default_rng([seed, len(routes)])
    improve = _Improver(motions, pace, rng, spec)
    routes = [improve.shortened(route) for route in routes]
    bent = [k for k, route in enumerate(routes) if not _is_straight(route, goals[k])]
    more = []
    for number in range(spec.route_plans if bent else 0):
        k = bent[number % len(bent)]
        plan = planners[number % len(planners)].plan(
            routes[k][0], goals[k], int(rng.integers(1, 2**31))
        )
        if plan.path is not None:
            more.append(improve.shortened(plan.path))
    if not bent:
        return RouteNetwork.of(routes, pace)
    network = improve.joined([*routes, *more])
    for _ in range(spec.route_rounds):
        better = []
        for k, route in enumerate(routes):
            ways = network.ways_to(goals[k], motions, spec) if k in bent else []
            better += [improve.settled(way) for way in ways or [route]]
        # What is settled has few waypoints; joins would bring new ones.
        network = RouteNetwork.of(better, pace)
    return network


class _Improver:
    """Improves routes, each only once where there is a memo."""

    def __init__(
        self,
        motions: MotionChecker,
        pace: Pace,
        rng: np.random.Generator,
        spec: RoadmapSpec,
    ) -> None:
        self._motions, self._pace, self._rng = motions, pace, rng
        self._rough, self._gain = _ROUGH * spec.least_gain, spec.least_gain

    def shortened(self, route: FloatArray) -> FloatArray:
        """A shorter route."""
        return self._once(
            "shorten",
            lambda: shorten_until(route, self._motions, self._rng, self._rough),
            route,
        )

    def settled(self, route: FloatArray) -> FloatArray:
        """A cheaper route."""
        return self._once(
            "settle",
            lambda: settle(
                route, self._motions.is_verified, self._pace, self._rng, self._gain
            ),
            route,
        )

    def joined(self, routes: Sequence[FloatArray]) -> RouteNetwork:
        """Routes with the joins between them."""
        return memoized_part(
            "network",
            lambda: RouteNetwork.joined(routes, self._pace, self._motions),
            list(routes),
        )

    def _once(
        self, name: str, improve: Callable[[], FloatArray], route: FloatArray
    ) -> FloatArray:
        def compute() -> tuple[FloatArray, Any]:
            better = improve()
            return better, self._rng.bit_generator.state

        state = self._rng.bit_generator.state
        better, self._rng.bit_generator.state = memoized_part(
            name, compute, route, state
        )
        return better


def _is_straight(route: FloatArray, goals: FloatArray) -> bool:
    straight = np.linalg.norm(goals - route[0], axis=1).min()
    return path_length_rad(route) <= _STRAIGHT * float(straight)
