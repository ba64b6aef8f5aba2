"""Damped least squares for thousands of configurations at once.

What NumPy spends on a call is spread over a whole block: in every array the
configuration is the last axis, so that each step of the arithmetic is one sweep over
contiguous memory. A configuration's result does not depend on its neighbours. Numbers
are of the kind that the starts are of: the first steps can do with single precision.

Near singularities, where normal equations lose too much, singular values take their
place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.robot.chain import (
    NEAR_HALF_TURN,
    SerialChain,
    axis_of_half_turn,
    pose_error,
)

# Rows per block: its arrays, a few megabytes, nearly stay in the cache, and the last
# rows of a block are many enough to be worth a call.
_BLOCK = 4096

# Entries of fixed transforms that are zero but for the last place of a product.
_ZERO = 4e-16

# A step that goes on for longer than this is cut [rad or m].
_LARGEST_STEP = 0.5

# A row that has not become ten times better in this many steps is given up.
_PATIENCE = 15

# With singular values: rows per block, so that Jacobians stay in the cache; a row is
# done when it misses by no more than the tolerance [m and rad].
_SINGULAR_BLOCK = 512
_TOLERANCE = 1e-13
_ITERATIONS = 30

# Damping of a row that meets its goal, in units of the last place.
_DAMPING = 50.0


def least_squares_many(
    chain: SerialChain,
    Q: FloatArray,
    T_goal: FloatArray,
    *,
    tolerance: float,
    iterations: int,
    patience: int = _PATIENCE,
    limits: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Move configurations so that the TCP meets its goal.

    Parameters
    ----------
    chain : SerialChain
    Q : array, shape (n, dof)
        Starts [rad].
    T_goal : array, shape (n, 4, 4)
        Goals T_base_tcp.
    tolerance : float
        A row is done when it misses by no more than this [m and rad].
    iterations : int
        Steps at most.
    patience : int
        A row that has not become ten times better in this many steps is given up.
    limits : tuple of array, shape (dof,), optional
        Lower and upper limits that steps do not leave.

    Returns
    -------
    Q : array, shape (n, dof)
        Best configuration of each row.
    residual : array, shape (n,)
        What it misses by, the larger of [m] and [rad].
    """
    best, residual = np.empty_like(Q), np.empty(len(Q), Q.dtype)
    arm = ChainArrays.of(chain)
    bounds = None if limits is None else (limits[0][:, None], limits[1][:, None])
    for start in range(0, len(Q), _BLOCK):
        rows = slice(start, start + _BLOCK)
        goals = np.moveaxis(T_goal[rows, :3], 0, -1).astype(Q.dtype, order="C")
        best[rows], residual[rows] = _refine(
            arm,
            np.ascontiguousarray(Q[rows].T),
            goals,
            tolerance,
            iterations,
            patience,
            bounds,
        )
    return best, residual


class _Progress:
    """Best configuration of each row so far, and which rows still move.

    Parameters
    ----------
    Q : array, shape (n, dof)
        Starts [rad].
    tolerance : float
        A row is done when it misses by no more than this [m and rad].
    patience : int
        A row that has not become ten times better in this many steps is given up.
    """

    def __init__(self, Q: FloatArray, tolerance: float, patience: int) -> None:
        self._tolerance, self._patience = tolerance, patience
        self.best, self.residual = Q.copy(), np.full(len(Q), np.inf, Q.dtype)
        self._milestone, self._waited = self.residual.copy(), np.zeros(len(Q), int)
        self.active = np.arange(len(Q))

    def update(self, Q: FloatArray, size: FloatArray) -> BoolArray:
        """Record the misses of the active rows; which of them go on."""
        rows = self.active
        better = size < self.residual[rows]
        self.best[rows[better]], self.residual[rows[better]] = Q[better], size[better]
        progress = self.residual[rows] < 0.1 * self._milestone[rows]
        self._milestone[rows[progress]] = self.residual[rows[progress]]
        self._waited[rows] = np.where(progress, 0, self._waited[rows] + 1)
        going = (size > self._tolerance) & (self._waited[rows] < self._patience)
        self.active = rows[going]
        return going


