"""Checks of a few pairs of bodies, for many configurations at once.

What has changed between two cells is mostly one body; whether it touches is asked of
its pairs alone, in one call of the engine, with the answers of a check of all pairs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.collision.bodies import disable_cached_guesses


class PairChecker:
    """Checks of some pairs of a geometry.

    Parameters
    ----------
    model : pinocchio.Model
    geometry : pinocchio.GeometryModel
        Copied as it is now.
    pairs : int array, shape (k,)
        Those that are checked.
    margins : array, shape (k,)
        Closer than this they count as touching [m].
    """

    def __init__(
        self,
        model: Any,
        geometry: Any,
        pairs: IntArray,
        margins: FloatArray,
    ) -> None:
        chosen = [geometry.collisionPairs[int(k)] for k in pairs]
        bodies = sorted({body for pair in chosen for body in (pair.first, pair.second)})
        part = pin.GeometryModel()
        for body in bodies:
            part.addGeometryObject(geometry.geometryObjects[body].copy())
        for pair in chosen:
            first, second = bodies.index(pair.first), bodies.index(pair.second)
            part.addCollisionPair(pin.CollisionPair(first, second))
        self._pool = pin.GeometryPool(model, part, 1)
        requests = self._pool.getGeometryData(0).collisionRequests
        for request, margin in zip(requests, margins, strict=True):
            request.security_margin = float(margin)
        disable_cached_guesses(requests)

    def touched(self, Q: FloatArray) -> BoolArray:
        """Whether any of the pairs touches, shape (n, joints) to (n,)."""
        columns = np.asfortranarray(Q.T)
        found = pin.computeCollisionsInParallel(1, self._pool, columns, True, False)
        return np.asarray(found, bool)
