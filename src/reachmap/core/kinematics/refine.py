"""Newton steps of many configurations at once towards their poses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.robot.chain import SerialChain, pose_error

# A refined row that misses its pose by no more than this is a solution [m and rad].
ACCEPTED = 1e-7

# Rows per block, so that Jacobians and normal equations stay in the cache.
_BLOCK = 512

# A row that has not become ten times better in so many steps is given up.
_PATIENCE = 15

Step = Callable[[FloatArray, FloatArray], FloatArray]


def matrix_difference(T_goal: FloatArray, T: FloatArray) -> FloatArray:
    """Bound how far poses miss their goals, the larger of [m] and [rad], shape (n,).

    From above; near zero by less than twice the miss.
    """
    difference = (T_goal - T)[:, :3].reshape(len(T), 12)
    # ‖ΔR‖_F = √2 · 2 sin(φ/2); the factor π/(2√2) bounds φ for all angles.
    squares = np.einsum("ni,ni->n", difference, difference)
    return np.asarray(np.sqrt(squares) * (np.pi / np.sqrt(8.0)))


def refine_many(
    chain: SerialChain,
    Q: FloatArray,
    T_goal: FloatArray,
    *,
    tolerance: float,
    iterations: int,
    singular: bool = False,
    largest_step_rad: float = 0.5,
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
    singular : bool
        Use singular values, several times as dear, instead of the normal
        equations, which square the condition number: needed within about 1e-6 rad
        of a singularity.
    largest_step_rad : float
        Largest change of a joint in one step.

    Returns
    -------
    Q : array, shape (n, dof)
        Best configuration of each row.
    residual : array, shape (n,)
        What it misses by, the larger of [m] and [rad].
    """
    step = _singular_step if singular else _normal_step
    best, residual = Q.copy(), np.full(len(Q), np.inf)
    for start in range(0, len(Q), _BLOCK):
        block = slice(start, start + _BLOCK)
        best[block], residual[block] = _refine_block(
            chain,
            Q[block],
            T_goal[block],
            tolerance,
            iterations,
            step,
            largest_step_rad,
        )
    return best, residual


def _refine_block(
    chain: SerialChain,
    Q: FloatArray,
    T_goal: FloatArray,
    tolerance: float,
    iterations: int,
    step: Step,
    largest: float,
) -> tuple[FloatArray, FloatArray]:
    best, residual = Q.copy(), np.full(len(Q), np.inf)
    milestone, waited = np.full(len(Q), np.inf), np.zeros(len(Q), int)
    active, q = np.arange(len(Q)), Q
    for count in range(iterations + 1):
        T, J = chain.jacobian_many(q)
        error = pose_error(T_goal[active], T)
        size = _size(error)
        better = size < residual[active]
        best[active[better]], residual[active[better]] = q[better], size[better]
        progress = residual[active] < 0.1 * milestone[active]
        milestone[active[progress]] = residual[active[progress]]
        waited[active] = np.where(progress, 0, waited[active] + 1)
        going = (size > tolerance) & (waited[active] < _PATIENCE)
        if count == iterations or not going.any():
            break
        active, dq = active[going], step(J[going], error[going])
        longest = np.abs(dq).max(axis=1, initial=1e-300)
        q = q[going] + dq * np.minimum(1.0, largest / longest)[:, None]
    return best, residual


def _normal_step(J: FloatArray, error: FloatArray) -> FloatArray:
    """Solve (JᵀJ + μI) dq = Jᵀe.

    With μ proportional to the squared error the steps stay quadratically convergent
    even where solutions form a curve and J has no full rank.
    """
    J_t = np.swapaxes(J, 1, 2)
    damping = 0.1 * (error * error).sum(1) + 1e-14
    normal = J_t @ J + damping[:, None, None] * np.eye(J.shape[2])
    return np.asarray(np.linalg.solve(normal, J_t @ error[:, :, None])[..., 0])


def _singular_step(J: FloatArray, error: FloatArray) -> FloatArray:
    """Do the same by singular values."""
    U, s, V_t = np.linalg.svd(J, full_matrices=False)
    damping = 0.1 * (error * error).sum(1) + 1e-22
    along = (np.swapaxes(U, 1, 2) @ error[:, :, None])[..., 0]
    along *= s / (s * s + damping[:, None])
    return np.asarray((np.swapaxes(V_t, 1, 2) @ along[:, :, None])[..., 0])


def _size(error: FloatArray) -> FloatArray:
    squares = error * error
    return np.asarray(np.sqrt(np.maximum(squares[:, :3].sum(1), squares[:, 3:].sum(1))))
