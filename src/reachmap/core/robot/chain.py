"""A serial chain as arrays: forward kinematics and Jacobians of many configurations.

Pinocchio works on one configuration at a time; inverse kinematics has to check
hundreds of thousands. A configuration's result does not depend, to the last bit, on
its neighbours in the batch (stacks of small matrices are multiplied one by one, never
as one large product), so results are the same for every division of work.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.robot.assembly import TCP_FRAME
from reachmap.core.robot.model import RobotModel
from reachmap.geometry import inverse_transform, transform_from_parts, transform_points

# Rows per block: the block's arrays, half a megabyte, stay in the cache.
_BLOCK = 256

# Sine of the angle from a half turn below which the axis is read off another part of
# the rotation; both parts are good to 1e-13 there.
NEAR_HALF_TURN = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SerialChain:
    """Joints about (or along) their own z axis, with fixed transforms between.

    Attributes
    ----------
    T_fixed : array, shape (dof + 1, 4, 4)
        From each joint's frame to the next one's at zero [m]; the first from
        robot_base, the last to the TCP.
    is_revolute : array of bool, shape (dof,)
    axes_base : array, shape (3, dof)
        Joint axes in robot_base at zero, unrounded (parallel axes stay parallel).
    offsets_base : array, shape (3, dof + 1)
        Vectors from origin to origin in robot_base at zero [m].
    R_base_tcp_zero : array, shape (3, 3)
        Orientation of the TCP at zero.
    """

    T_fixed: FloatArray
    is_revolute: BoolArray
    axes_base: FloatArray
    offsets_base: FloatArray
    R_base_tcp_zero: FloatArray
    _parts: FloatArray = field(init=False, repr=False)
    _sliding: tuple[int, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        sliding = tuple(np.flatnonzero(~self.is_revolute).tolist())
        object.__setattr__(self, "_parts", _joint_parts(self.T_fixed[:-1]))
        object.__setattr__(self, "_sliding", sliding)

    @classmethod
    def from_robot(cls, robot: RobotModel) -> SerialChain:
        """Read the chain off a Pinocchio model."""
        model = robot.model
        data, q_zero = model.createData(), np.zeros(model.nq)
        pin.framesForwardKinematics(model, data, q_zero)
        base = pin.SE3(robot.T_root_base)
        tcp = base.actInv(data.oMf[model.getFrameId(TCP_FRAME)])
        zero, axes = [np.eye(4)], []
        for joint in range(1, model.njoints):
            placement = base.actInv(data.oMi[joint])
            axis = _axis_in_joint(model.joints[joint], model)
            axes.append(placement.rotation @ axis)
            R = placement.rotation @ _frames_with_z(axis[None])[0]
            zero.append(transform_from_parts(R, placement.translation))
        zero.append(np.array(tcp.homogeneous))
        T = np.array(zero)
        return cls(
            T_fixed=inverse_transform(T[:-1]) @ T[1:],
            is_revolute=robot.is_revolute,
            axes_base=np.array(axes).T,
            offsets_base=np.diff(T[:, :3, 3], axis=0).T.copy(),
            R_base_tcp_zero=tcp.rotation.copy(),
        )

    @classmethod
    def from_axes(
        cls,
        axes: FloatArray,
        points: FloatArray,
        T_base_tcp_zero: FloatArray,
        is_revolute: BoolArray,
    ) -> SerialChain:
        """Build a chain from what its joints are at zero, all in robot_base.

        Parameters
        ----------
        axes : array, shape (dof, 3)
            Unit vectors.
        points : array, shape (dof, 3)
            A point on each axis [m].
        T_base_tcp_zero : array, shape (4, 4)
        is_revolute : array of bool, shape (dof,)
        """
        R = _frames_with_z(np.asarray(axes, float))
        T = np.concatenate([np.eye(4)[None], transform_from_parts(R, points)])
        T = np.concatenate([T, T_base_tcp_zero[None]])
        return cls(
            T_fixed=inverse_transform(T[:-1]) @ T[1:],
            is_revolute=np.asarray(is_revolute, bool),
            axes_base=np.array(axes, float).T.copy(),
            offsets_base=np.diff(T[:, :3, 3], axis=0).T.copy(),
            R_base_tcp_zero=T_base_tcp_zero[:3, :3].copy(),
        )

    @property
    def points_base(self) -> FloatArray:
        """A point on each axis in robot_base at zero [m], shape (dof, 3)."""
        return np.cumsum(self.offsets_base.T, axis=0)[:-1]

    @property
    def tcp_at_zero(self) -> FloatArray:
        """TCP pose at zero, shape (4, 4)."""
        return transform_from_parts(self.R_base_tcp_zero, self.offsets_base.sum(axis=1))

    def held(self, joint: int, value: float) -> SerialChain:
        """Take the chain without one of its joints, which stays at a value."""
        q = np.zeros((1, self.dof))
        q[0, joint] = value
        T_base_joint = self.joint_frames_many(np.zeros((1, self.dof)))[0, joint]
        moved = self.joint_frames_many(q)[0, joint] @ inverse_transform(T_base_joint)
        axes, points = self.axes_base.T.copy(), self.points_base
        axes[joint + 1 :] = axes[joint + 1 :] @ moved[:3, :3].T
        points[joint + 1 :] = transform_points(moved, points[joint + 1 :])
        others = np.arange(self.dof) != joint
        return SerialChain.from_axes(
            axes[others],
            points[others],
            moved @ self.tcp_at_zero,
            self.is_revolute[others],
        )

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.is_revolute)

    def forward_many(self, Q: FloatArray) -> FloatArray:
        """TCP poses T_base_tcp, (n, dof) to (n, 4, 4)."""
        Q = np.asarray(Q, float).reshape(-1, self.dof)
        T = np.empty((len(Q), 4, 4))
        for start in range(0, len(Q), _BLOCK):
            block = slice(start, start + _BLOCK)
            steps = self._steps(Q[block])
            T_block = steps[0]
            for step in steps[1:]:
                T_block = T_block @ step
            T[block] = T_block @ self.T_fixed[-1]
        return T

    def joint_frames_many(self, Q: FloatArray) -> FloatArray:
        """Frames of the joints in robot_base, z along the axis, (n, dof, 4, 4)."""
        steps = self._steps(np.asarray(Q, float))
        frames = np.empty((len(Q), self.dof, 4, 4))
        frames[:, 0] = steps[0]
        for k in range(1, self.dof):
            np.matmul(frames[:, k - 1], steps[k], out=frames[:, k])
        return frames

    @staticmethod
    def joint_rotations(model: Any) -> FloatArray:
        """Each joint frame of this chain in Pinocchio's joint frame, (dof, 3, 3)."""
        axes = [_axis_in_joint(joint, model) for joint in list(model.joints)[1:]]
        return _frames_with_z(np.array(axes))

    def jacobian_many(self, Q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """TCP poses and geometric Jacobians in robot_base.

        Parameters
        ----------
        Q : array, shape (n, dof)

        Returns
        -------
        T_base_tcp : array, shape (n, 4, 4)
        J : array, shape (n, 6, dof)
            Rows: velocity of the TCP [m/rad], angular velocity.
        """
        F = self.joint_frames_many(Q)
        T = F[:, -1] @ self.T_fixed[-1]
        z, arm = F[:, :, :3, 2], T[:, None, :3, 3] - F[:, :, :3, 3]
        J = np.zeros((len(Q), 6, self.dof))
        J[:, :3] = np.swapaxes(
            np.where(self.is_revolute[:, None], cross(z, arm), z), 1, 2
        )
        J[:, 3:] = np.swapaxes(np.where(self.is_revolute[:, None], z, 0.0), 1, 2)
        return T, J

    def _steps(self, Q: FloatArray) -> FloatArray:
        """Compute the transforms from joint to joint, (n, dof) to (dof, n, 4, 4)."""
        # Per joint F Rz(q) = A + cos(q) B + sin(q) C: three sweeps over contiguous
        # memory; a matrix product would be faster, but rounds differently by size.
        A, B, C = self._parts
        steps = np.cos(Q.T)[:, :, None] * B[:, None]
        steps += np.sin(Q.T)[:, :, None] * C[:, None]
        steps += A[:, None]
        steps = steps.reshape(self.dof, len(Q), 4, 4)
        for k in self._sliding:
            steps[k] = self.T_fixed[k]
            steps[k, :, :, 3] += Q[:, k, None] * self.T_fixed[k, :, 2]
        return np.asarray(steps)


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products along the last axis, for small arrays faster than numpy's."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    c = np.empty(a.shape)
    c[..., 0] = ay * bz - az * by
    c[..., 1] = az * bx - ax * bz
    c[..., 2] = ax * by - ay * bx
    return c


def pose_error(T_goal: FloatArray, T: FloatArray) -> FloatArray:
    """Position and rotation from T to the goal, in robot_base.

    Parameters
    ----------
    T_goal, T : array, shape (n, 4, 4)

    Returns
    -------
    array, shape (n, 6)
        Translation [m] and rotation vector [rad], at most a half turn long; exactly
        at a half turn, where both directions do, either.
    """
    error = np.empty((len(T), 6))
    error[:, :3] = T_goal[:, :3, 3] - T[:, :3, 3]
    G, R = T_goal[:, :3, :3], T[:, :3, :3]
    D = (G[:, :, None, :] * R[:, None, :, :]).sum(-1)
    v = 0.5 * np.stack(
        (D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]), 1
    )
    sine = np.sqrt((v * v).sum(1))
    cosine = 0.5 * (D[:, 0, 0] + D[:, 1, 1] + D[:, 2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    scale = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)
    error[:, 3:] = v * scale[:, None]
    # Towards a half turn v vanishes, and with it the direction that it gives.
    far = np.flatnonzero((cosine < 0.0) & (sine < NEAR_HALF_TURN))
    if len(far):
        error[far, 3:] = axis_of_half_turn(D[far], v[far]) * angle[far, None]
    return error


def axis_of_half_turn(D: FloatArray, v: FloatArray) -> FloatArray:
    """Unit axes of rotations by nearly a half turn, (n, 3, 3) to (n, 3).

    Parameters
    ----------
    D : array, shape (n, 3, 3)
    v : array, shape (n, 3)
        The axes times the small sine of the angle, for their sign.
    """
    # D + Dᵀ = 2 c I + 2 (1 - c) a aᵀ: every column of a aᵀ is along the axis.
    S = D + np.swapaxes(D, 1, 2)
    trace = np.trace(D, axis1=1, axis2=2)
    S -= (trace - 1.0)[:, None, None] * np.eye(3)
    largest = np.argmax(np.diagonal(S, axis1=1, axis2=2), axis=1)
    axis = S[np.arange(len(S)), largest]
    axis /= np.sqrt((axis * axis).sum(1))[:, None]
    return np.asarray(axis * np.where((axis * v).sum(1) < 0.0, -1.0, 1.0)[:, None])


def _joint_parts(fixed: FloatArray) -> FloatArray:
    """Split joint transforms into constant, cosine and sine part, (3, dof, 16)."""
    parts = np.zeros((3, *fixed.shape))
    parts[0, :, :, 2:] = fixed[..., 2:]
    parts[1, :, :, :2] = fixed[..., :2]
    parts[2, :, :, 0] = fixed[..., 1]
    parts[2, :, :, 1] = -fixed[..., 0]
    return parts.reshape(3, len(fixed), 16)


def _axis_in_joint(joint: object, model: object) -> FloatArray:
    data = joint.createData()  # type: ignore[attr-defined]
    joint.calc(data, np.zeros(model.nq), np.zeros(model.nv))  # type: ignore[attr-defined]
    motion = np.asarray(data.S).reshape(6, -1)[:, 0]
    return motion[3:] if np.any(motion[3:]) else motion[:3]


def _frames_with_z(axes: FloatArray) -> FloatArray:
    """Right-handed rotations whose z axes are given vectors, (n, 3) to (n, 3, 3)."""
    z = axes / np.sqrt((axes * axes).sum(axis=1, keepdims=True))
    x = np.cross(np.eye(3)[np.abs(z).argmin(axis=1)], z)
    x /= np.sqrt((x * x).sum(axis=1, keepdims=True))
    return np.stack((x, np.cross(z, x), z), axis=2)
