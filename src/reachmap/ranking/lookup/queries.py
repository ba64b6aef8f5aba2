"""Grasps of lists and of arrays, in robot_base and as those of the TCP: queries.

Arrays are checked row by row, and whether the roll of each is fixed is determined. The
grasps of a list come from a frame that stands still in the cell of the map.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from reachmap._typing import BoolArray, FloatArray
from reachmap.errors import GraspListError, MapFileError, SettingsError
from reachmap.geometry import (
    approach_directions,
    axis_vector,
    inverse_transform,
    nearest_rotation,
    quaternion_wxyz_from_rotation,
    rotation_between,
    rotation_from_quaternion_wxyz,
    rotation_from_rpy_deg,
    transform_from_parts,
    transform_points,
)
from reachmap.maps.records import BinMap
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lists.fields import MIN_DIRECTION
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.settings import Invalid, Roll
from reachmap.ranking.lookup.table import GraspTable


def frames_of(bin_map: BinMap) -> dict[str, FloatArray]:
    """Frames that stand still in the cell, as poses in robot_base, (4, 4) each.

    ``bin``, ``robot_base``, ``world``, and the bodies fixed to the world or the base.
    What moves with the arm, the camera for one, has no place without a configuration
    and is not among them.
    """
    try:
        cell = json.loads(bin_map.provenance.cell_resolved_json or "{}")
        frames = _standing_frames(cell)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise MapFileError(f"the cell in the bin map is unreadable: {error}") from None
    return {**frames, "bin": bin_map.bin_pose}


def _standing_frames(cell: Mapping[str, Any]) -> dict[str, FloatArray]:
    base_pose = cell.get("robot", {}).get("base_pose")
    T_base_world = inverse_transform(pose_matrix(base_pose))
    parents = {"world": T_base_world, "robot_base": np.eye(4)}
    frames = {
        str(body["name"]): parents[body["attach_to"]] @ pose_matrix(body["pose"])
        for body in cell.get("bodies", [])
        if body["attach_to"] in parents
    }
    return {**frames, **parents}


def place_grasps(
    grasps: GraspList,
    frames: Mapping[str, FloatArray],
    tcp_axis: str,
    T_base_frame: FloatArray | None = None,
) -> GraspList:
    """Express grasps in robot_base and as the TCP, for the bin where the map has it.

    Parameters
    ----------
    grasps : GraspList
        With ``T_frame_bin``, the grasps keep their place in the bin and move with it
        from where it was to where it is; their frame may then have any name.
    frames : mapping
        Poses in robot_base, as :func:`frames_of` returns them.
    tcp_axis : str
        TCP axis that approaches, as the map has it.
    T_base_frame : array, shape (4, 4), optional
        Pose of the grasps' frame in robot_base, for frames the cell does not know.

    Raises
    ------
    GraspListError
        The frame is unknown, or it is stated twice and differently.
    """
    T = _frame_pose(grasps, frames, T_base_frame)
    R = T[:3, :3]
    return replace(
        grasps,
        frame="robot_base",
        T_frame_bin=None,
        points=transform_points(T, grasps.points),
        directions=grasps.directions @ R.T,
        rotations=tcp_rotation(R @ grasps.rotations, grasps.approach_axis, tcp_axis),
        approach_axis=tcp_axis,
    )


def _frame_pose(
    grasps: GraspList,
    frames: Mapping[str, FloatArray],
    T_base_frame: FloatArray | None,
) -> FloatArray:
    if grasps.T_frame_bin is not None:
        if T_base_frame is not None:
            raise GraspListError(
                f"{grasps.source}: the list has a bin_pose, which places it; a pose of "
                "its frame besides would contradict it"
            )
        is_bin = grasps.frame == "bin"
        if is_bin and not np.allclose(grasps.T_frame_bin, np.eye(4), atol=1e-9):
            raise GraspListError(
                f"{grasps.source}: bin_pose: in the frame 'bin' the bin is at the "
                "origin; name the frame the bin_pose was measured in, or leave it out"
            )
        return frames["bin"] @ inverse_transform(grasps.T_frame_bin)
    if T_base_frame is not None:
        known_pose = frames.get(grasps.frame, T_base_frame)
        if not np.allclose(known_pose, T_base_frame, atol=1e-6):
            raise GraspListError(
                f"{grasps.source}: frame: {grasps.frame!a} is known to the map's cell, "
                "and the pose that is given for it is another; give the list the name "
                "of the frame that it is in"
            )
        return T_base_frame
    if grasps.frame not in frames:
        known = ", ".join(sorted(frames))
        raise GraspListError(
            f"{grasps.source}: frame: {grasps.frame!a} is none of those that stand "
            f"still in the map's cell ({known}); give its pose with --frame-pose, or "
            "the list a bin_pose"
        )
    return frames[grasps.frame]


def pose_matrix(pose: Mapping[str, Any] | None) -> FloatArray:
    """Read a pose of the resolved cell, shape (4, 4)."""
    if not pose:
        return np.eye(4)
    if pose.get("quaternion_wxyz") is not None:
        R = rotation_from_quaternion_wxyz(np.array(pose["quaternion_wxyz"], float))
    else:
        R = rotation_from_rpy_deg(np.array(pose.get("rpy_deg") or (0, 0, 0), float))
    return transform_from_parts(R, np.array(pose.get("xyz", (0, 0, 0)), float))


def tcp_rotation(R: FloatArray, grasp_axis: str, tcp_axis: str) -> FloatArray:
    """Orientation of the TCP for a grasp whose approach is another tool axis.

    The TCP frame is turned by the smallest rotation so that its own approach axis
    takes the place of the grasp's; the axis perpendicular to both stays. From
    ``+x`` (GraspNet) to ``+z`` the y axis, along which a gripper closes, is kept.

    Parameters
    ----------
    R : array, shape (..., 3, 3)
        Orientation in the grasp's convention.
    grasp_axis, tcp_axis : str
        Signed axis names: approach axis in either convention.

    Returns
    -------
    array, shape (..., 3, 3)
        ``R`` itself when the conventions agree.
    """
    if grasp_axis == tcp_axis:
        return R
    return np.asarray(
        R @ rotation_between(axis_vector(tcp_axis), axis_vector(grasp_axis))
    )


def complete_rotation(
    directions: FloatArray, R_base_bin: FloatArray, tcp_axis: str
) -> FloatArray:
    """Orientation for a direction whose roll is to be fixed by rule.

    The upright tool of the orientation families, straight down into the bin and
    square to its sides, is turned into the direction by the smallest rotation: where
    a cone family has that direction, this is its roll 0.

    Parameters
    ----------
    directions : array, shape (n, 3)
        Unit approach directions in robot_base.
    R_base_bin : array, shape (3, 3)
    tcp_axis : str

    Returns
    -------
    array, shape (n, 3, 3)
        TCP orientations in robot_base.
    """
    # Imported here: it brings the cell's data model, which ranking does not need.
    from reachmap.sampling.orientations import straight_down_orientation

    R_base_upright = R_base_bin @ straight_down_orientation(tcp_axis)
    return align(R_base_upright, directions, tcp_axis)


def align(R: FloatArray, directions: FloatArray, tcp_axis: str) -> FloatArray:
    """Turn orientations by the smallest rotation so that they approach exactly so.

    Parameters
    ----------
    R : array, shape (3, 3) or (n, 3, 3)
        TCP orientations, for instance those recommended by a ranking.
    directions : array, shape (n, 3)
        Unit approach directions, same frame.
    tcp_axis : str
        TCP axis that points into the object.

    Returns
    -------
    array, shape (n, 3, 3)
    """
    own = approach_directions(R, tcp_axis)
    return np.asarray(rotation_between(own, directions) @ R)


# Printed matrices have three decimals; those of arithmetic are off by far less.
ORTHONORMAL_WITHIN = 1e-2
EXACT_WITHIN = 1e-12
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
        Approach directions into the object, of any length but 0.
    rotations : array_like, shape (n, 3, 3), optional
        TCP orientations, of which the nearest rotations are taken. A row of NaN has
        none; its direction counts then.
    roll : {"as-given", "free", "fixed"}
        A direction whose roll is to be fixed gets the orientation of
        :func:`complete_rotation`.
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
        known, R = _as_rotations(R)
        axes[known] = approach_directions(R[known], table.approach_axis)
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
        R_bin = table.T_base_bin[:3, :3]
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
    array = _numbers(value, name)
    if array.size == 0 and len(array.shape) <= 1:
        array = array.reshape(0, *row)
    if array.shape == row:
        array = array[None]
    if array.shape[1:] != row or array.ndim == 0 or (n is not None and len(array) != n):
        wanted = ("n" if n is None else n, *row)
        raise SettingsError(f"{name} must have the shape {wanted} (got {array.shape})")
    return array


def _numbers(value: ArrayLike, name: str) -> FloatArray:
    """Array of numbers; NaN where one is masked or None."""
    try:
        given: Any = np.ma.asarray(value)
        how = "unsafe" if given.dtype.kind == "O" else "same_kind"
        array: FloatArray = given.astype(float, casting=how).filled(np.nan)
    except (TypeError, ValueError):
        raise SettingsError(f"{name} must be an array of numbers") from None
    return array


def scores_of(scores: ArrayLike | None, n: int) -> FloatArray | None:
    """Check scores of n grasps, NaN where one has none; shape (n,)."""
    if scores is None:
        return None
    array = _numbers(scores, "scores")
    if array.shape != (n,):
        raise SettingsError(f"scores must have the shape ({n},) (got {array.shape})")
    return array


def _as_rotations(R: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Which matrices are rotations, as printed to three decimals, and the nearest."""
    with np.errstate(invalid="ignore", over="ignore"):
        skew = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2), initial=0)
        handed = np.sum(np.cross(R[:, :, 0], R[:, :, 1]) * R[:, :, 2], axis=1)
        known: BoolArray = (skew <= ORTHONORMAL_WITHIN) & (handed > 0)
    rounded = known & (skew > EXACT_WITHIN)
    R = R.copy()
    R[rounded] = nearest_rotation(R[rounded])
    return known, R


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
    """Vectors of length 1; NaN where one has none, or is 0 but for rounding."""
    # Scaled first: squares of very large components would overflow.
    largest = np.abs(vectors).max(axis=1, keepdims=True, initial=0.0)
    usable = (largest >= MIN_DIRECTION) & np.isfinite(largest)
    scaled = vectors / np.where(usable, largest, np.nan)
    return np.asarray(scaled / np.linalg.norm(scaled, axis=1, keepdims=True))


def _quaternions(R: FloatArray, free: BoolArray) -> FloatArray:
    quaternions = np.zeros((len(R), 4))
    quaternions[:, 0] = 1.0
    fixed = ~free
    if fixed.any():
        quaternions[fixed] = quaternion_wxyz_from_rotation(R[fixed])
    return quaternions
