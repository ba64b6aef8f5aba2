"""Grasps from arrays: checked, and told whether their roll counts."""

from __future__ import annotations

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.errors import SettingsError
from reachmap.geometry import quaternion_wxyz_from_rotation
from reachmap.ranking.lookup.approach import axis_vector, complete_rotation
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.settings import Roll
from reachmap.ranking.lookup.table import GraspTable


def queries_from_arrays(
    table: GraspTable,
    points: FloatArray,
    directions: FloatArray | None = None,
    rotations: FloatArray | None = None,
    *,
    roll: Roll = "as-given",
) -> Queries:
    """Check grasps in robot_base and say for each whether its roll counts.

    Parameters
    ----------
    table : GraspTable
        Gives the approach axis of the TCP and the bin's axes.
    points : array, shape (n, 3)
        Grasp points [m].
    directions : array, shape (n, 3), optional
        Approach directions into the object; their length does not matter.
    rotations : array, shape (n, 3, 3), optional
        TCP orientations. A row of NaN has none; its direction counts then.
    roll : {"as-given", "free", "fixed"}
        A direction whose roll is to be fixed gets the orientation of
        :func:`reachmap.ranking.lookup.approach.complete_rotation`.

    Raises
    ------
    SettingsError
        Arrays that do not fit together or are not finite.
    """
    p = _array(points, "points", (3,), None)
    n = len(p)
    if directions is None and rotations is None:
        raise SettingsError("give directions or rotations")
    R = np.full((n, 3, 3), np.nan) if rotations is None else rotations
    R = _array(R, "rotations", (3, 3), n, finite=False)
    known: BoolArray = np.all(np.isfinite(R), axis=(1, 2))
    if known.any():
        _check_rotations(R[known])
    axes = R @ axis_vector(table.approach_axis)
    if not known.all():
        if directions is None:
            raise SettingsError("rotations that are NaN need directions")
        given = _array(directions, "directions", (3,), n, finite=False)
        axes = np.where(known[:, None], axes, _unit(given))
    if not np.isfinite(axes).all():
        raise SettingsError("directions must be finite and longer than 0")
    free: BoolArray = ~known if roll == "as-given" else np.full(n, roll == "free")
    if roll == "fixed" and not known.all():
        R = R.copy()
        R_bin = table.bin_pose[:3, :3]
        R[~known] = complete_rotation(axes[~known], R_bin, table.approach_axis)
    return Queries(points=p, axes=axes, quaternions=_quaternions(R, free), free=free)


def _array(
    value: FloatArray,
    name: str,
    row: tuple[int, ...],
    n: int | None,
    *,
    finite: bool = True,
) -> FloatArray:
    array = np.asarray(value, dtype=float)
    if array.shape == (0,):
        # A network that has found nothing hands over an empty list.
        array = array.reshape(0, *row)
    if array.shape[1:] != row or array.ndim == 0 or (n is not None and len(array) != n):
        wanted = ("n" if n is None else n, *row)
        raise SettingsError(f"{name} must have the shape {wanted} (got {array.shape})")
    if finite and not np.isfinite(array).all():
        raise SettingsError(f"{name} must be finite")
    return array


def _check_rotations(R: FloatArray) -> None:
    skew = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(initial=0.0)
    handed = np.sum(np.cross(R[:, :, 0], R[:, :, 1]) * R[:, :, 2], axis=1)
    if skew > 1e-2 or (handed < 0).any():
        raise SettingsError("rotations must be orthonormal with determinant +1")


def _unit(directions: FloatArray) -> FloatArray:
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    return directions / np.where(length > 0, length, np.nan)


def _quaternions(R: FloatArray, free: BoolArray) -> FloatArray:
    quaternions = np.zeros((len(R), 4))
    quaternions[:, 0] = 1.0
    fixed = ~free
    if fixed.any():
        quaternions[fixed] = quaternion_wxyz_from_rotation(R[fixed])
    return quaternions
