"""How close bodies come on a path: the least distance, and between which two."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.collision.checker import CollisionChecker, guess_nothing

TOLERANCE_M, TOLERANCE_SHARE = 1e-3, 0.1
"""By how much, or by what share of itself if that is more, a clearance may be greater
than the least there is anywhere on the path. Half as much takes twice the time."""


def certain_clearance_m(clearance_m: FloatArray) -> FloatArray:
    """What a clearance that was measured on a path is not below anywhere on it [m]."""
    allowed = np.maximum(TOLERANCE_M, TOLERANCE_SHARE * clearance_m)
    return np.asarray(clearance_m - allowed)


class ClearanceMeter:
    """Measures the distances of the bodies that a checker checks.

    A distance is that of the convex hulls where it is not the least so far, and that of
    the bodies themselves where it might be: hulls are never further apart.

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
            guess_nothing(data.distanceRequests)
        pairs = self._bodies.collisionPairs
        self._has_mesh = np.array([self._differs(pair) for pair in pairs], bool)

    def of_path(
        self, path: FloatArray, among: BoolArray | None = None
    ) -> tuple[float, int]:
        """Least distance of two bodies on a path.

        The path is halved until what lies between two configurations cannot be
        closer, by the bound on how far a motion moves each pair against each other, so
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
        count = len(self._bodies.collisionPairs)
        pairs = np.arange(count) if among is None else np.flatnonzero(among)
        if len(pairs) == 0:
            return float("nan"), -1
        self._least, self._pair = np.inf, -1
        # The last way-point, at the grasp, is the narrowest as a rule. Pairs that are
        # not looked at are as far apart as can be.
        d = self._distances(path[-1], pairs, np.full(count, np.inf))
        for k in range(len(path) - 1, 0, -1):
            known = d - self._moved(path[k - 1], path[k])
            d_before = self._distances(path[k - 1], self._near(known), known)
            self._halve(path[k - 1], path[k], d_before, d)
            d = d_before
        return float(self._least), int(self._checker.pair_index[self._pair])

    def _halve(
        self, q_from: FloatArray, q_to: FloatArray, d_from: FloatArray, d_to: FloatArray
    ) -> None:
        """Look at the middle of a motion, unless it cannot be narrower anywhere."""
        waiting = [(q_from, q_to, d_from, d_to)]
        while waiting:
            a, b, d_a, d_b = waiting.pop()
            # A pair that moves by r on the way is nowhere nearer than this.
            least = 0.5 * (d_a + d_b - self._moved(a, b))
            near = self._near(least)
            if not len(near):
                continue
            middle = 0.5 * (a + b)
            d_middle = self._distances(middle, near, least)
            waiting += [(a, middle, d_a, d_middle), (middle, b, d_middle, d_b)]

    def _moved(self, q_from: FloatArray, q_to: FloatArray) -> FloatArray:
        """Bound on how far a motion moves each pair [m]."""
        return np.asarray(self._checker.pair_reach_m @ np.abs(q_to - q_from))

    def _near(self, least: FloatArray) -> IntArray:
        """Pairs that may be narrower than all so far, by more than is allowed."""
        allowed = max(TOLERANCE_M, TOLERANCE_SHARE * self._least)
        return np.flatnonzero(least < self._least - allowed)

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
        closest = pairs[self._has_mesh[pairs] & (distance[pairs] < self._least)]
        if len(closest):
            pin.updateGeometryPlacements(
                self._model, self._data, self._bodies, self._bodies_data, q_bodies
            )
        order = pairs[np.argsort(distance[pairs], kind="stable")].tolist()
        for k in order:
            if distance[k] >= self._least:
                break
            if self._has_mesh[k]:
                exact = self._measure(self._bodies, self._bodies_data, k)
                distance[k] = max(distance[k], exact)
            if distance[k] < self._least:
                self._least, self._pair = distance[k], k
        return distance

    def _measure(self, geometry: Any, data: Any, pair: int) -> float:
        return float(pin.computeDistance(geometry, data, pair).min_distance)

    def _differs(self, pair: Any) -> bool:
        """Whether a body of the pair is more than its hull."""
        return any(
            type(self._bodies.geometryObjects[body].geometry)
            is not type(self._hulls.geometryObjects[body].geometry)
            for body in (pair.first, pair.second)
        )
