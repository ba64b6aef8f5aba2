"""Kernel ridge regression over grasps, from samples to any grasp.

Two grasps are as far from each other as the tool has to move between them: its tip
and a point further back, a *lever* away along the approach direction. Lengths and
angles then need no weights, and a flat boundary of the tool against a wall stays flat.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from reachmap._typing import FloatArray

# Width and ridge by the errors on 2,000 random grasps of two deep bins; half or twice
# the width, a third or three times the ridge change them by less than a percent.
WIDTH_SHARE: Final = 0.5
RIDGE: Final = 0.02
ROWS_AT_ONCE: Final = 4096
BLOCK: Final = 128


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GraspRegression:
    """A function of grasps, fitted to samples with values from 0 to 1.

    Far from all samples it tends to one half: it does not know.

    Attributes
    ----------
    nodes : array, shape (n, 6)
        Tip and lever point of each sample [m].
    weights : array, shape (n,)
    lever_m, width_m : float
    """

    nodes: FloatArray
    weights: FloatArray
    lever_m: float
    width_m: float

    @classmethod
    def fit(
        cls, points: FloatArray, axes: FloatArray, values: FloatArray, lever_m: float
    ) -> GraspRegression:
        """Fit samples.

        Parameters
        ----------
        points, axes : array, shape (n, 3)
            Tips [m] and unit approach directions, in any common frame.
        values : array, shape (n,)
        lever_m : float
            From the tip back to where the tool begins [m].
        """
        nodes = tool_points(points, axes, lever_m)
        # The diagonal, were they spread evenly over a box, whichever way it lies.
        extent = float(np.sqrt(12.0 * nodes.var(axis=0).sum()))
        width = WIDTH_SHARE * extent if extent > 0 else 1.0
        kernel = _matern(nodes, nodes, width)
        kernel[np.diag_indices_from(kernel)] += RIDGE
        weights = _solve_positive(kernel, values - 0.5)
        return cls(nodes=nodes, weights=weights, lever_m=lever_m, width_m=width)

    def __call__(self, points: FloatArray, axes: FloatArray) -> FloatArray:
        """Value at grasps, shape (m,); between 0 and 1 but for overshoots."""
        asked = tool_points(points, axes, self.lever_m)
        parts = [
            _matern(asked[k : k + ROWS_AT_ONCE], self.nodes, self.width_m)
            @ self.weights
            for k in range(0, len(asked), ROWS_AT_ONCE)
        ]
        return 0.5 + np.concatenate([np.zeros(0), *parts])


def tool_points(points: FloatArray, axes: FloatArray, lever_m: float) -> FloatArray:
    """Tip and lever point of grasps, shape (n, 6) [m]."""
    return np.hstack([points, points - lever_m * axes])


def _matern(a: FloatArray, b: FloatArray, width: float) -> FloatArray:
    """Matérn kernel of smoothness 3/2, shape (n, m)."""
    # In place: fresh arrays of this size cost more than what is computed in them.
    r = a @ b.T
    r *= -2.0
    r += (a**2).sum(axis=1)[:, None]
    r += (b**2).sum(axis=1)
    np.maximum(r, 0.0, out=r)
    np.sqrt(r, out=r)
    r *= np.sqrt(3.0) / width
    decay = np.exp(-r)
    r += 1.0
    r *= decay
    return np.asarray(r, float)


def _solve_positive(A: FloatArray, b: FloatArray) -> FloatArray:
    """Solve a symmetric positive definite system (n, n), by Cholesky's factors.

    A fifth of the work of a general solver, and SciPy's takes longer to import.
    """
    L = np.linalg.cholesky(A)
    x = b.copy()
    starts = range(0, len(b), BLOCK)
    for k in starts:
        part = slice(k, k + BLOCK)
        x[part] -= L[part, :k] @ x[:k]
        x[part] = np.linalg.solve(L[part, part], x[part])
    for k in reversed(starts):
        part, rest = slice(k, k + BLOCK), slice(k + BLOCK, None)
        x[part] -= L[rest, part].T @ x[rest]
        x[part] = np.linalg.solve(L[part, part].T, x[part])
    return x
