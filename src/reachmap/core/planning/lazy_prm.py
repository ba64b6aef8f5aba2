"""Second opinion: a lazy roadmap of samples around what planners did not reach.

It shares no search with the planners. From the goals that are still open it goes
outwards, over straight motions that are verified when the search wants to walk them,
until it meets what is connected to the scan configuration. Where it runs out of motions
first, the goals lie in a pocket that the samples see no way out of.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.planner import RoadmapSpec
from reachmap.core.kinematics.windings import TURN_RAD, Windings
from reachmap.core.planning.candidates import NearestNeighbours
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.planning.roadmap import Roadmap

# Spread of the samples around an open goal, from the width of a gap to the next room.
_AROUND_RAD = (0.05, 1.0)
# More samples per dimension tell an arm of few joints nothing new.
_PER_JOINT = 10
# So many times the neighbours, one after another, while motions run out too soon.
_WIDER = (1, 4)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WayOut:
    """A path that was found.

    Attributes
    ----------
    path : array, shape (n, dof)
        Verified, from a connected node to a goal.
    node, goal_node : int
        Where it begins, and the goal it ends at as it stands.
    turns : int array, shape (dof,)
        Whole turns at which it arrives.
    """

    path: FloatArray
    node: int
    goal_node: int
    turns: IntArray


class LazySamples:
    """Samples of the free space, and the roadmap's goals among them.

    Parameters
    ----------
    roadmap : Roadmap
    motions : MotionChecker
    windings : Windings
    spec : RoadmapSpec
    rng : numpy.random.Generator
    """

    def __init__(
        self,
        roadmap: Roadmap,
        motions: MotionChecker,
        windings: Windings,
        spec: RoadmapSpec,
        rng: np.random.Generator,
    ) -> None:
        self._roadmap, self._motions = roadmap, motions
        self._windings, self._spec = windings, spec
        goals = roadmap.goal_array
        self._goals = len(goals)
        around = goals[np.flatnonzero(roadmap.open_goals())]
        waypoints = [node for node in roadmap.reached if roadmap.goal_of(node) < 0]
        self._waypoint_node = waypoints
        on_the_way = np.array([roadmap.configurations[k] for k in waypoints])
        samples = self._free_samples(around, rng)
        self._Q = np.vstack([goals, on_the_way, samples])
        weight = motions.checker.reach_m
        self._near_goals = NearestNeighbours(goals, weight, windings)
        self._near_samples = NearestNeighbours(self._Q[self._goals :], weight, windings)
        self._known: dict[tuple[int, int], bool] = {}

    def _free_samples(self, around: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Half of the samples anywhere, half around the open goals; the free ones."""
        robot = self._motions.checker.robot
        count = min(self._spec.samples, _PER_JOINT**robot.dof)
        low, high = robot.lower_rad, robot.upper_rad
        anywhere = rng.uniform(low, high, (count - count // 2, robot.dof))
        centre = around[rng.integers(0, len(around), count // 2)]
        least, most = np.log(_AROUND_RAD).tolist()
        spread = np.exp(rng.uniform(least, most, (len(centre), 1)))
        near = centre + spread * rng.normal(size=centre.shape)
        samples = np.vstack([anywhere, np.clip(near, low, high)])
        return samples[self._motions.checker.free_mask(samples)]

    def way_out(self, members: IntArray, checks: int) -> WayOut | None:
        """Look for a path between goals and what is connected.

        Parameters
        ----------
        members : int array
            Nodes of the goals, as they stand.
        checks : int
            Budget in state checks.

        Returns
        -------
        WayOut or None
            None where the budget, or what motions there are, came to an end.
        """
        checker = self._motions.checker
        limit = checker.checks + checks
        connected = self._connected()
        before = {int(node): -1 for node in members}
        reached = dict.fromkeys(before, 0.0)
        # Towards what is connected (A*): the estimate is the straight distance.
        left = self._distances_to(np.array(sorted(connected)))
        for wider in _WIDER:
            # Out of motions, it looks further around everything it has come to.
            pending: list[tuple[float, float, int, int]] = []
            for node, distance in reached.items():
                self._push(pending, distance, node, left, wider)
            while pending and checker.checks < limit:
                _, distance, node, previous = heapq.heappop(pending)
                if node in before or not self._is_verified(previous, node):
                    continue
                before[node], reached[node] = previous, distance
                if node in connected:
                    way = self._turned_path(connected[node], node, before)
                    if way is not None:
                        return way
                    continue
                self._push(pending, distance, node, left, wider)
        return None

    def _connected(self) -> dict[int, int]:
        """Node of the roadmap at which each configuration here is connected."""
        roadmap = self._roadmap
        connected: dict[int, int] = {}
        for node in roadmap.reached:
            goal = roadmap.goal_of(node)
            if goal >= 0 or node == 0:
                connected.setdefault(goal + 1, node)
        for k, node in enumerate(self._waypoint_node):
            connected[self._goals + k] = node
        return connected

    def _distances_to(self, nodes: IntArray) -> FloatArray:
        ones = np.ones(self._Q.shape[1])
        tree = NearestNeighbours(self._Q[nodes], ones, self._windings)
        return tree.of(self._Q, 1)[0][:, 0]

    def _push(
        self,
        pending: list[tuple[float, float, int, int]],
        distance: float,
        node: int,
        left: FloatArray,
        wider: int,
    ) -> None:
        q, spec = self._Q[node : node + 1], self._spec
        near = [
            self._near_goals.of(q, wider * spec.neighbours)[1][0],
            self._near_samples.of(q, wider * spec.sample_neighbours)[1][0]
            + self._goals,
        ]
        rows = np.concatenate(near)
        # However long: a few hundred samples lie far apart in six dimensions.
        change, _ = self._windings.shortest(self._Q[rows] - q)
        lengths = np.linalg.norm(change, axis=1)
        for row, length in zip(rows.tolist(), lengths.tolist(), strict=True):
            total = distance + length
            heapq.heappush(pending, (total + float(left[row]), total, row, node))

    def _is_verified(self, a: int, b: int) -> bool:
        key = (min(a, b), max(a, b))
        if key not in self._known:
            change, _ = self._windings.shortest(self._Q[b] - self._Q[a])
            self._known[key] = self._motions.is_verified(
                self._Q[a], self._Q[a] + change
            )
        return self._known[key]

    def _turned_path(
        self, start: int, node: int, before: dict[int, int]
    ) -> WayOut | None:
        """The path from a connected node, None where a joint would leave its limits."""
        robot = self._motions.checker.robot
        path = [self._roadmap.configurations[start]]
        while before[node] >= 0:
            following = before[node]
            change, _ = self._windings.shortest(self._Q[following] - self._Q[node])
            path.append(path[-1] + change)
            node = following
        way = np.array(path)
        turns = np.round((way[-1] - self._Q[node]) / TURN_RAD).astype(np.int64)
        # Free of rounding along the way, so that nothing has to be added up again.
        way[-1] = self._Q[node] + turns * TURN_RAD
        goals = self._roadmap.goals
        inside = ((way >= robot.lower_rad) & (way <= robot.upper_rad)).all()
        low, high = goals.low[node - 1], goals.high[node - 1]
        if not inside or not self._windings.allows(low, high, turns):
            return None
        return WayOut(path=way, node=start, goal_node=node, turns=turns)
