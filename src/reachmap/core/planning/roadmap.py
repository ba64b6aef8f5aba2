"""A roadmap of free configurations, and paths from the scan configuration.

The goals of all test frames are themselves the roadmap. It is explored from the scan
configuration outwards, nearest first (Dijkstra's algorithm), and a straight motion
between near neighbours is verified only when the search wants to walk it, as in lazy
roadmaps (Bohlin and Kavraki, "Path planning using lazy PRM", 2000). A frame that has
been reached needs none of its other IK branches, so about one motion per reached frame
is verified, and the route to each is the shortest over verified motions.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.planning.motion import MotionChecker

NEIGHBOURS = 8
START_NEIGHBOURS = 64
LONGEST_JOIN_RAD = 2.2
START = 0


class UnionFind:
    """Disjoint sets of ``0 … n − 1``."""

    def __init__(self, size: int) -> None:
        self._parent = list(range(size))

    def find(self, item: int) -> int:
        """Representative of the set of an item."""
        parent = self._parent
        while parent[item] != item:
            parent[item] = parent[parent[item]]
            item = parent[item]
        return item

    def join(self, a: int, b: int) -> bool:
        """Make one set of two; False if they were one already."""
        a, b = self.find(a), self.find(b)
        self._parent[max(a, b)] = min(a, b)
        return a != b


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CandidateMotions:
    """Motions between near neighbours, not checked yet, as a symmetric graph.

    Attributes
    ----------
    begin : int array, shape (nodes + 1,)
        Row k of the neighbours is ``begin[k]:begin[k + 1]``.
    node : int array
        Neighbours, row after row.
    length_rad : array
        Joint-space distance to them.
    """

    begin: IntArray
    node: IntArray
    length_rad: FloatArray

    @classmethod
    def of(
        cls, Q: FloatArray, weight: FloatArray, neighbours: int = NEIGHBOURS
    ) -> CandidateMotions:
        """Join each configuration to its neighbours, row 0 (the start) to more.

        Parameters
        ----------
        Q : array, shape (nodes, dof)
        weight : array, shape (dof,)
            How far each joint moves the tool [m/rad]; near means near for the tool.
        """
        weighted = Q * weight
        tree = cKDTree(weighted)
        count = min(neighbours + 1, len(Q))
        _, near = tree.query(weighted, k=count, workers=-1)
        a = np.repeat(np.arange(len(Q)), count)
        b = np.asarray(near, np.int64).ravel()
        _, around = tree.query(weighted[START], k=min(START_NEIGHBOURS, len(Q)))
        a = np.concatenate([a, np.full(np.size(around), START)])
        b = np.concatenate([b, np.atleast_1d(around)])
        usable = (a != b) & (np.abs(Q[a] - Q[b]).max(axis=1) <= LONGEST_JOIN_RAD)
        a, b = a[usable], b[usable]
        # Both directions of each motion, once: a pair as one number sorts fast.
        key = np.unique(np.concatenate([a * len(Q) + b, b * len(Q) + a]))
        rows, node = np.divmod(key, len(Q))
        return cls(
            begin=np.searchsorted(rows, np.arange(len(Q) + 1)),
            node=node,
            length_rad=np.linalg.norm(Q[rows] - Q[node], axis=1),
        )

    def pairs_among(self, chosen: BoolArray) -> Iterator[tuple[int, int]]:
        """Motions with both ends among chosen nodes, shortest first."""
        rows = np.repeat(np.arange(len(self.begin) - 1), np.diff(self.begin))
        inside = (rows < self.node) & chosen[rows] & chosen[self.node]
        index = np.flatnonzero(inside)
        order = index[np.argsort(self.length_rad[index], kind="stable")]
        for k in order:
            yield int(rows[k]), int(self.node[k])


@dataclass(slots=True, kw_only=True, eq=False)
class Roadmap:
    """Configurations joined by verified motions; grows as paths are found.

    Attributes
    ----------
    configurations : list of array, shape (dof,)
        Node 0 is the scan configuration, nodes 1 … ``len(frame)`` are goals, later
        ones way-points of planned paths.
    frame : int array, shape (goals,)
        Test frame of each goal.
    edges : list of (int, int)
        Verified straight motions.
    reached : bool array, shape (goals + 1,)
        Nodes connected to the scan configuration.
    """

    configurations: list[FloatArray]
    frame: IntArray
    reached: BoolArray
    edges: list[tuple[int, int]] = field(default_factory=list)

    @classmethod
    def of(cls, start: FloatArray, goals: FloatArray, frame: IntArray) -> Roadmap:
        """Roadmap without edges: a start (dof,) and goals (n, dof) of frames (n,)."""
        reached = np.zeros(len(goals) + 1, bool)
        reached[START] = True
        return cls(
            configurations=[start, *goals],
            frame=np.asarray(frame, np.int64),
            reached=reached,
        )

    @property
    def goal_array(self) -> FloatArray:
        """Start and goals, shape (goals + 1, dof)."""
        return np.array(self.configurations[: len(self.frame) + 1])

    def frames_reached(self) -> IntArray:
        """Frames with at least one goal that is connected, sorted."""
        return np.unique(self.frame[self.reached[1:]])

    def open_goals(self) -> BoolArray:
        """Nodes whose frame has no connected goal, shape (goals + 1,)."""
        done = np.zeros(int(self.frame.max(initial=-1)) + 1, bool)
        done[self.frame[self.reached[1:]]] = True
        return np.concatenate([[False], ~done[self.frame]])

    def add_path(self, path: FloatArray, first: int, last: int) -> None:
        """Record a verified path between two nodes, way-points included."""
        previous = first
        for q in path[1:-1]:
            self.configurations.append(np.array(q))
            self.edges.append((previous, len(self.configurations) - 1))
            previous = len(self.configurations) - 1
        self.edges.append((previous, last))

    def shortest_paths(self) -> ShortestPaths:
        """Lengths and routes from the start through the verified motions."""
        Q = np.array(self.configurations)
        ends = np.array(self.edges, np.int64).reshape(-1, 2)
        weights = np.linalg.norm(Q[ends[:, 0]] - Q[ends[:, 1]], axis=1)
        graph = coo_matrix(
            # csgraph takes explicit zeros for missing edges.
            (np.maximum(weights, 1e-12), (ends[:, 0], ends[:, 1])),
            shape=(len(Q), len(Q)),
        ).tocsr()
        length, before = dijkstra(
            graph, directed=False, indices=START, return_predecessors=True
        )
        return ShortestPaths(
            configurations=Q, length_rad=length, before=np.asarray(before, np.int64)
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShortestPaths:
    """Routes from the scan configuration.

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

    def path_to(self, node: int) -> FloatArray:
        """Configurations from the scan configuration to a node, shape (n, dof)."""
        nodes = [node]
        while nodes[-1] != START:
            nodes.append(int(self.before[nodes[-1]]))
        return self.configurations[nodes[::-1]]