def _refine(
    arm: ChainArrays,
    q: FloatArray,
    goals: FloatArray,
    tolerance: float,
    iterations: int,
    patience: int,
    bounds: tuple[FloatArray, FloatArray] | None,
) -> tuple[FloatArray, FloatArray]:
    """Refine a block: q (dof, n), goals (3, 4, n)."""
    progress = _Progress(q.T, tolerance, patience)
    for count in range(iterations + 1):
        error, J = arm.error_and_jacobian(q, goals)
        size = np.sqrt(np.maximum((error[:3] ** 2).sum(0), (error[3:] ** 2).sum(0)))
        going = progress.update(q.T, size)
        if count == iterations or not going.any():
            break
        dq = _damped_step(J, error)
        if bounds is not None:
            # Joints that would leave their limits stay; the others do what they can.
            stays = ((q <= bounds[0]) & (dq < 0)) | ((q >= bounds[1]) & (dq > 0))
            dq = np.where(stays, 0.0, _damped_step(np.where(stays, 0.0, J), error))
        longest = np.maximum(np.abs(dq).max(axis=0), _LARGEST_STEP)
        q = q + dq * (_LARGEST_STEP / longest)
        if bounds is not None:
            q = np.clip(q, *bounds)
        if not going.all():
            q, goals = q[:, going], goals[:, :, going]
    return progress.best, progress.residual


def _damped_step(J: FloatArray, error: FloatArray) -> FloatArray:
    """Solve (JᵀJ + μI) dq = Jᵀe, (6, dof, n) and (6, n) to (dof, n).

    With μ proportional to the squared error the steps stay quadratically convergent
    even where solutions form a curve and J has no full rank.
    """
    dof = J.shape[1]
    damping = 0.1 * (error * error).sum(0) + _DAMPING * np.finfo(J.dtype).eps
    b = J[0] * error[0]
    for part, miss in zip(J[1:], error[1:], strict=True):
        b += part * miss
    # The upper triangle, a row at a time.
    U = []
    for i in range(dof):
        row = J[0, i] * J[0, i:]
        for part in J[1:]:
            row += part[i] * part[i:]
        row[0] += damping
        U.append(row)
    # Elimination without pivots is stable, as the matrix is positive definite.
    for k in range(dof - 1):
        factors = U[k][1:] / U[k][0]
        for i, factor in enumerate(factors, start=1):
            U[k + i] -= factor * U[k][i:]
        b[k + 1 :] -= factors * b[k]
    for k in reversed(range(dof)):
        for j in range(k + 1, dof):
            b[k] -= U[k][j - k] * b[j]
        b[k] /= U[k][0]
    return np.asarray(b)


