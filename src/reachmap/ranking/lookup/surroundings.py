"""Share reached around a grasp: a kernel estimate over nearby test grasps.

The share reached among the orientations near the grasp's own, weighted by a von
Mises-Fisher kernel, is interpolated linearly between the test points around it. Beyond
what the map knows the estimate fades into the share reached in the whole map.
"""

from __future__ import annotations

from itertools import product
from typing import Final

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.geometry import direction_angle
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.table import SAME_AXIS_RAD, GraspTable

# Width of the kernel in spacings of the orientations: a grasp halfway between two of
# them listens to both, one on an orientation hardly to its neighbours.
KERNEL_STEPS: Final = 0.4
# What the whole map counts beside the surroundings, so that no share is exactly 0 or 1.
MAP_WEIGHT: Final = 0.02


class Surroundings:
    """The test grasps of a map as a field that can be evaluated anywhere.

    Parameters
    ----------
    table : GraspTable
    """

    def __init__(self, table: GraspTable) -> None:
        self._table = table
        lattice = table.bin_points.reshape(*table.shape[:3], 3)
        self._coordinates = (table.layers, lattice[0, :, 0, 1], lattice[0, 0, :, 0])
        reached = table.reachable.astype(float)
        axes, any_roll = table.axes, reached
        if table.same_everywhere:
            first, group = _directions(table.axes[0])
            axes = table.axes[:1, first]
            any_roll = np.zeros((len(reached), len(first)))
            np.maximum.at(any_roll.T, group, reached.T)
        self._free = (axes, any_roll)
        self._fixed = (
            table.quaternions[:1] if table.same_everywhere else table.quaternions,
            reached,
        )

    def share_reached(self, queries: Queries) -> FloatArray:
        """Estimate of the share reached around each grasp, in (0, 1); shape (n,).

        Parameters
        ----------
        queries : Queries
            Where the roll is free, a direction counts as reached if one roll is.
        """
        free = queries.free
        if free.all():
            return self._share(queries.points, queries.axes, free=True)
        if not free.any():
            return self._share(queries.points, queries.quaternions, free=False)
        share = np.empty(len(queries))
        share[free] = self._share(queries.points[free], queries.axes[free], free=True)
        share[~free] = self._share(
            queries.points[~free], queries.quaternions[~free], free=False
        )
        return share

    def _share(
        self, points: FloatArray, vectors: FloatArray, *, free: bool
    ) -> FloatArray:
        stored, reached = self._free if free else self._fixed
        spacing = float(self._table.spacing_rad[0 if free else 1])
        corners, weights, far = self._corners(points)
        share, nearest = np.zeros(len(points)), np.full(len(points), -1.0)
        kernel: FloatArray | None = None
        for corner, weight in zip(corners, weights, strict=True):
            if kernel is None or len(stored) > 1:
                cosine = _cosines(vectors, stored, corner, free=free)
                best = cosine.max(axis=1)
                kernel = np.exp(
                    (cosine - best[:, None]) / (KERNEL_STEPS * spacing) ** 2
                )
                kernel /= kernel.sum(axis=1, keepdims=True)
                np.maximum(nearest, best, out=nearest)
            share += weight * np.einsum("ng,ng->n", kernel, reached[corner])
        turned = np.arccos(np.clip(nearest, -1.0, 1.0)) / spacing
        far = far + np.maximum(turned - 0.5, 0.0) ** 2
        trust = (1.0 - MAP_WEIGHT) * np.exp(-0.5 * far)
        estimate = trust * share + (1.0 - trust) * reached.mean()
        # Rounding may leave weights a little above 1 in sum.
        return np.asarray(np.clip(estimate, 0.0, 1.0))

    def _corners(
        self, points: FloatArray
    ) -> tuple[list[IntArray], list[FloatArray], FloatArray]:
        """Test points around each grasp, their weights, and how far off they are.

        The last is the square of the distance beyond the outermost points, in pitches.
        """
        table = self._table
        p = points @ table.T_bin_base[:3, :3].T + table.T_bin_base[:3, 3]
        pitches = (float(table.pitch.max()), float(table.pitch[1]), table.pitch[0])
        low, share, far = [], [], np.zeros(len(p))
        for axis, at, pitch in zip((2, 1, 0), self._coordinates, pitches, strict=True):
            value = p[:, axis]
            inside = np.clip(value, at[0], at[-1])
            far += ((value - inside) / pitch) ** 2
            k = np.clip(np.searchsorted(at, inside) - 1, 0, max(len(at) - 2, 0))
            low.append(k)
            step = at[np.minimum(k + 1, len(at) - 1)] - at[k]
            share.append((inside - at[k]) / np.where(step > 0, step, 1.0))
        corners, weights = [], []
        sides = [(0, 1) if len(at) > 1 else (0,) for at in self._coordinates]
        for upper in product(*sides):
            place = [k + one for k, one in zip(low, upper, strict=True)]
            corners.append(np.ravel_multi_index(place, table.shape[:3]))
            parts = [s if one else 1.0 - s for s, one in zip(share, upper, strict=True)]
            weights.append(np.prod(parts, axis=0))
        return corners, weights, far


def _directions(axes: FloatArray) -> tuple[IntArray, IntArray]:
    """First orientation of each approach direction, and the direction of each."""
    same: BoolArray = direction_angle(axes[:, None], axes[None]) < SAME_AXIS_RAD
    first, group = np.unique(np.argmax(same, axis=1), return_inverse=True)
    return first, group


def _cosines(
    vectors: FloatArray, stored: FloatArray, point: IntArray, *, free: bool
) -> FloatArray:
    """Cosine of φ2 to every orientation of one point each, shape (n, g)."""
    if len(stored) == 1:
        dots = vectors @ stored[0].T
    else:
        dots = np.einsum("nk,ngk->ng", vectors, stored[point])
    # Between quaternions the product is the cosine of half the angle.
    return np.asarray(dots if free else 2.0 * dots**2 - 1.0)
