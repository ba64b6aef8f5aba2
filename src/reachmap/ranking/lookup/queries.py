"""Grasps from arrays: checked row by row, with whether their roll is fixed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reachmap._typing import BoolArray, FloatArray
from reachmap.errors import SettingsError
from reachmap.geometry import (
    axis_vector,
    quaternion_wxyz_from_rotation,
    rotation_from_quaternion_wxyz,
)
from reachmap.ranking.lookup.approach import complete_rotation
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.settings import Invalid, Roll
from reachmap.ranking.lookup.table import GraspTable

# Printed matrices have three decimals.
ORTHONORMAL_WITHIN = 1e-2
ROWS_NAMED = 12


def queries_from_arrays(
    table: GraspTable,
    points: ArrayLike,
    directions: ArrayLike | None = None,
    rotations: ArrayLike | None = None,
    *,
    roll: Roll = "as-given",
    invalid: Invalid = "mark",
) -> Queries:
    """Check grasps in robot_base; determine for each whether its roll is fixed.

    Parameters
    ----------
    table : GraspTable
        Gives the approach axis of the TCP and the bin's axes.
    points : array_like, shape (n, 3)
        Grasp points [m]; a single one may be flat, an empty list has none.
    directions : array_like, shape (n, 3), optional
        Approach directions into the object; their length does not matter.
    rotations : array_like, shape (n, 3, 3), optional
        TCP orientations. A row of NaN has none; its direction counts then.
    roll : {"as-given", "free", "fixed"}
        A direction whose roll is to be fixed gets the orientation of
        :func:`reachmap.ranking.lookup.approach.complete_rotation`.
    invalid : {"mark", "raise"}
        Rows that are not finite, have no direction or no rotation are left out of the
        matching, or named in an error.

    Raises
    ------
    SettingsError
        Arrays whose shapes do not fit together, or rows that are wrong if asked for.
    """
    p = _rows(points, "points", (3,), None)
    n = len(p)
    if directions is None and rotations is None:
        raise SettingsError("give directions or rotations")
    R = np.full((n, 3, 3), np.nan)
    has_rotation: BoolArray = np.zeros(n, bool)
    known: BoolArray = np.zeros(n, bool)
    axes = np.full((n, 3), np.nan)
    if rotations is not None:
        R = _rows(rotations, "rotations", (3, 3), n)
        has_rotation = np.logical_not(np.isnan(R).all(axis=(1, 2)))
        known = _is_rotation(R)
        axes = np.where(known[:, None], R @ axis_vector(table.approach_axis), np.nan)
    if directions is not None:
        given = _unit(_rows(directions, "directions", (3,), n))
        axes = np.where(has_rotation[:, None], axes, given)
    valid: BoolArray = np.isfinite(np.hstack([p, axes])).all(axis=1)
    if invalid == "raise" and not valid.all():
        raise SettingsError(_complaint(np.flatnonzero(~valid).tolist()))
    p, axes = _filled(p, table.points[0], valid), _filled(axes, table.axes[0, 0], valid)
    known = np.logical_and(known, valid)
    as_given: BoolArray = np.logical_not(known)
    free = as_given if roll == "as-given" else np.full(n, roll == "free")
    if roll == "fixed" and not known.all():
        R = R.copy()
        R_bin = table.bin_pose[:3, :3]
        R[~known] = complete_rotation(axes[~known], R_bin, table.approach_axis)
    return Queries(
        points=p, axes=axes, quaternions=_quaternions(R, free), free=free, valid=valid
    )


def rotations_from_quaternions(
    wxyz: ArrayLike | None = None, xyzw: ArrayLike | None = None
) -> FloatArray | None:
    """Rotation matrices (n, 3, 3) of quaternions whose order is named.

    Quaternions need not be of unit length; rows that are none become NaN.
    """
    if wxyz is not None and xyzw is not None:
        raise SettingsError("give quaternions_wxyz or quaternions_xyzw, not both")
    if wxyz is None and xyzw is None:
        return None
    given = xyzw if wxyz is None else wxyz
    name = "quaternions_wxyz" if xyzw is None else "quaternions_xyzw"
    q = _rows([] if given is None else given, name, (4,), None)
    q = q if xyzw is None else np.roll(q, 1, axis=1)
    R = np.full((len(q), 3, 3), np.nan)
    # A row of NaN has no rotation; one that is wrong gets a matrix that is none.
    R[~np.isnan(q).all(axis=1)] = 0.0
    unit = _unit(q)
    good = np.isfinite(unit).all(axis=1)
    R[good] = rotation_from_quaternion_wxyz(unit[good])
    return R


def _rows(
    value: ArrayLike, name: str, row: tuple[int, ...], n: int | None
) -> FloatArray:
    """Array of n rows; one alone may lack its first axis, an empty one its second."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise SettingsError(f"{name} must be an array of numbers") from None
    if array.size == 0 and len(array.shape) <= 1:
        array = array.reshape(0, *row)
    if array.shape == row:
        array = array[None]
    if array.shape[1:] != row or array.ndim == 0 or (n is not None and len(array) != n):
        wanted = ("n" if n is None else n, *row)
        raise SettingsError(f"{name} must have the shape {wanted} (got {array.shape})")
    return array


def _is_rotation(R: FloatArray) -> BoolArray:
    """Which matrices are proper rotations, as printed to three decimals; (n,)."""
    with np.errstate(invalid="ignore"):
        skew = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2), initial=0)
        handed = np.sum(np.cross(R[:, :, 0], R[:, :, 1]) * R[:, :, 2], axis=1)
        return np.asarray((skew <= ORTHONORMAL_WITHIN) & (handed > 0))


def _complaint(rows: list[int]) -> str:
    named = ", ".join(map(str, rows[:ROWS_NAMED]))
    more = f" and {len(rows) - ROWS_NAMED} more" if len(rows) > ROWS_NAMED else ""
    return (
        f"rows {named}{more}: expected finite points, and finite directions longer "
        "than 0 or orthonormal rotations with determinant +1"
    )


def _filled(rows: FloatArray, value: FloatArray, valid: BoolArray) -> FloatArray:
    """Rows with something harmless where they are not valid."""
    return rows if valid.all() else np.where(valid[:, None], rows, value)


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    usable = (length > 0) & np.isfinite(length)
    return np.asarray(vectors / np.where(usable, length, np.nan))


def _quaternions(R: FloatArray, free: BoolArray) -> FloatArray:
    quaternions = np.zeros((len(R), 4))
    quaternions[:, 0] = 1.0
    fixed = ~free
    if fixed.any():
        quaternions[fixed] = quaternion_wxyz_from_rotation(R[fixed])
    return quaternions
