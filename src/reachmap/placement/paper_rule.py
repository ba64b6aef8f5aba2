"""The paper's rule: the best level, then the 100 % point in its densest patch."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.records import WorkspaceMap

# Means of equal percentages differ in the last bits.
TIE_PERCENT = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class LatticePoint:
    """A point of a workspace map by its indices."""

    z: int
    y: int
    x: int


def levels_by_average(percent: FloatArray) -> list[int]:
    """Levels (nz, ny, nx), best average first; points not attempted are left out."""
    attempted = ~np.isnan(percent)
    count = attempted.sum(axis=(1, 2))
    total = np.where(attempted, percent, 0.0).sum(axis=(1, 2))
    mean = np.divide(total, count, out=np.full(len(percent), -1.0), where=count > 0)
    order = np.argsort(-mean, kind="stable")
    return [int(k) for k in order if mean[k] >= 0]


def patch_means(level: FloatArray) -> FloatArray:
    """Mean of the 3×3 neighbourhood of each point (ny, nx).

    What lies outside the map or was not attempted counts as 0: a patch at the edge is
    no denser for being cut off.
    """
    padded = np.pad(np.nan_to_num(level, nan=0.0), 1)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    return np.asarray(windows.mean(axis=(2, 3)))


def points_in_order(level: FloatArray) -> Iterator[tuple[int, int]]:
    """Points (y, x) of a level, in the order in which the rule would take them.

    Patches come densest first. Within a patch the point with the highest percentage
    comes first, of equal ones that with the densest patch of its own.
    """
    own = np.nan_to_num(level, nan=-1.0)
    dense = np.round(patch_means(level) / TIE_PERCENT) * TIE_PERCENT
    ny, nx = level.shape
    seen: set[tuple[int, int]] = set()
    for flat in np.argsort(-dense, axis=None, kind="stable"):
        row, column = divmod(int(flat), nx)
        patch = [
            (y, x)
            for y in range(max(row - 1, 0), min(row + 2, ny))
            for x in range(max(column - 1, 0), min(column + 2, nx))
            if (y, x) not in seen and own[y, x] >= 0
        ]
        for point in sorted(patch, key=lambda p: (-own[p], -dense[p], p)):
            seen.add(point)
            yield point


def choose_by_paper(
    workspace: WorkspaceMap, is_feasible: Callable[[LatticePoint], bool]
) -> LatticePoint | None:
    """Choose a point of the map as the paper does.

    Parameters
    ----------
    workspace : WorkspaceMap
    is_feasible : callable
        Whether the bin can stand on a point. The next point in the order is taken
        if it cannot, and the next level if it can nowhere on this one.

    Returns
    -------
    LatticePoint or None
        None if there is no feasible point.
    """
    percent = workspace.path_reachability
    for z in levels_by_average(percent):
        for y, x in points_in_order(percent[z]):
            point = LatticePoint(z=z, y=y, x=x)
            if is_feasible(point):
                return point
    return None
