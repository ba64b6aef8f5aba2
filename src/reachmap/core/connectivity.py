"""A roadmap of free configurations: components, and paths from the scan configuration.

The goals of all test frames are themselves the roadmap. Near neighbours are joined by
verified straight motions, shortest first and only where they join two components
(Kruskal's algorithm), so that about one motion per configuration is checked. All
frames of a component are path reachable if one is: the planner then has to reach
components, not frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.motion import MotionChecker

NEIGHBOURS = 8
LONGEST_JOIN_RAD = 1.5


class UnionFind:
    """Disjoint sets of ``0 … n − 1``."""

    def __init__(self, size: int) -> None:
        self._parent = list(range(size))
        self._size = [1] * size

    def find(self, item: int) -> int:
        """Representative of the set of an item."""
        parent = self._parent
        while parent[item] != item:
            parent[item] = parent[parent[item]]
            item = parent[item]
        return item

    def join(self, a: int, b: int) -> None:
        """Make one set of two."""
        a, b = self.find(a), self.find(b)
        if a == b:
            return
        if self._size[a] < self._size[b]:
            a, b = b, a
        self._parent[b] = a
        self._size[a] += self._size[b]

    def add(self) -> int:
        """Append an item in a set of its own."""
        self._parent.append(len(self._parent))
        self._size.append(1)
        return len(self._parent) - 1

    def labels(self) -> IntArray:
        """Set of each item, numbered by first appearance, shape (n,)."""
        roots = np.array([self.find(k) for k in range(len(self._parent))], np.int64)
        _, first, inverse = np.unique(roots, return_index=True, return_inverse=True)
        rank = np.empty(len(first), np.int64)
        rank[np.argsort(first, kind="stable")] = np.arange(len(first))
        return np.asarray(rank[inverse])


@dataclass(slots=True, kw_only=True, eq=False)
class Roadmap:
    """Configurations joined by verified motions; grows as paths are found.

    Attributes
    ----------
    configurations : list of array, shape (dof,)
        Node 0 is the scan configuration; the next ``goals`` ones are the goals of the
        test frames, later ones way-points of planned paths.
    goals : int
    edges : list of (int, int)
        Verified straight motions.
    sets : UnionFind
        Components.
    """

    configurations: list[FloatArray]
    goals: int
    edges: list[tuple[int, int]] = field(default_factory=list)
    sets: UnionFind

    @classmethod
    def of(cls, start: FloatArray, goals: FloatArray) -> Roadmap:
        """Roadmap without edges: a start and goals (n, dof)."""
        return cls(
            configurations=[start, *goals],
            goals=len(goals),
            sets=UnionFind(len(goals) + 1),
        )

    def join(self, a: int, b: int) -> None:
        """Record a verified motion between two nodes."""
        self.edges.append((a, b))
        self.sets.join(a, b)

    def add_path(self, path: FloatArray, first: int, last: int) -> None:
        """Record a verified path between two nodes, way-points included."""
        previous = first
        for q in path[1:-1]:
            self.configurations.append(np.array(q))
            node = self.sets.add()
            self.join(previous, node)
            previous = node
        self.join(previous, last)

    def goal_components(self) -> IntArray:
        """Component of each goal, shape (goals,); 0 is the start's."""
        return self.sets.labels()[1 : self.goals + 1]

    def reached(self) -> BoolArray:
        """Whether each goal is connected to the start, shape (goals,)."""
        return np.asarray(self.goal_components() == 0)

    def shortest_paths(self) -> ShortestPaths:
        """Lengths and routes from the start through the recorded motions."""
        Q = np.array(self.configurations)
        ends = np.array(self.edges, np.int64).reshape(-1, 2)
        weights = np.linalg.norm(Q[ends[:, 0]] - Q[ends[:, 1]], axis=1)
        graph = coo_matrix(
            (np.maximum(weights, 1e-12), (ends[:, 0], ends[:, 1])),
            shape=(len(Q), len(Q)),
        ).tocsr()
        length, before = dijkstra(
            graph, directed=False, indices=0, return_predecessors=True
        )
        return ShortestPaths(
            configurations=Q, length_rad=length, before=np.asarray(before, np.int64)
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShortestPaths:
    """Routes from the scan configuration (Dijkstra).

    Attributes
    ----------
    configurations : array, shape (nodes, dof)
    length_rad : array, shape (nodes,)
        Infinite for nodes that are not connected.
    before : int array, shape (nodes,)
        Previous node on the route, negative at its start.
    """

    configurations: FloatArray
    length_rad: FloatArray
    before: IntArray

    def of_goals(self, goals: int) -> FloatArray:
        """Lengths of the first goals [rad], shape (goals,)."""
        return self.length_rad[1 : goals + 1]

    def path_to_goal(self, goal: int) -> FloatArray:
        """Configurations from the scan configuration to a goal, shape (n, dof)."""
        node, nodes = goal + 1, [goal + 1]
        while node != 0:
            node = int(self.before[node])
            nodes.append(node)
        return self.configurations[nodes[::-1]]


def join_neighbours(
    roadmap: Roadmap, motions: MotionChecker, *, neighbours: int = NEIGHBOURS
) -> int:
    """Join near neighbours among the goals and the start.

    Distances are weighted by how far each joint moves the tool.

    Returns
    -------
    int
        Motions that were checked.
    """
    Q = np.array(roadmap.configurations[: roadmap.goals + 1])
    tried = 0
    for a, b in _candidate_motions(Q, motions.checker.reach_m, neighbours):
        if roadmap.sets.find(a) == roadmap.sets.find(b):
            continue
        tried += 1
        if motions.is_verified(Q[a], Q[b]):
            roadmap.join(a, b)
    return tried


def _candidate_motions(
    Q: FloatArray, reach_m: FloatArray, neighbours: int
) -> Sequence[tuple[int, int]]:
    """Pairs of near neighbours, shortest first, ties by index."""
    count = min(neighbours + 1, len(Q))
    if count < 2:
        return []
    weighted = Q * reach_m
    distance, near = cKDTree(weighted).query(weighted, k=count)
    a = np.repeat(np.arange(len(Q)), count)
    b, length = near.ravel(), distance.ravel()
    usable = (a != b) & (np.abs(Q[a] - Q[b]).max(axis=1) <= LONGEST_JOIN_RAD)
    pairs = np.sort(np.stack([a[usable], b[usable]], axis=1), axis=1)
    pairs, first = np.unique(pairs, axis=0, return_index=True)
    order = np.argsort(length[usable][first], kind="stable")
    return [(int(p), int(q)) for p, q in pairs[order]]
