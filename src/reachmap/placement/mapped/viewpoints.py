"""Camera poses above a bin, and how much of it each has in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.cell.model.cell import CameraSpec
from reachmap.geometry import inverse_transform, transform_from_parts

# Poses of the camera around each of nine targets: steps small enough that one sees
# the whole bin where any does, few enough to be solved at once.
DISTANCES = 6
TILTS_DEG = (0.0, 8.0, 16.0)
AZIMUTHS = 8
ROLL_STEP_DEG = 5.0
OFFSETS = (-0.25, 0.0, 0.25)
# Share of the half picture at each edge that is better left free.
BORDER = 0.05
NOT_SEEN = 9
SLACK_M = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What a camera should see, in the bin frame.

    Attributes
    ----------
    volume : array, shape (8, 3)
        Corners of the pick volume: the inner bottom, and the highest layer above it.
    rim : array, shape (4, 3)
        Upper corners of the inner volume.
    """

    volume: FloatArray
    rim: FloatArray


def view_of(inner: tuple[float, float, float], layers: tuple[float, ...]) -> View:
    """Corners of a bin, by its inner size, that its camera should see."""
    x, y, depth = inner
    top = min(max(layers), depth)
    flat = np.array([[sx * x / 2, sy * y / 2] for sx in (-1, 1) for sy in (-1, 1)])

    def at(height: float) -> FloatArray:
        return np.column_stack([flat, np.full(4, height)])

    return View(volume=np.vstack([at(0.0), at(top)]), rim=at(depth))


def camera_poses(view: View, range_m: tuple[float, float]) -> FloatArray:
    """Candidate poses T_bin_camera, shape (n, 4, 4).

    The camera looks at points around the middle of the pick volume, straight down or
    tilted, from distances within its range, at every roll about its axis.
    """
    middle = view.volume.mean(axis=0)
    half = np.ptp(view.volume, axis=0) / 2
    near, far = range_m[0] + half[2], range_m[1] - half[2]
    targets = [middle + half * np.array([u, v, 0.0]) for u in OFFSETS for v in OFFSETS]
    distances = np.linspace(near, far, DISTANCES) if near < far else np.array([near])
    R = _orientations()
    T = transform_from_parts(
        R[:, None, None],
        np.array(targets)[None, :, None] - distances[:, None] * R[:, None, None, :, 2],
    )
    return np.asarray(T.reshape(-1, 4, 4))


def visibility_grades(
    T_bin_camera: FloatArray, view: View, camera: CameraSpec
) -> IntArray:
    """Visibility grade of a bin in each picture, lower is better, shape (n,).

    Parameters
    ----------
    T_bin_camera : array, shape (n, 4, 4)
    view : View
    camera : CameraSpec

    Returns
    -------
    int array
        0: the rim is in the picture too, with a border around it, and every corner of
        the pick volume is in range along its line of sight as well as along the
        optical axis. 1: the same, in range along the axis only. 2 and 3: the same
        without the border. 4 and 5: without the rim.
        :data:`NOT_SEEN`: the pick volume is not in the picture or not in range.
    """
    T_camera_bin = inverse_transform(T_bin_camera)
    volume = _in_camera(T_camera_bin, view.volume)
    rim = _in_camera(T_camera_bin, view.rim)
    near, far = camera.range_m
    depth = volume[..., 2]
    sight = np.linalg.norm(volume, axis=-1)
    near_enough = np.asarray((depth <= far + SLACK_M).all(axis=1), bool)
    far_enough = np.asarray((depth >= near - SLACK_M).all(axis=1), bool)
    usable = _in_picture(volume, camera) & near_enough & far_enough
    bordered, whole = (_in_picture(rim, camera, part) for part in (1.0 - BORDER, 1.0))
    rim_missing = 2 - bordered.astype(int) - whole.astype(int)
    too_far = np.asarray((sight > far + SLACK_M).any(axis=1), int)
    return np.where(usable, 2 * rim_missing + too_far, NOT_SEEN)


def picture_corners(
    T_base_camera: FloatArray, camera: CameraSpec, z_m: float
) -> FloatArray | None:
    """Where the edges of the picture meet a height, in order, shape (4, 2) [m].

    None if the camera does not look down on that height with all its picture.
    """
    u, v = np.tan(np.radians(camera.field_of_view_deg) / 2)
    rays = np.array([[-u, -v, 1.0], [u, -v, 1.0], [u, v, 1.0], [-u, v, 1.0]])
    directions = rays @ T_base_camera[:3, :3].T
    drop = z_m - T_base_camera[2, 3]
    if not (directions[:, 2] * drop > 0).all():
        return None
    reach = drop / directions[:, 2]
    return np.asarray(T_base_camera[:2, 3] + reach[:, None] * directions[:, :2])


def _in_camera(T_camera_bin: FloatArray, points: FloatArray) -> FloatArray:
    """Points (m, 3) in the frames of n cameras, shape (n, m, 3)."""
    R, p = T_camera_bin[:, :3, :3], T_camera_bin[:, :3, 3]
    return np.asarray(points @ np.swapaxes(R, 1, 2) + p[:, None])


def _in_picture(points: FloatArray, camera: CameraSpec, part: float = 1.0) -> BoolArray:
    """Whether all points (n, m, 3) in camera frames are in the picture, (n,).

    ``part`` leaves the edges of the picture out.
    """
    slope = part * np.tan(np.radians(camera.field_of_view_deg) / 2)
    depth = points[..., 2]
    inside = np.abs(points[..., :2]) <= slope * depth[..., None]
    return np.asarray((inside.all(axis=-1) & (depth > 0)).all(axis=1), bool)


def _orientations() -> FloatArray:
    """R_bin_camera of all tilts, azimuths and rolls, straight down first."""
    down = Rotation.from_euler("x", 180, degrees=True)
    angles = np.radians(np.arange(0.0, 360.0, ROLL_STEP_DEG))
    rolls = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0]))
    matrices = []
    for tilt_deg in TILTS_DEG:
        count = AZIMUTHS if tilt_deg else 1
        for azimuth in np.arange(count) * 2 * np.pi / count:
            axis = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
            tilt = Rotation.from_rotvec(np.radians(tilt_deg) * axis)
            matrices.append((tilt * down * rolls).as_matrix())
    return np.concatenate(matrices)
