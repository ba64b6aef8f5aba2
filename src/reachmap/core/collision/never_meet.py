"""Pairs of bodies that can never meet, proved by subdivision.

Whether two bodies touch depends only on the joints between them. Where these are one
or two, the whole range of motion is covered with boxes: at the middle of a box the
bodies are further apart than any motion inside the box can take them, or the box is
split. What MoveIt's setup assistant concludes from samples ("never in collision") is
here a proof, and such pairs need no check at run time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray

MAX_JOINTS = 2
MAX_BOXES = 3000


def pairs_that_never_meet(
    model: Any,
    hulls: Any,
    bounds: FloatArray,
    margin_m: float,
    *,
    left_out: frozenset[int] = frozenset(),
) -> tuple[tuple[int, int], ...]:
    """Find the collision pairs that are proved to stay apart.

    Parameters
    ----------
    model : pinocchio.Model
    hulls : pinocchio.GeometryModel
        Convex bodies that contain the true ones; distances between surfaces of many
        triangles would take too long.
    bounds : array, shape (bodies, dof)
        See :func:`reachmap.core.collision.displacement.displacement_bounds`.
    margin_m : float
        The pair stays further apart than this.
    left_out : frozenset of int
        Geometry indices of bodies that nothing is proved about.

    Returns
    -------
    tuple of (int, int)
        Geometry indices.
    """
    prover = _Prover(model, hulls, bounds, margin_m)
    return tuple(
        (pair.first, pair.second)
        for index, pair in enumerate(hulls.collisionPairs)
        if not left_out & {pair.first, pair.second} and prover.never_meets(index)
    )


def joints_between(geometry: Any, pair: Any) -> tuple[range, int]:
    """Joints (0-based) that move one body of a pair against the other.

    Returns
    -------
    joints : range
    outer : int
        Index of the body further out along the chain.
    """
    first = geometry.geometryObjects[pair.first].parentJoint
    second = geometry.geometryObjects[pair.second].parentJoint
    outer = pair.first if first > second else pair.second
    return range(min(first, second), max(first, second)), int(outer)


class _Prover:
    def __init__(
        self, model: Any, geometry: Any, bounds: FloatArray, margin_m: float
    ) -> None:
        self.model, self.geometry = model, geometry
        self.bounds, self.margin_m = bounds, margin_m
        self.data, self.geometry_data = model.createData(), geometry.createData()

    def never_meets(self, index: int) -> bool:
        joints, outer = joints_between(
            self.geometry, self.geometry.collisionPairs[index]
        )
        if not 0 < len(joints) <= MAX_JOINTS:
            return False
        which = list(joints)
        reach = self.bounds[outer, which]
        boxes = [
            (self.model.lowerPositionLimit[which], self.model.upperPositionLimit[which])
        ]
        q = pin.neutral(self.model)
        for _ in range(MAX_BOXES):
            if not boxes:
                return True
            low, high = boxes.pop()
            middle, half = (low + high) / 2, (high - low) / 2
            q[which] = middle
            if self._apart(index, q, self.margin_m + float(half @ reach)):
                continue
            if not self._apart(index, q, self.margin_m):
                return False
            axis = int(np.argmax(half * reach))
            cut_high, cut_low = high.copy(), low.copy()
            cut_high[axis] = cut_low[axis] = middle[axis]
            boxes += [(low, cut_high), (cut_low, high)]
        return False

    def _apart(self, index: int, q: FloatArray, distance_m: float) -> bool:
        self.geometry_data.collisionRequests[index].security_margin = distance_m
        pin.updateGeometryPlacements(
            self.model, self.data, self.geometry, self.geometry_data, q
        )
        return not pin.computeCollision(self.geometry, self.geometry_data, index)
