"""How far a point of the robot can move when the joints move.

A change Δq moves no point of body g further than ``Σ_j R[g, j] |Δq_j|``, where
``R[g, j]`` bounds the distance of the body's points from the axis of joint j over all
configurations (for a prismatic joint it is 1). The bound follows the chain outwards
in: a point within ρ of the origin of joint j+1 is within ``‖p‖ + ρ`` of the origin of
joint j; where the two axes are parallel, only distances across the axes add up.
Bodies count as boxes in the frames of their joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.shapes import Solid, box_corners, corner_points
from reachmap.core.collision.shapes import convex_hull
from reachmap.core.robot.chain import cross

if TYPE_CHECKING:
    from reachmap.core.collision.bodies import BodyGeometry
    from reachmap.core.robot.chain import SerialChain
    from reachmap.core.robot.model import RobotModel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Extents:
    """A box around each body, in the frame of its joint in the chain.

    Attributes
    ----------
    body : int array, shape (bodies,)
        Geometry objects that joints of the chain carry.
    joint : int array, shape (bodies,)
        From 0.
    low, high : array, shape (bodies, 3)
        Its corners [m].
    """

    body: IntArray
    joint: IntArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, chain: SerialChain, model: Any, bodies: BodyGeometry) -> Extents:
        """Extents of the bodies of a cell; ``model`` is that of the chain's joints."""
        frames = chain.joint_rotations(model)
        found = []
        objects = bodies.geometry.geometryObjects
        for k, (body, shape) in enumerate(zip(objects, bodies.shapes, strict=True)):
            joint = int(body.parentJoint) - 1
            if 0 <= joint < chain.dof:
                points = _corners(shape) @ body.placement.rotation.T
                points = (points + body.placement.translation) @ frames[joint]
                found.append((k, joint, points.min(axis=0), points.max(axis=0)))
        return cls(
            body=np.array([row[0] for row in found], np.int64),
            joint=np.array([row[1] for row in found], np.int64),
            low=np.array([row[2] for row in found]).reshape(-1, 3),
            high=np.array([row[3] for row in found]).reshape(-1, 3),
        )

    def boxes(self, T_base_joint: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Low and high corners (n, bodies, 3) at joint frames (n, dof, 4, 4)."""
        T = T_base_joint[:, self.joint]
        R, origin = T[..., :3, :3], T[..., :3, 3]
        centre, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        middle = (R @ centre[..., None])[..., 0] + origin
        room = (np.abs(R) @ half[..., None])[..., 0]
        return middle - room, middle + room

    def corners_by_joint(self, dof: int) -> FloatArray:
        """Corners of a box around all bodies of each joint, shape (dof, 3, 8)."""
        corners = np.zeros((dof, 3, 8))
        for k in np.unique(self.joint):
            low = self.low[self.joint == k].min(axis=0)
            high = self.high[self.joint == k].max(axis=0)
            corners[k] = ((low + high) / 2 + box_corners(high - low)).T
        return corners


def _corners(shape: Solid) -> FloatArray:
    """Corners of the convex body that checks with a wide margin are made with."""
    points = corner_points(shape)
    hull = convex_hull(points)
    return points if hull is None else np.array(hull.points())


def displacement_bounds(model: Any, bodies: BodyGeometry) -> FloatArray:
    """Bounds R of all bodies and joints, shape (bodies, dof), [m/rad] or [m/m].

    Parameters
    ----------
    model : pinocchio.Model
        Its joints are numbered along the tree, and have one degree of freedom each.
    bodies : BodyGeometry
    """
    axes = [_axis(model, joint) for joint in range(1, model.njoints)]
    bounds = np.zeros((bodies.geometry.ngeoms, model.nv))
    objects = bodies.geometry.geometryObjects
    for row, body, shape in zip(bounds, objects, bodies.shapes, strict=True):
        if body.parentJoint > 0:
            points = corner_points(shape) @ body.placement.rotation.T
            points += body.placement.translation
            _fill_row(row, model, axes, body.parentJoint, points)
    return bounds


class MotionBound:
    """Displacement along short straight motions, from the actual configuration.

    The bounds R hold for the stretched-out arm. For a motion q ± sΔ, 0 ≤ s ≤ 1, a
    point X moves no further than ``‖J_X(q) Δ‖ + ½ (Σ|Δ_i|)(Σ R_j |Δ_j|)``: Taylor, with
    the second term over revolute joints i. The first is largest at a corner of the
    hull of the bodies, since it is convex in X.

    Parameters
    ----------
    chain : SerialChain
    robot : RobotModel
    bodies : BodyGeometry
    bounds : array, shape (bodies, dof)
        R of all bodies, those on joints that follow others included.
    reach_m : array, shape (dof,)
        Largest R of each joint.
    """

    def __init__(
        self,
        chain: SerialChain,
        robot: RobotModel,
        bodies: BodyGeometry,
        bounds: FloatArray,
        reach_m: FloatArray,
    ) -> None:
        self._chain = chain
        self._bounds, self._reach_m = bounds, reach_m
        self._extents = Extents.of(chain, robot.model, bodies)
        self._corners = self._extents.corners_by_joint(chain.dof)
        self.on_chain = self._extents.body
        parents = [g.parentJoint for g in bodies.geometry.geometryObjects]
        self._joint = np.array(parents, np.int64) - 1
        # Of bodies beside the chain nothing better is known than R.
        self._beside = self._joint >= chain.dof
        self._beside_m = bounds[self._beside].max(axis=0, initial=0.0)

    def displacement_m(self, Q: FloatArray, half_change: FloatArray) -> FloatArray:
        """Bound for motions ``Q[k] ± half_change``, any part of them included.

        Parameters
        ----------
        Q : array, shape (n, dof)
        half_change : array, shape (dof,) or (n, dof)
            Of all motions, or of each.

        Returns
        -------
        array, shape (n,)
            For the part of relative size f of the motion, f times this holds about
            the part's own middle.
        """
        first = self._speed_m(Q, half_change).max(axis=1)
        size = np.abs(half_change)
        turns = size[..., self._chain.is_revolute].sum(axis=-1)
        second = turns * (size @ self._reach_m)
        return np.asarray(np.maximum(first + second, size @ self._beside_m))

    def of_bodies_m(self, Q: FloatArray, half_change: FloatArray) -> FloatArray:
        """The same for each body, shape (n, bodies), of motions ``Q ± half_change``.

        Both are of shape (n, dof).
        """
        size = np.abs(half_change)
        reach = size @ self._bounds.T
        turned = size[:, self._chain.is_revolute].sum(axis=1, keepdims=True)
        first = self._speed_m(Q, half_change)
        on_chain = np.where(self._beside, 0, self._joint)
        moved = np.minimum(first[:, on_chain] + turned * reach, reach)
        return np.asarray(np.where(self._beside, reach, moved))

    def boxes(self, Q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Boxes around the bodies that the chain moves, in robot_base.

        Parameters
        ----------
        Q : array, shape (n, dof)

        Returns
        -------
        low, high : array, shape (n, bodies, 3)
            For each geometry object of :attr:`on_chain`.
        """
        return self._extents.boxes(self._chain.joint_frames_many(Q))

    def _speed_m(self, Q: FloatArray, half_change: FloatArray) -> FloatArray:
        """Fastest point on each joint at the middles of motions, shape (n, dof)."""
        frames = self._chain.joint_frames_many(Q)
        origin, axis = frames[..., :3, 3], frames[..., :3, 2]
        change = np.broadcast_to(half_change, Q.shape)[..., None]
        is_revolute = self._chain.is_revolute[:, None]
        turning = axis * np.where(is_revolute, change, 0.0)
        sliding = axis * np.where(is_revolute, 0.0, change)
        # Velocity of a point X on joint k: Σ_{j ≤ k} (a_j × (X − o_j)) Δ_j.
        angular = np.cumsum(turning, axis=1)
        linear = np.cumsum(sliding + cross(origin, turning), axis=1)
        corners = frames[..., :3, :3] @ self._corners + origin[..., None]
        # Coordinates first, and no np.cross: this is called for every motion.
        ux, uy, uz = (linear[:, :, k, None] for k in range(3))
        wx, wy, wz = (angular[:, :, k, None] for k in range(3))
        x, y, z = corners[:, :, 0], corners[:, :, 1], corners[:, :, 2]
        square = (ux + wy * z - wz * y) ** 2
        square += (uy + wz * x - wx * z) ** 2
        square += (uz + wx * y - wy * x) ** 2
        return np.asarray(np.sqrt(square.max(axis=2)))


def _fill_row(
    row: FloatArray,
    model: Any,
    axes: list[tuple[FloatArray, bool]],
    joint: int,
    points: FloatArray,
) -> None:
    """Walk from the body's own joint to the root, outermost bound first."""
    axis, turns = axes[joint - 1]
    across = float(_across(points, axis).max())
    around = float(np.linalg.norm(points, axis=1).max())
    row[joint - 1] = across if turns else 1.0
    while (parent := model.parents[joint]) > 0:
        offset = model.jointPlacements[joint]
        axis, turns = axes[joint - 1]
        travel = 0.0 if turns else _largest_travel(model, joint)
        parent_axis, parent_turns = axes[parent - 1]
        here = offset.rotation @ axis
        parallel = turns and np.linalg.norm(np.cross(here, parent_axis)) < 1e-9
        step = float(_across(offset.translation[None], parent_axis)[0])
        around = float(np.linalg.norm(offset.translation)) + travel + around
        across = min(around, step + across) if parallel else around
        row[parent - 1] = across if parent_turns else 1.0
        joint = parent


def _axis(model: Any, joint: int) -> tuple[FloatArray, bool]:
    """Unit axis in the joint frame, and whether the joint turns about it."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, np.zeros(model.nq))
    motion = np.asarray(data.S).reshape(6, -1)[:, 0]
    turns = bool(np.linalg.norm(motion[3:]) > 0.5)
    return (motion[3:] if turns else motion[:3]), turns


def _across(points: FloatArray, axis: FloatArray) -> FloatArray:
    """Distance of points from the line through the origin along a unit axis."""
    along = points @ axis
    return np.asarray(np.linalg.norm(points - np.outer(along, axis), axis=1))


def _largest_travel(model: Any, joint: int) -> float:
    index = model.idx_qs[joint]
    low, high = model.lowerPositionLimit[index], model.upperPositionLimit[index]
    return float(max(abs(low), abs(high)))
