"""Starts for a numeric solver, from a table of sampled configurations.

Turning the first joint, or the last, changes a pose in a way that is known beforehand.
What is left of a pose if both turns are taken out, its features, depends on the joints
between alone: two fewer, so that a table of a few thousand rows covers them.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.kinematics.least_squares import ChainArrays, combined
from reachmap.core.kinematics.solutions import wrapped
from reachmap.core.robot.chain import SerialChain
from reachmap.geometry import inverse_transform

# Rows of the table. Fewer are further from a pose; of more, the nearest ones are of
# few branches. 2,500 to 5,000 found most branches of HC10, M-430iA and xArm6, whose
# table has four joints: eight values each.
_MOST_SAMPLES = 4096
_SAMPLES_PER_JOINT = 8
_FEWEST_SAMPLES = 64

# Starts that share a cell of this size lead to one solution [rad].
_CELL_RAD = 0.6

# Cells over the range of a sliding joint.
_CELLS = 10

# Largest change of a joint by the linear prediction [rad or m].
_LARGEST_STEP = 0.6

# Poses per block, which bounds the memory.
_BLOCK = 512

Frames = tuple[list[FloatArray], FloatArray]


class SeedTable:
    """Configurations of an arm, found by the features of their poses.

    Parameters
    ----------
    chain : SerialChain
    middle, half_range : array, shape (dof,)
        Range that is sampled.
    """

    def __init__(
        self, chain: SerialChain, middle: FloatArray, half_range: FloatArray
    ) -> None:
        self._arrays = ChainArrays.of(chain)
        self._is_revolute = chain.is_revolute
        self._first = bool(chain.is_revolute[0])
        self._last = chain.dof > 1 and bool(chain.is_revolute[-1])
        inner = np.ones(chain.dof, bool)
        inner[0], inner[-1] = not self._first, not self._last
        self._inner = np.flatnonzero(inner)
        self._set_axes(chain)
        self._cell = np.where(chain.is_revolute, _CELL_RAD, 2 * half_range / _CELLS)
        samples = int(_SAMPLES_PER_JOINT ** len(self._inner))
        samples = min(max(samples, _FEWEST_SAMPLES), _MOST_SAMPLES)
        spread = 2.0 * spread_points(samples, len(self._inner)) - 1.0
        Q = np.zeros((samples, chain.dof))
        Q[:, self._inner] = middle[self._inner] + spread * half_range[self._inner]
        self._Q = Q
        self._weight = 1.0
        features, _ = self._features(self._arrays.forward(Q.T.copy()))
        # Metres and directions spread equally wide.
        self._weight = float(np.ptp(features[:, :2], axis=0).max()) / 2
        self._table, _ = self._features(self._arrays.forward(Q.T.copy()))
        self._towards = self._linear_steps()
        self._tree = cKDTree(self._table)

    def __len__(self) -> int:
        return len(self._Q)

    def starts(self, T: FloatArray, count: int) -> tuple[FloatArray, IntArray]:
        """Starts for poses, from the `count` nearest rows each, and their poses.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
        count : int

        Returns
        -------
        Q : array, shape (m, dof)
        frame : array of int, shape (m,)
        """
        tables = [
            self._block(T[start : start + _BLOCK], count)
            for start in range(0, len(T), _BLOCK)
        ]
        frames = [frame + k * _BLOCK for k, (_, frame) in enumerate(tables)]
        return np.concatenate([Q for Q, _ in tables]), np.concatenate(frames)

    def _block(self, T: FloatArray, count: int) -> tuple[FloatArray, IntArray]:
        goals = [T[:, :3, j].T for j in range(3)], T[:, :3, 3].T
        features, azimuth = self._features(goals)
        _, near = self._tree.query(features, min(count, len(self)))
        near = near.reshape(len(T), -1)
        missing = features[:, None] - self._table[near]
        step = (self._towards[near] @ missing[..., None])[..., 0]
        longest = np.abs(step).max(axis=2, keepdims=True, initial=1e-300)
        step *= np.minimum(1.0, _LARGEST_STEP / longest)
        inner = self._Q[near][:, :, self._inner] + step
        frame, column = np.nonzero(self._alone_in_cell(inner))
        Q = np.zeros((len(frame), self._Q.shape[1]))
        Q[:, self._inner] = inner[frame, column]
        self._turn_ends(Q, [c[:, frame] for c in goals[0]], azimuth[frame])
        return Q, frame

    def _alone_in_cell(self, inner: FloatArray) -> BoolArray:
        """Whether a start is its cell's first, (n, count, joints) to (n, count)."""
        turned = wrapped(inner, self._is_revolute[self._inner])
        cells = np.floor(turned / self._cell[self._inner]).astype(np.int64) % 64
        key = cells @ 64 ** np.arange(cells.shape[2])
        order = np.argsort(key, axis=1, kind="stable")
        ordered = np.take_along_axis(key, order, axis=1)
        first = np.ones(key.shape, bool)
        first[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
        alone = np.zeros(key.shape, bool)
        np.put_along_axis(alone, order, first, axis=1)
        return alone

    def _turn_ends(
        self, Q: FloatArray, goals: list[FloatArray], azimuth: FloatArray
    ) -> None:
        """Set the first and the last joint so that they fit the goals best."""
        frames = self._arrays.forward(Q.T.copy())
        if self._first:
            Q[:, 0] = azimuth - self._features(frames)[1]
            goals = [_turned(column, self._axis, -Q[:, 0]) for column in goals]
        if self._last:
            # Rotation from here to there, seen from the TCP: about the last axis.
            D = [[(a * b).sum(0) for b in goals] for a in frames[0]]
            z = self._directions[0]
            sine = (
                z[0] * (D[2][1] - D[1][2])
                + z[1] * (D[0][2] - D[2][0])
                + z[2] * (D[1][0] - D[0][1])
            )
            along = sum(z[i] * z[j] * D[i][j] for i in range(3) for j in range(3))
            Q[:, -1] = np.arctan2(sine, D[0][0] + D[1][1] + D[2][2] - along)

    def _set_axes(self, chain: SerialChain) -> None:
        frames = chain.joint_frames_many(np.zeros((1, chain.dof)))[0]
        self._origin, self._axis = frames[0, :3, 3], frames[0, :3, 2]
        self._x, self._y = frames[0, :3, 0], frames[0, :3, 1]
        T_tcp_last = inverse_transform(chain.tcp_at_zero) @ frames[-1]
        if self._last:
            self._point, self._directions = T_tcp_last[:3, 3], [T_tcp_last[:3, 2]]
        else:
            self._point, self._directions = np.zeros(3), [np.eye(3)[0], np.eye(3)[2]]

    def _features(self, frames: Frames) -> tuple[FloatArray, FloatArray]:
        """What the first and last joint cannot change, (n, k), and azimuths, (n,)."""
        R, p = frames
        point = combined(R, self._point.tolist()) + p - self._origin[:, None]
        directions = [combined(R, d.tolist()) for d in self._directions]
        if not self._first:
            parts = [*point, *(self._weight * d for v in directions for d in v)]
            return np.stack(parts, axis=1), np.zeros(p.shape[1])
        x, y = self._x @ point, self._y @ point
        radius = np.hypot(x, y)
        azimuth = np.arctan2(y, x)
        parts = [radius, self._axis @ point]
        c, s = np.cos(azimuth), np.sin(azimuth)
        for v in directions:
            x, y = self._x @ v, self._y @ v
            seen = (c * x + s * y, c * y - s * x, self._axis @ v)
            parts += [self._weight * part for part in seen]
        return np.stack(parts, axis=1), azimuth

    def _linear_steps(self) -> FloatArray:
        """Joint steps per change of features, by damped inverses, (m, joints, k)."""
        step = 1e-5
        columns = []
        for joint in self._inner:
            ahead, behind = self._Q.T.copy(), self._Q.T.copy()
            ahead[joint] += step
            behind[joint] -= step
            change = (
                self._features(self._arrays.forward(ahead))[0]
                - self._features(self._arrays.forward(behind))[0]
            )
            columns.append(change / (2 * step))
        J = np.stack(columns, axis=2)
        J_t = np.swapaxes(J, 1, 2)
        normal = J_t @ J
        damping = 1e-3 * np.trace(normal, axis1=1, axis2=2) / len(columns) + 1e-9
        normal += damping[:, None, None] * np.eye(len(columns))
        return np.asarray(np.linalg.solve(normal, J_t))


def _turned(v: FloatArray, axis: FloatArray, angle: FloatArray) -> FloatArray:
    """Vectors (3, n) turned about an axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(
        c * v
        + s * np.cross(axis[:, None], v, axis=0)
        + (1 - c) * (axis @ v) * axis[:, None]
    )


def spread_points(count: int, dimension: int) -> FloatArray:
    """Evenly spread points of the unit cube, shape (count, dimension).

    An additive recurrence with powers of the generalised golden ratio: without
    random numbers every pose gets the same starts in every run, and they leave
    smaller gaps than random ones.
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (dimension + 1))
    steps = ratio ** -np.arange(1.0, dimension + 1)
    return np.asarray((0.5 + np.arange(count)[:, None] * steps) % 1.0)
