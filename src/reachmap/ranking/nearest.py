"""The nearest test points of grasps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from reachmap._typing import FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Importing scipy's k-d tree takes half a second, comparing this many pairs of points
# a few milliseconds: a single command that ranks one image never needs the tree.
FEW_PAIRS: Final = 100_000


class NearestPoints:
    """Test points to be searched, from several threads if need be.

    Few pairs are compared one by one, many are looked up in a k-d tree, which is built
    when it is first needed.

    Parameters
    ----------
    points : array, shape (p, 3)
        [m].
    """

    def __init__(self, points: FloatArray) -> None:
        self._points = points
        self._tree: cKDTree | None = None

    def query(self, points: FloatArray, k: int) -> tuple[FloatArray, IntArray]:
        """Distances [m] and numbers of the k nearest, nearest first, shapes (n, k).

        Fewer columns when there are fewer points. The order of points at the same
        distance means nothing.
        """
        k = min(k, len(self._points))
        if len(points) * len(self._points) <= FEW_PAIRS and self._tree is None:
            return self._compared(points, k)
        distance, index = self._grown_tree().query(points, k=k)
        return distance.reshape(-1, k), np.asarray(index, np.int64).reshape(-1, k)

    def _compared(self, points: FloatArray, k: int) -> tuple[FloatArray, IntArray]:
        away = points[:, None] - self._points
        square = np.einsum("nkc,nkc->nk", away, away)
        index = np.argpartition(square, k - 1, axis=1)[:, :k]
        near = np.take_along_axis(square, index, axis=1)
        order = np.argsort(near, axis=1, kind="stable")
        distance = np.sqrt(np.take_along_axis(near, order, axis=1))
        return distance, np.take_along_axis(index, order, axis=1)

    def _grown_tree(self) -> cKDTree:
        if self._tree is None:
            from scipy.spatial import cKDTree

            self._tree = cKDTree(self._points)
        return self._tree
