"""Newton steps that singular poses allow, and how far poses miss their goals."""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.robot.chain import SerialChain, pose_error

# A refined row that misses its pose by no more than this is a solution [m and rad].
ACCEPTED = 1e-7

# Rows per block, so that Jacobians stay in the cache.
_BLOCK = 512

# A row that has not become ten times better in this many steps is given up.
_PATIENCE = 15

# A row is done when it misses by no more than this [m and rad].
_TOLERANCE = 1e-13
_ITERATIONS = 30

# Largest change of a joint in one step.
_LARGEST_STEP_RAD = 0.5


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
    for start in range(0, len(Q), _BLOCK):
        block = slice(start, start + _BLOCK)
        best[block], residual[block] = _refine_block(chain, Q[block], T_goal[block])
    return best, residual


def _refine_block(
    chain: SerialChain, Q: FloatArray, T_goal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    best, residual = Q.copy(), np.full(len(Q), np.inf)
    milestone, waited = np.full(len(Q), np.inf), np.zeros(len(Q), int)
    active, q = np.arange(len(Q)), Q
    for count in range(_ITERATIONS + 1):
        T, J = chain.jacobian_many(q)
        error = pose_error(T_goal[active], T)
        size = _size(error)
        better = size < residual[active]
        best[active[better]], residual[active[better]] = q[better], size[better]
        progress = residual[active] < 0.1 * milestone[active]
        milestone[active[progress]] = residual[active[progress]]
        waited[active] = np.where(progress, 0, waited[active] + 1)
        going = (size > _TOLERANCE) & (waited[active] < _PATIENCE)
        if count == _ITERATIONS or not going.any():
            break
        active, dq = active[going], _damped_step(J[going], error[going])
        longest = np.abs(dq).max(axis=1, initial=1e-300)
        q = q[going] + dq * np.minimum(1.0, _LARGEST_STEP_RAD / longest)[:, None]
    return best, residual


def _damped_step(J: FloatArray, error: FloatArray) -> FloatArray:
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
