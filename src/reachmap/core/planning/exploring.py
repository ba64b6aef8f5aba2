"""Exploring a roadmap: outwards from what is reached, over verified motions."""

from __future__ import annotations

import heapq
from collections.abc import Callable

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.kinematics.windings import TURN_RAD, Windings
from reachmap.core.planning.candidates import (
    CandidateMotions,
    NearestNeighbours,
    UnionFind,
)
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.planning.roadmap import START, Roadmap

_AS_IT_STANDS = 0


class KnownMotions:
    """Motions between nodes, each verified once.

    Whole turns change nothing about collisions, so a motion is known by the goals that
    it joins, whatever their turns.

    Parameters
    ----------
    motions : MotionChecker
    nodes : int
        Number of start and goals.
    before : dict, optional
        What was verified before, by the bytes of both ends; what is new is added.
    """

    def __init__(
        self,
        motions: MotionChecker,
        nodes: int,
        before: dict[bytes, bool] | None = None,
    ) -> None:
        self._motions, self._nodes = motions, nodes
        self._before = {} if before is None else before
        self._known: dict[int, bool] = {}

    def is_verified(self, a: int, b: int, q_from: FloatArray, q_to: FloatArray) -> bool:
        """Whether the shortest motion between two nodes is free."""
        key = min(a, b) * self._nodes + max(a, b)
        known = self._known.get(key)
        if known is None:
            ends = q_from.tobytes() + q_to.tobytes()
            if ends not in self._before:
                self._before[ends] = self._motions.is_verified(q_from, q_to)
            known = self._known[key] = self._before[ends]
        return known


class Explorer:
    """Reaches frames over verified motions, nearest to the start first.

    A goal of a joint with more than a full turn may be reached at any turn that the
    limits allow: neighbours are neighbours whatever the turns, and a node at another
    turn is made when it is reached.

    Parameters
    ----------
    roadmap : Roadmap
        ``edges``, ``reached`` and ``frame_reached`` are filled in.
    candidates : CandidateMotions
        Of the roadmap's start and goals.
    motions : KnownMotions
    windings : Windings
    on_frame : callable
        Called for each frame that is reached, to report progress.
    """

    def __init__(
        self,
        roadmap: Roadmap,
        candidates: CandidateMotions,
        motions: KnownMotions,
        windings: Windings,
        on_frame: Callable[[], object] = lambda: None,
    ) -> None:
        self._roadmap, self._motions = roadmap, motions
        self._windings, self._on_frame = windings, on_frame
        self._distance = {START: 0.0}
        self._begin = candidates.begin.tolist()
        self._near = candidates.node.tolist()
        self._length = candidates.length_rad.tolist()
        self._turns = candidates.turns
        # Turns by number: they are compared often and there are few of them.
        dof = len(roadmap.configurations[START])
        self._known_turns = [np.zeros(dof, np.int64)]
        self._number_of_turns = {self._known_turns[0].tobytes(): _AS_IT_STANDS}

    def explore_start(self) -> IntArray:
        """Explore from the scan configuration; the nodes reached."""
        return self._explore(START, _AS_IT_STANDS, START)

    def explore(
        self, goal_node: int, turns: IntArray, before: int, path: FloatArray
    ) -> IntArray:
        """Go on from a goal that a verified path leads to.

        Parameters
        ----------
        goal_node : int
            Node of the goal as it stands.
        turns : int array, shape (dof,)
            Whole turns at which the path arrives.
        before : int
            Connected node that the path begins at.
        path : array, shape (n, dof)

        Returns
        -------
        int array
            Nodes of the goals reached, as they stand.
        """
        number = self._number(turns)
        node = self._node(goal_node, number)
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        along = self._distance[before] + np.cumsum(steps)
        waypoints = self._roadmap.add_path(path, before, node)
        self._distance.update(zip(waypoints, along.tolist(), strict=False))
        self._reach(node, float(along[-1]))
        return self._explore(goal_node, number, node)

    def _explore(self, base: int, turns: int, node: int) -> IntArray:
        roadmap, Q = self._roadmap, self._roadmap.configurations
        frame, done = roadmap.goals.frame, roadmap.frame_reached
        group = [base]
        pending = self._motions_from(base, turns, node)
        while pending:
            distance, base, turns, before, before_base = heapq.heappop(pending)
            if base == START or done[frame[base - 1]]:
                continue
            q = Q[base]
            if turns != _AS_IT_STANDS:
                q = q + TURN_RAD * self._known_turns[turns]
            if not self._motions.is_verified(before_base, base, Q[before], q):
                continue
            node = self._node(base, turns)
            roadmap.edges.append((before, node))
            self._reach(node, distance)
            group.append(base)
            for motion in self._motions_from(base, turns, node):
                heapq.heappush(pending, motion)
        return np.array(group, np.int64)

    def _node(self, base: int, turns: int) -> int:
        if turns == _AS_IT_STANDS:
            return base
        q = self._roadmap.configurations[base] + TURN_RAD * self._known_turns[turns]
        return self._roadmap.add_turned(base, q)

    def _reach(self, node: int, distance: float) -> None:
        roadmap = self._roadmap
        self._distance[node] = distance
        roadmap.reached.append(node)
        frame = roadmap.goals.frame[roadmap.goal_of(node)]
        if not roadmap.frame_reached[frame]:
            roadmap.frame_reached[frame] = True
            self._on_frame()

    def _motions_from(
        self, base: int, turns: int, node: int
    ) -> list[tuple[float, int, int, int, int]]:
        here = self._distance[node]
        frame, done = self._roadmap.goals.frame, self._roadmap.frame_reached
        motions = []
        for k in range(self._begin[base], self._begin[base + 1]):
            near = self._near[k]
            if near == START or done[frame[near - 1]]:
                continue
            arrives = turns
            if self._turns is not None:
                total = self._known_turns[turns] + self._turns[k]
                if not self._roadmap.allows(near, total, self._windings):
                    continue
                arrives = self._number(total)
            motions.append((here + self._length[k], near, arrives, node, base))
        motions.sort()
        return motions

    def _number(self, turns: IntArray) -> int:
        key = turns.tobytes()
        if key not in self._number_of_turns:
            self._number_of_turns[key] = len(self._known_turns)
            self._known_turns.append(turns)
        return self._number_of_turns[key]


