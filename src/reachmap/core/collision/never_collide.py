"""Pairs of bodies that can never collide, proved by subdivision.

Whether two bodies touch depends only on the joints between them. Where these are one
or two, the whole range of motion is covered with boxes: at the middle of a box the
bodies are further apart than any motion inside the box can take them, or the box is
split. What MoveIt's setup assistant concludes from samples ("never in collision") is
here a proof, and such pairs need no check at run time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray, IntArray
from reachmap.core.collision.displacement import displacement_bounds

if TYPE_CHECKING:
    from reachmap.core.collision.bodies import BodyGeometry
    from reachmap.core.robot.model import RobotModel

# Boxes over three joints are too many to finish: neighbours and their neighbours it is.
MAX_JOINTS = 2
# A bound on the work for one pair; what takes more stays checked.
MAX_BOXES = 3000


def pairs_that_never_collide(
    robot: RobotModel,
    hulls: Any,
    motion: PairMotion,
    margin_m: float,
    *,
    left_out: frozenset[int] = frozenset(),
) -> tuple[tuple[int, int], ...]:
    """Find the collision pairs that are proved to stay apart.

    Parameters
    ----------
    robot : RobotModel
    hulls : pinocchio.GeometryModel
        Convex bodies that contain the true ones; distances between surfaces of many
        triangles would take too long.
    motion : PairMotion
        Of the true bodies.
    margin_m : float
        The pair stays further apart than this.
    left_out : frozenset of int
        Geometry indices of bodies that nothing is proved about.

    Returns
    -------
    tuple of (int, int)
        Geometry indices.
    """
    prover = _Prover(robot, hulls, motion, margin_m)
    return tuple(
        (pair.first, pair.second)
        for index, pair in enumerate(hulls.collisionPairs)
        if not left_out & {pair.first, pair.second} and prover.never_collide(index)
    )


class PairMotion:
    """How far the joints of the arm move two bodies relative to each other.

    Parameters
    ----------
    robot : RobotModel
    bodies : BodyGeometry

    Attributes
    ----------
    bounds : array, shape (bodies, dof)
        No point of a body moves further than ``bounds @ |Δq|`` in the root frame; see
        :func:`reachmap.core.collision.displacement.displacement_bounds`.
    """

    def __init__(self, robot: RobotModel, bodies: BodyGeometry) -> None:
        # One row for each joint of the body model: the arm's own, then followers.
        self._shares = np.abs(np.vstack([np.eye(robot.dof), robot.following]))
        model = robot.body_model
        self._each = displacement_bounds(model, bodies)
        self.bounds = self._each @ self._shares
        self._supports = [
            {joint - 1 for joint in model.supports[body.parentJoint] if joint}
            for body in bodies.geometry.geometryObjects
        ]

    def between(self, pair: Any) -> tuple[IntArray, FloatArray]:
        """Joints of the arm that move one body of a pair relative to the other.

        Returns
        -------
        joints : int array
            0-based.
        reach : array, shape (dof,)
            Bound of the relative displacement [m/rad or m/m].
        """
        first, second = self._supports[pair.first], self._supports[pair.second]
        each = np.zeros(len(self._shares))
        for body, joints in (
            (pair.first, first - second),
            (pair.second, second - first),
        ):
            each[list(joints)] = self._each[body, list(joints)]
        moving = self._shares[sorted(first ^ second)].any(axis=0)
        return np.flatnonzero(moving), each @ self._shares


class _Prover:
    def __init__(
        self, robot: RobotModel, geometry: Any, motion: PairMotion, margin_m: float
    ) -> None:
        self.robot, self.model, self.geometry = robot, robot.body_model, geometry
        self.motion, self.margin_m = motion, margin_m
        self.data, self.geometry_data = self.model.createData(), geometry.createData()

    def never_collide(self, index: int) -> bool:
        joints, bound = self.motion.between(self.geometry.collisionPairs[index])
        if not 0 < len(joints) <= MAX_JOINTS:
            return False
        which = joints.tolist()
        reach = bound[which]
        boxes = [(self.robot.lower_rad[which], self.robot.upper_rad[which])]
        q = np.zeros(self.robot.dof)
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
            self.model,
            self.data,
            self.geometry,
            self.geometry_data,
            self.robot.body_configuration(q),
        )
        return not pin.computeCollision(self.geometry, self.geometry_data, index)