class Explorer:
    """Reaches frames over verified motions, nearest to the start first.

    Parameters
    ----------
    roadmap : Roadmap
        ``edges`` and ``reached`` are filled in.
    candidates : CandidateMotions
        Of the roadmap's start and goals.
    motions : MotionChecker
    on_frame : callable
        Called for each frame that is reached, to report progress.
    """

    def __init__(
        self,
        roadmap: Roadmap,
        candidates: CandidateMotions,
        motions: MotionChecker,
        on_frame: Callable[[], object] = lambda: None,
    ) -> None:
        self._roadmap, self._motions = roadmap, motions
        self._on_frame = on_frame
        self._Q = roadmap.goal_array
        self._distance = np.full(len(self._Q), np.inf)
        self._frame_done = np.zeros(int(roadmap.frame.max(initial=-1)) + 1, bool)
        self._begin = candidates.begin.tolist()
        self._near = candidates.node.tolist()
        self._length = candidates.length_rad.tolist()

    def explore(self, node: int, before: int, length_rad: float) -> IntArray:
        """Go on from a node that is connected to an earlier one by some path.

        Parameters
        ----------
        node, before : int
            Both :data:`START` to begin with.
        length_rad : float
            Of the path between them.

        Returns
        -------
        int array
            Nodes reached, the first one included.
        """
        start = 0.0 if node == before else self._distance[before] + length_rad
        self._reach(node, start)
        group = [node]
        pending = self._motions_from(node)
        roadmap = self._roadmap
        while pending:
            distance, node, before = heapq.heappop(pending)
            if roadmap.reached[node] or self._frame_done[roadmap.frame[node - 1]]:
                continue
            if not self._motions.is_verified(self._Q[before], self._Q[node]):
                continue
            roadmap.edges.append((before, node))
            self._reach(node, distance)
            group.append(node)
            for motion in self._motions_from(node):
                heapq.heappush(pending, motion)
        return np.array(group, np.int64)

    def _reach(self, node: int, distance: float) -> None:
        self._roadmap.reached[node] = True
        self._distance[node] = distance
        if node != START:
            self._frame_done[self._roadmap.frame[node - 1]] = True
            self._on_frame()

    def _motions_from(self, node: int) -> list[tuple[float, int, int]]:
        here = float(self._distance[node])
        reached = self._roadmap.reached
        row = range(self._begin[node], self._begin[node + 1])
        motions = [
            (here + self._length[k], self._near[k], node)
            for k in row
            if not reached[self._near[k]]
        ]
        motions.sort()
        return motions


def components_of_open_goals(
    roadmap: Roadmap, candidates: CandidateMotions, motions: MotionChecker
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
        if motions.is_verified(Q[a], Q[b]):
            sets.join(a, b)
            roadmap.edges.append((a, b))
    members: dict[int, list[int]] = {}
    for node in np.flatnonzero(chosen).tolist():
        members.setdefault(sets.find(node), []).append(node)
    groups = sorted(members.values(), key=lambda nodes: (-len(nodes), nodes[0]))
    return [np.array(nodes, np.int64) for nodes in groups]