@dataclass(frozen=True, kw_only=True, eq=False)
class ChainArrays:
    """A chain as plain numbers, its zeros exact."""

    steps: list[list[list[float]]]
    is_revolute: BoolArray

    @classmethod
    def of(cls, chain: SerialChain) -> ChainArrays:
        """Read the numbers off a chain."""
        T = np.where(np.abs(chain.T_fixed) < _ZERO, 0.0, chain.T_fixed)
        return cls(steps=T[:, :3].tolist(), is_revolute=chain.is_revolute)

    def error_and_jacobian(
        self, q: FloatArray, goals: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Errors (6, n) and geometric Jacobians (6, dof, n), both in robot_base."""
        points = np.empty((len(q), 3, q.shape[1]), q.dtype)
        axes = np.empty_like(points)
        R, p = self.forward(q, points, axes)
        return _error(R, p, goals), self._jacobian(points, axes, p)

    def forward(
        self,
        q: FloatArray,
        points: FloatArray | None = None,
        axes: FloatArray | None = None,
    ) -> tuple[list[FloatArray], FloatArray]:
        """Rotation, as a list of columns (3, n), and position (3, n) of the TCP.

        The frames of the joints are written into `points` and `axes`, (dof, 3, n).
        """
        cosine, sine = np.cos(q), np.sin(q)
        R: list[FloatArray] = list(np.eye(3, dtype=q.dtype)[:, :, None])
        p: FloatArray = np.zeros((3, 1), q.dtype)
        for k in range(len(q)):
            R, p = _moved(R, p, self.steps[k])
            if points is not None and axes is not None:
                points[k], axes[k] = p, R[2]
            if self.is_revolute[k]:
                c, s = cosine[k], sine[k]
                R = [c * R[0] + s * R[1], c * R[1] - s * R[0], R[2]]
            else:
                p = p + q[k] * R[2]
        R, p = _moved(R, p, self.steps[-1])
        # A column that no joint turns is one for all configurations.
        shape = (3, q.shape[1])
        return [np.broadcast_to(c, shape) for c in R], np.broadcast_to(p, shape)

    def _jacobian(
        self, points: FloatArray, axes: FloatArray, p: FloatArray
    ) -> FloatArray:
        J = np.empty((6, len(points), p.shape[1]), p.dtype)
        arm = p - points
        for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            J[i] = axes[:, j] * arm[:, k] - axes[:, k] * arm[:, j]
            J[3 + i] = axes[:, i]
        for joint in np.flatnonzero(~self.is_revolute):
            J[:3, joint], J[3:, joint] = axes[joint], 0.0
        return J


def _moved(
    R: list[FloatArray], p: FloatArray, step: list[list[float]]
) -> tuple[list[FloatArray], FloatArray]:
    """Frames after a fixed transform; R is a list of columns, each (3, n)."""
    columns = [combined(R, [row[j] for row in step]) for j in range(4)]
    return columns[:3], p + columns[3]


def combined(R: list[FloatArray], weights: list[float]) -> FloatArray:
    """Weighted sum of columns; zeros and ones cost nothing."""
    total: FloatArray | None = None
    for column, weight in zip(R, weights, strict=True):
        if weight == 0.0:
            continue
        part = column if weight == 1.0 else weight * column
        total = part if total is None else total + part
    return np.zeros((3, 1), R[0].dtype) if total is None else total


def _error(R: list[FloatArray], p: FloatArray, goals: FloatArray) -> FloatArray:
    """Translations and rotation vectors to goals (3, 4, n), shape (6, n)."""
    error = np.empty((6, goals.shape[2]), goals.dtype)
    error[:3] = goals[:, 3] - p
    D = goals[:, None, 0] * R[0][None]
    D += goals[:, None, 1] * R[1][None]
    D += goals[:, None, 2] * R[2][None]
    v = 0.5 * np.stack((D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]))
    sine = np.sqrt((v * v).sum(0))
    cosine = 0.5 * (D[0, 0] + D[1, 1] + D[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    error[3:] = v * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)
    far = np.flatnonzero((cosine < 0.0) & (sine < NEAR_HALF_TURN))
    if len(far):
        axis = axis_of_half_turn(np.moveaxis(D[:, :, far], -1, 0), v[:, far].T)
        error[3:, far] = axis.T * angle[far]
    return error


def matrix_difference(T_goal: FloatArray, T: FloatArray) -> FloatArray:
    """Bound how far poses miss their goals, the larger of [m] and [rad], shape (n,).

    From above; near zero by less than twice the miss.
    """
    difference = (T_goal - T)[:, :3].reshape(len(T), 12)
    # ‖ΔR‖_F = √2 · 2 sin(φ/2); the factor π/(2√2) bounds φ for all angles.
    squares = np.einsum("ni,ni->n", difference, difference)
    return np.asarray(np.sqrt(squares) * (np.pi / np.sqrt(8.0)))


def refine_many(
    chain: SerialChain, Q: FloatArray, T_goal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Move configurations so that the TCP meets its goal, at singularities as well.

    Singular values, several times as expensive as normal equations, do not square the
    condition number: needed within about 1e-6 rad of a singularity.

    Parameters
    ----------
    chain : SerialChain
    Q : array, shape (n, dof)
        Starts [rad].
    T_goal : array, shape (n, 4, 4)
        Goals T_base_tcp.

    Returns
    -------
    Q : array, shape (n, dof)
        Best configuration of each row.
    residual : array, shape (n,)
        What it misses by, the larger of [m] and [rad].
    """
    best, residual = Q.copy(), np.full(len(Q), np.inf)
    for start in range(0, len(Q), _SINGULAR_BLOCK):
        block = slice(start, start + _SINGULAR_BLOCK)
        best[block], residual[block] = _refine_block(chain, Q[block], T_goal[block])
    return best, residual


def _refine_block(
    chain: SerialChain, q: FloatArray, T_goal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    progress = _Progress(q, _TOLERANCE, _PATIENCE)
    for count in range(_ITERATIONS + 1):
        T, J = chain.jacobian_many(q)
        error = pose_error(T_goal[progress.active], T)
        going = progress.update(q, _size(error))
        if count == _ITERATIONS or not going.any():
            break
        dq = _step_by_singular_values(J[going], error[going])
        longest = np.abs(dq).max(axis=1, initial=1e-300)
        q = q[going] + dq * np.minimum(1.0, _LARGEST_STEP / longest)[:, None]
    return progress.best, progress.residual


def _step_by_singular_values(J: FloatArray, error: FloatArray) -> FloatArray:
    """Solve (JᵀJ + μI) dq = Jᵀe by singular values.

    With μ proportional to the squared error the steps stay quadratically convergent
    even where solutions form a curve and J has no full rank.
    """
    U, s, V_t = np.linalg.svd(J, full_matrices=False)
    damping = 0.1 * (error * error).sum(1) + 1e-22
    along = (np.swapaxes(U, 1, 2) @ error[:, :, None])[..., 0]
    along *= s / (s * s + damping[:, None])
    return np.asarray((np.swapaxes(V_t, 1, 2) @ along[:, :, None])[..., 0])


def _size(error: FloatArray) -> FloatArray:
    squares = error * error
    return np.asarray(np.sqrt(np.maximum(squares[:, :3].sum(1), squares[:, 3:].sum(1))))
