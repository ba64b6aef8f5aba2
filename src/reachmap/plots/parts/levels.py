"""Figures of a workspace map per level: quantities, means, best level and square."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from reachmap._typing import FloatArray
from reachmap.maps.records import WorkspaceMap

Quantity: TypeAlias = Literal["path", "ik", "ik-free", "difference"]
QUANTITIES: tuple[Quantity, ...] = ("path", "ik", "ik-free", "difference")
QUANTITY_NAMES: dict[Quantity, str] = {
    "path": "path reachability",
    "ik": "IK reachability",
    "ik-free": "collision-free IK reachability",
    "difference": "IK minus path reachability",
}


def quantity_values(workspace: WorkspaceMap, quantity: Quantity) -> FloatArray:
    """One quantity on the stitched lattice [percent], shape (nz, ny, nx)."""
    if quantity == "path":
        return workspace.path_reachability
    if quantity == "ik":
        return workspace.ik_reachability
    if quantity == "ik-free":
        return workspace.ik_free_reachability
    return np.asarray(workspace.ik_reachability - workspace.path_reachability)


def best_patch(level: FloatArray, shape: tuple[int, int] = (3, 3)) -> tuple[int, int]:
    """Lower-left square (row, column) of the patch with the highest mean.

    Among equals the one whose surroundings, one square on each side, are best wins.

    Parameters
    ----------
    level : array, shape (ny, nx)
        Percent; a patch with a square that was not attempted does not count.
    shape : (int, int)
        Rows and columns of the patch, cut to the level where it is larger.
    """
    rows, columns = (min(n, size) for n, size in zip(shape, level.shape, strict=True))
    mean = sliding_window_view(level, (rows, columns)).mean(axis=(-1, -2))
    return _first_best(mean, _window_means(level, rows, columns, 1))


def best_square(level: FloatArray) -> tuple[int, int]:
    """Square (row, column) with the highest value.

    Among equals the one whose 3×3 neighbourhood has the highest mean wins, then 5×5,
    so that a 100 % square inside a dense patch beats one at the rim.
    """
    return _first_best(
        level, _window_means(level, 1, 1, 1), _window_means(level, 1, 1, 2)
    )


def _window_means(level: FloatArray, rows: int, columns: int, more: int) -> FloatArray:
    """Means of windows and ``more`` squares round them; squares outside count 0."""
    filled = np.pad(np.nan_to_num(level), more)
    windows = sliding_window_view(filled, (rows + 2 * more, columns + 2 * more))
    return np.asarray(windows.mean(axis=(-1, -2)))


def _first_best(*scores: FloatArray) -> tuple[int, int]:
    """Place of the highest first score; the next scores decide among equals."""
    still_in = np.ones(scores[0].shape, dtype=bool)
    for score in scores:
        # Means of equal numbers may differ in the last bit, which is not a difference.
        rounded = np.where(still_in & ~np.isnan(score), score, -1.0).round(9)
        still_in &= rounded == rounded.max()
    row, column = np.unravel_index(int(still_in.argmax()), still_in.shape)
    return int(row), int(column)


def level_names(z: FloatArray) -> tuple[str, ...]:
    """Heights as ``+0.00``, with as many digits as tell the levels apart.

    Examples
    --------
    >>> level_names(np.array([-0.1, -1e-17, 0.125, 0.13]))
    ('-0.100', '+0.000', '+0.125', '+0.130')
    """
    for digits in (2, 3, 4, 6):
        names = tuple(f"{round(float(value), digits) + 0.0:+.{digits}f}" for value in z)
        if len(set(names)) == len(names):
            break
    return names
