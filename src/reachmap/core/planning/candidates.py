"""Near neighbours among configurations, and motions between them, not checked yet."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.cell.model.planner import RoadmapSpec
from reachmap.core.kinematics.windings import TURN_RAD, Windings

# Below it, starting the threads costs more than the queries.
_WORTH_THREADS = 1000


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


class NearestNeighbours:
    """Configurations by how little the arm has to move, whole turns not counted.

    Parameters
    ----------
    Q : array, shape (n, dof)
    weight : array, shape (dof,)
        How far each joint moves the tool [m/rad]; near means near for the tool.
    windings : Windings
    """

    def __init__(self, Q: FloatArray, weight: FloatArray, windings: Windings) -> None:
        self._weight, self._windings = weight, windings
        box = windings.period_rad * weight if windings.exist else None
        self._tree = cKDTree(self._weighted(Q), boxsize=box)

    def _weighted(self, Q: FloatArray) -> FloatArray:
        if self._windings.exist:
            # The remainder of a tiny negative angle is rounded up to the turn itself.
            inside = np.remainder(Q, TURN_RAD) % TURN_RAD
            Q = np.where(self._windings.turns, inside, Q)
        return Q * self._weight

    def of(self, Q: FloatArray, count: int) -> tuple[FloatArray, IntArray]:
        """Distances and rows of the nearest configurations, shape (m, count)."""
        count = min(count, self._tree.n)
        distance, row = self._tree.query(
            self._weighted(Q),
            k=[*range(1, count + 1)],
            workers=-1 if len(Q) > _WORTH_THREADS else 1,
        )
        return np.asarray(distance, float), np.asarray(row, np.int64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CandidateMotions:
    """Motions between near neighbours, not checked yet, as a symmetric graph.

    Attributes
    ----------
    begin : int array, shape (nodes + 1,)
        Row k of the neighbours is ``begin[k]:begin[k + 1]``.
    node : int array, shape (motions,)
        Neighbours, row after row.
    length_rad : array, shape (motions,)
        Joint-space distance to them.
    turns : int array, shape (motions, dof), or None
        Whole turns to add to the neighbour for the shortest motion; None where no
        motion needs any.
    """

    begin: IntArray
    node: IntArray
    length_rad: FloatArray
    turns: IntArray | None

    @classmethod
    def of(
        cls,
        Q: FloatArray,
        weight: FloatArray,
        windings: Windings,
        spec: RoadmapSpec,
    ) -> CandidateMotions:
        """Join each configuration to its neighbours, row 0 (the start) to more.

        Parameters
        ----------
        Q : array, shape (nodes, dof)
        weight : array, shape (dof,)
            See :class:`NearestNeighbours`.
        windings : Windings
        spec : RoadmapSpec
        """
        neighbours = NearestNeighbours(Q, weight, windings)
        _, near = neighbours.of(Q, spec.neighbours + 1)
        _, around = neighbours.of(Q[:1], spec.start_neighbours)
        a = np.concatenate([np.repeat(np.arange(len(Q)), near.shape[1]), 0 * around[0]])
        b = np.concatenate([near.ravel(), around[0]])
        change, _ = windings.shortest(Q[b] - Q[a])
        usable = (a != b) & (np.abs(change).max(axis=1) <= spec.longest_motion_rad)
        a, b = a[usable], b[usable]
        # Both directions of each motion, once: a pair as one number sorts fast.
        key = np.unique(np.concatenate([a * len(Q) + b, b * len(Q) + a]))
        rows, node = np.divmod(key, len(Q))
        change, turns = windings.shortest(Q[node] - Q[rows])
        return cls(
            begin=np.searchsorted(rows, np.arange(len(Q) + 1)),
            node=node,
            length_rad=np.linalg.norm(change, axis=1),
            turns=turns if turns.any() else None,
        )

    def pairs_among(self, chosen: BoolArray) -> Iterator[tuple[int, int]]:
        """Motions with both ends among chosen nodes, shortest first."""
        rows = np.repeat(np.arange(len(self.begin) - 1), np.diff(self.begin))
        inside = (rows < self.node) & chosen[rows] & chosen[self.node]
        index = np.flatnonzero(inside)
        order = index[np.argsort(self.length_rad[index], kind="stable")]
        for k in order:
            yield int(rows[k]), int(self.node[k])
