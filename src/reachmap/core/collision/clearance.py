"""Clearance of a path: the smallest distance between two bodies, and which two."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.collision.bodies import disable_cached_guesses
from reachmap.core.collision.checker import CollisionChecker
from reachmap.core.trace import Trace
from reachmap.geometry import pieces

if TYPE_CHECKING:
    from reachmap.core.scene import Scene

TOLERANCE_M, TOLERANCE_SHARE = 1e-3, 0.1
"""By how much, or by what share of itself if that is more, a clearance may be greater
than the least there is anywhere on the path. Half as much takes twice the time."""

# Short enough for the bound from where the robot is to be near to the truth.
PIECE_RAD = 0.2


def certain_clearance_m(clearance_m: FloatArray) -> FloatArray:
    """Guaranteed lower bound of a path's clearance, from the measured one [m]."""
    allowed = np.maximum(TOLERANCE_M, TOLERANCE_SHARE * clearance_m)
    return np.asarray(clearance_m - allowed)


class ClearanceMeter:
    """Measures the distances of the bodies that a checker checks.

    A distance is that of the convex hulls, and that of the bodies themselves where it
    may be the least by more than the tolerance: hulls are never further apart.

    Parameters
    ----------
    checker : CollisionChecker
    """

    def __init__(self, checker: CollisionChecker) -> None:
        self._checker = checker
        self._model = checker.robot.body_model
        self._data = self._model.createData()
        self._bodies, self._hulls = checker.bodies, checker.hulls
        self._bodies_data = self._bodies.createData()
        self._hulls_data = self._hulls.createData()
        for data in (self._bodies_data, self._hulls_data):
            disable_cached_guesses(data.distanceRequests)
        pairs = self._bodies.collisionPairs
        self._has_mesh = np.array([self._differs(pair) for pair in pairs], bool)
        self._first = np.array([pair.first for pair in pairs], np.int64)
        self._second = np.array([pair.second for pair in pairs], np.int64)

    def of_path(
        self, path: FloatArray, among: BoolArray | None = None
    ) -> tuple[float, int]:
        """Least distance of two bodies on a path.

        The path is halved until what lies between two configurations cannot be
        closer, by the bound on how far a motion moves the bodies of each pair, so
        that no place is narrower by more than the tolerance.

        Parameters
        ----------
        path : array, shape (n, dof)
            Straight motions between its points [rad].
        among : bool array, shape (pairs,), optional
            Pairs of the checker's geometry to look at; default: all.

        Returns
        -------
        clearance_m : float
            NaN where there are no pairs.
        pair : int
            Index into the checker's ``body_pairs``, -1 where there are none.
        """
        found = self._of_path(path, among)
        if Trace.current is not None:
            Trace.current.note_other(_of_path_in, found, path.copy(), among)
        return found

    def _of_path(self, path: FloatArray, among: BoolArray | None) -> tuple[float, int]:
        count = len(self._bodies.collisionPairs)
        pairs = np.arange(count) if among is None else np.flatnonzero(among)
        if len(pairs) == 0:
            return float("nan"), -1
        self._least, self._pair = np.inf, -1
        Q, travel = self._pieces(path)
        # The last waypoint, at the grasp, is the narrowest as a rule. Pairs that are
        # not looked at are as far apart as can be.
        d_last = self._distances(Q[-1], pairs, np.full(count, np.inf))
        known = d_last - travel[-1]
        d_first = self._distances(Q[0], self._near(known), known)
        place, d = np.array([0.0, len(Q) - 1.0]), np.stack([d_first, d_last])
        while len(Q) > 1:
            place, d_refined = self._halve(Q, travel, place, d)
            if len(d_refined) == len(d):
                break
            d = d_refined
        return float(self._least), int(self._checker.pair_index[self._pair])

    def _pieces(self, path: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Short pieces of a path, and how far each pair has moved by their ends.

        Returns
        -------
        Q : array, shape (ends, dof)
        travel_m : array, shape (ends, pairs)
            Bound on the relative motion of the bodies, from the first end.
        """
        Q = pieces(path, PIECE_RAD)
        half = 0.5 * np.diff(Q, axis=0)
        each = self._checker.bound.of_bodies_m(Q[:-1] + half, half)
        both = each[:, self._first] + each[:, self._second]
        moved = 2.0 * np.minimum(both, np.abs(half) @ self._checker.pair_reach_m.T)
        start = np.zeros((1, moved.shape[1]))
        return Q, np.concatenate([start, np.cumsum(moved, axis=0)])

    def _halve(
        self, Q: FloatArray, travel: FloatArray, place: FloatArray, d: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Measure at the middle of each piece that may be narrower somewhere.

        ``place`` counts pieces, the rows of ``d`` are distances there or bounds; both
        come back with rows in between.
        """
        moved = np.diff(_at(travel, place), axis=0)
        # A pair that moves by r on the way is nowhere nearer than this.
        least = 0.5 * (d[:-1] + d[1:] - moved)
        nearest = least.min(axis=1)
        wide = np.flatnonzero(nearest < self._allowed())
        middle = 0.5 * (place[wide] + place[wide + 1])
        q_middle = _at(Q, middle)
        gone = _at(travel, middle) - _at(travel, place[wide])
        d_middle = np.maximum(d[wide] - gone, d[wide + 1] - (moved[wide] - gone))
        for k in np.argsort(nearest[wide], kind="stable").tolist():
            near = self._near(least[wide[k]])
            if len(near):
                d_middle[k] = self._distances(q_middle[k], near, d_middle[k])
        return np.insert(place, wide + 1, middle), np.insert(d, wide + 1, d_middle, 0)

    def _allowed(self) -> float:
        """What is not narrower than this need not be looked at."""
        if np.isinf(self._least):
            return np.inf
        return float(self._least - max(TOLERANCE_M, TOLERANCE_SHARE * self._least))

    def _near(self, least: FloatArray) -> IntArray:
        """Pairs that may be narrower than all so far, by more than is allowed."""
        return np.flatnonzero(least < self._allowed())

    def _distances(
        self, q: FloatArray, pairs: IntArray, known: FloatArray
    ) -> FloatArray:
        """Distances of some pairs at q [m], lower bounds of the others."""
        q_bodies = self._checker.robot.body_configuration(q)
        pin.updateGeometryPlacements(
            self._model, self._data, self._hulls, self._hulls_data, q_bodies
        )
        distance = known.copy()
        for k in pairs.tolist():
            distance[k] = self._measure(self._hulls, self._hulls_data, k)
        is_placed = False
        for k in pairs[np.argsort(distance[pairs], kind="stable")].tolist():
            if distance[k] >= self._least:
                break
            if self._has_mesh[k]:
                # The true bodies take a hundred times as long.
                if distance[k] >= self._allowed():
                    continue
                if not is_placed:
                    pin.updateGeometryPlacements(
                        self._model,
                        self._data,
                        self._bodies,
                        self._bodies_data,
                        q_bodies,
                    )
                    is_placed = True
                exact = self._measure(self._bodies, self._bodies_data, k)
                distance[k] = max(distance[k], exact)
            if distance[k] < self._least:
                self._least, self._pair = distance[k], k
        return distance

    def _measure(self, geometry: Any, data: Any, pair: int) -> float:
        # The last bits depend on what else the process has done: a map may not.
        return round(float(pin.computeDistance(geometry, data, pair).min_distance), 12)

    def _differs(self, pair: Any) -> bool:
        """Whether a body of the pair is more than its hull."""
        return any(
            type(self._bodies.geometryObjects[body].geometry)
            is not type(self._hulls.geometryObjects[body].geometry)
            for body in (pair.first, pair.second)
        )


def _of_path_in(scene: Scene) -> Callable[..., Any]:
    return ClearanceMeter(scene.checker).of_path


def _at(values: FloatArray, place: FloatArray) -> FloatArray:
    """Rows of values (n, k) between which a place lies, interpolated."""
    row = np.minimum(place.astype(np.int64), len(values) - 2)
    share = (place - row)[:, None]
    return np.asarray(values[row] + share * (values[row + 1] - values[row]))
