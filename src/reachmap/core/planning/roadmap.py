"""A roadmap of free configurations, and paths from the scan configuration.

The goals of all test frames are themselves the roadmap. It is explored from the scan
configuration outwards, nearest first (Dijkstra's algorithm), and a straight motion
between near neighbours is verified only when the search wants to walk it, as in lazy
roadmaps (Bohlin and Kavraki, "Path planning using lazy PRM", 2000). A frame that has
been reached needs none of its other IK branches, so about one motion per reached frame
is verified, and the route to each is the shortest over verified motions.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.kinematics.windings import TURN_RAD, Windings

START = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Goals:
    """Goals of a roadmap: any one goal of each frame has to be reached.

    Attributes
    ----------
    Q : array, shape (goals, dof)
        Free configurations.
    frame : int array, shape (goals,)
        Test frame of each.
    low, high : array, shape (goals, dof)
        Smallest and largest position of each joint on the way on from the goal: what
        has to stay within the limits when the goal is turned.
    """

    Q: FloatArray
    frame: IntArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, Q: FloatArray, frame: IntArray) -> Goals:
        """Goals from which nothing leads on."""
        return cls(Q=Q, frame=np.asarray(frame, np.int64), low=Q, high=Q)

    def turned(self, turns: IntArray) -> Goals:
        """The same goals at other turns of their joints, shape (goals, dof)."""
        turn_rad = TURN_RAD * turns.astype(float)
        return Goals(
            Q=self.Q + turn_rad,
            frame=self.frame,
            low=self.low + turn_rad,
            high=self.high + turn_rad,
        )


@dataclass(slots=True, kw_only=True, eq=False)
class Roadmap:
    """Configurations joined by verified motions; grows as paths are found.

    Attributes
    ----------
    goals : Goals
        At the turns of their joints that are nearest to the scan configuration.
    configurations : list of array, shape (dof,)
        Node 0 is the scan configuration, nodes 1 … ``goals`` are the goals, later
        ones waypoints of planned paths, or goals at other turns of their joints.
    edges : list of (int, int)
        Verified straight motions.
    reached : list of int
        Nodes connected to the scan configuration, itself included.
    frame_reached : bool array, shape (frames,)
    """

    goals: Goals
    configurations: list[FloatArray]
    frame_reached: BoolArray
    edges: list[tuple[int, int]] = field(default_factory=list)
    reached: list[int] = field(default_factory=lambda: [START])
    _turned: dict[int, int] = field(default_factory=dict)

    @classmethod
    def of(cls, start: FloatArray, goals: Goals) -> Roadmap:
        """Roadmap without edges of a start (dof,) and goals."""
        return cls(
            goals=goals,
            configurations=[start, *goals.Q],
            frame_reached=np.zeros(int(goals.frame.max(initial=-1)) + 1, bool),
        )

    def allows(self, goal_node: int, turns: IntArray, windings: Windings) -> bool:
        """Whether a goal and the way on from it stay within the limits when turned."""
        low, high = self.goals.low[goal_node - 1], self.goals.high[goal_node - 1]
        return windings.allows(low, high, turns)

    @property
    def goal_array(self) -> FloatArray:
        """Start and goals, shape (goals + 1, dof)."""
        return np.array(self.configurations[: len(self.goals.frame) + 1])

    def frames_reached(self) -> IntArray:
        """Frames with at least one goal that is connected, sorted."""
        return np.flatnonzero(self.frame_reached)

    def open_goals(self) -> BoolArray:
        """Nodes whose frame has no connected goal, shape (goals + 1,)."""
        return np.concatenate([[False], ~self.frame_reached[self.goals.frame]])

    def goal_of(self, node: int) -> int:
        """Row of the goal that a node is, at whatever turns; -1 if it is none."""
        if node <= len(self.goals.frame):
            return node - 1
        return self._turned.get(node, 0) - 1

    def add_turned(self, goal_node: int, q: FloatArray) -> int:
        """Add a goal at other turns of its joints; its node."""
        self.configurations.append(q)
        self._turned[len(self.configurations) - 1] = goal_node
        return len(self.configurations) - 1

    def add_path(self, path: FloatArray, first: int, last: int) -> range:
        """Record a verified path from a connected node; the nodes in between."""
        between = range(
            len(self.configurations), len(self.configurations) + len(path) - 2
        )
        self.configurations += [np.array(q) for q in path[1:-1]]
        self.reached += between
        nodes = [first, *between, last]
        self.edges += zip(nodes[:-1], nodes[1:], strict=True)
        return between

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

    def shortest_to_goals(self, paths: ShortestPaths) -> IntArray:
        """Node at which each goal is nearest by path, shape (goals,)."""
        node = np.arange(1, len(self.goals.frame) + 1)
        for turned, goal_node in self._turned.items():
            if paths.length_rad[turned] < paths.length_rad[node[goal_node - 1]]:
                node[goal_node - 1] = turned
        return node


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