class NearestReached:
    """The reached node nearest to each goal, kept up to date as nodes are reached."""

    def __init__(
        self, roadmap: Roadmap, Q: FloatArray, weight: FloatArray, windings: Windings
    ) -> None:
        self._roadmap, self._Q = roadmap, Q
        self._weight, self._windings = weight, windings
        self._seen = 0
        self.distance = np.full(len(Q), np.inf)
        self.node = np.full(len(Q), START, np.int64)

    def look_at(self, nodes: IntArray) -> None:
        """Take in what was reached since, for the goals that are still open."""
        reached = np.array(self._roadmap.reached[self._seen :], np.int64)
        if not len(reached):
            return
        self._seen = len(self._roadmap.reached)
        new = np.array([self._roadmap.configurations[k] for k in reached])
        tree = NearestNeighbours(new, self._weight, self._windings)
        distance, row = (found[:, 0] for found in tree.of(self._Q[nodes], 1))
        nearer = distance < self.distance[nodes]
        self.distance[nodes[nearer]] = distance[nearer]
        self.node[nodes[nearer]] = reached[row[nearer]]


def components_of_open_goals(
    roadmap: Roadmap,
    candidates: CandidateMotions,
    motions: KnownMotions,
    windings: Windings,
) -> list[IntArray]:
    """Join goals of unreached frames; components by size, ties by first node.

    Motions are verified shortest first and only where they join two components
    (Kruskal's algorithm).

    Returns
    -------
    list of int array
        Nodes of each component, rising.
    """
    Q = roadmap.goal_array
    chosen = roadmap.open_goals()
    sets = UnionFind(len(chosen))
    for a, b in candidates.pairs_among(chosen):
        if sets.find(a) == sets.find(b):
            continue
        _, turns = windings.shortest(Q[b] - Q[a])
        if motions.is_verified(a, b, Q[a], Q[b] + TURN_RAD * turns):
            sets.join(a, b)
            if not turns.any():
                roadmap.edges.append((a, b))
    members: dict[int, list[int]] = {}
    for node in np.flatnonzero(chosen).tolist():
        members.setdefault(sets.find(node), []).append(node)
    groups = sorted(members.values(), key=lambda nodes: (-len(nodes), nodes[0]))
    return [np.array(nodes, np.int64) for nodes in groups]
