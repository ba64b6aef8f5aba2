"""Configurations from which the camera sees the whole bin."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import islice

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.cell import CameraSpec, Cell
from reachmap.core.collision.camera import Camera
from reachmap.core.scene import Scene
from reachmap.geometry import inverse_transform
from reachmap.placement.mapped.viewpoints import (
    NOT_SEEN,
    camera_poses,
    view_of,
    visibility_grades,
)

# Configurations nearer than this are the same to a planner.
APART_RAD = 0.4
# Hidden configurations after which a place counts as not imaged: five times the most
# that came before a clear one, over 48 poses in four cells. And how many are looked at
# to say what hides the bin.
MOST_HIDDEN, LOOKS_EXPLAINED = 2000, 200
# Corners of the volume lie in its walls, where no line of sight ends.
INSET_M = 0.001
UNSEEN = "no scan configuration images the bin"
OUT_OF_SIGHT = "the camera does not see the bin"
# Where the arm may wait while a camera that stands takes its picture, besides the
# cell's own scan configuration: that with the first joint turned, and random ones.
PARKING_TURNS_DEG = (30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 135.0, -135.0, 180.0)
PARKING_SAMPLES = 64


def can_choose(scene: Scene) -> bool:
    """Whether configurations can be sought: the camera is on the tool, or stands."""
    loaded = scene.loaded
    if loaded.cell.camera is None:
        return False
    camera = Camera(scene.robot, loaded)
    return camera.is_carried or camera.stands


def still_camera(scene: Scene) -> FloatArray | None:
    """Pose of a camera that is not on the tool, in robot_base (4, 4), or None."""
    if scene.loaded.cell.camera is None:
        return None
    camera = Camera(scene.robot, scene.loaded)
    return None if camera.is_carried else camera.T_base_camera(scene.scan_configuration)


def imaging_configurations(
    scene: Scene, goals: FloatArray | None = None, frame: IntArray | None = None
) -> Iterator[FloatArray]:
    """Configurations that image the bin, far from each other, most promising first.

    The camera sees the pick volume from within its range, with nothing in between, and
    the arm is free of collision. A camera on the tool is moved there: where the rim or
    a line of sight to a corner is missing, others come first; then those nearest to the
    grasps. A camera that stands either sees the bin or does not, and the arm waits
    where it is not in the way: in the cell's own scan configuration if it can.

    Parameters
    ----------
    scene : Scene
        Of a cell with a camera on the tool or one that stands, with the bin.
    goals : array, shape (n, dof), optional
        Free configurations at the grasps [rad].
    frame : int array, shape (n,), optional
        Test frame of each, rising.

    Yields
    ------
    array, shape (dof,)
        [rad].
    """
    camera = Camera(scene.robot, scene.loaded)
    if camera.stands:
        yield from _parking_configurations(scene, camera, goals, frame)
        return
    chosen: list[FloatArray] = []
    hidden = 0
    for q, body in _looks(scene, camera, goals, frame, apart_from=chosen):
        if not body:
            chosen.append(q)
            yield q
            continue
        hidden += 1
        if hidden == MOST_HIDDEN:
            return


def why_unseen(scene: Scene) -> str:
    """Say what keeps a camera on the tool from imaging the bin of a scene.

    Parameters
    ----------
    scene : Scene
        Of a cell with a camera on the tool, with the bin.
    """
    camera = Camera(scene.robot, scene.loaded)
    looks = list(islice(_looks(scene, camera, None, None), LOOKS_EXPLAINED))
    if not looks:
        return "the arm can hold the camera nowhere within its range of the bin"
    hiding = Counter(body for _, body in looks if body)
    if not hiding:
        return ""
    body, count = hiding.most_common(1)[0]
    return f"{body} hides it from {count} of {len(looks)} configurations"


def _looks(
    scene: Scene,
    camera: Camera,
    goals: FloatArray | None,
    frame: IntArray | None,
    apart_from: Sequence[FloatArray] = (),
) -> Iterator[tuple[FloatArray, str]]:
    """Free configurations that face the bin, and which body hides part of it, or "".

    Those that are near to one of ``apart_from``, which may grow, are left out.
    """
    cell = scene.loaded.cell
    assert cell.camera is not None
    T_bin_camera, missing = _views(cell.bin.inner, cell.bin_scan.layers, cell.camera)
    T_base_camera = scene.T_base_bin @ T_bin_camera
    Q, pose = scene.kinematics.solve_many(
        T_base_camera @ inverse_transform(camera.T_tcp_camera),
        windings=False,
        near=scene.scan_configuration,
    )
    is_free = scene.checker.is_free
    if goals is not None:
        # Sorting takes longer than checking where there are goals.
        free = scene.checker.free_mask(Q)
        Q, pose = Q[free], pose[free]
    corners = _corners(scene)
    for k in np.lexsort((_farness(Q, goals, frame), missing[pose])):
        q = Q[k]
        if any(np.linalg.norm(q - other) < APART_RAD for other in apart_from):
            continue
        if goals is None and not is_free(q):
            continue
        yield q, camera.hidden_by(q, T_base_camera[pose[k]], corners)


def picture_of(scene: Scene, q: FloatArray) -> str:
    """Defect of the image that a scene's camera takes of the bin, or "".

    Parameters
    ----------
    scene : Scene
        Of a cell with a camera, with the bin.
    q : array, shape (dof,)
        Where the arm is [rad].
    """
    camera = Camera(scene.robot, scene.loaded)
    T_base_camera = camera.T_base_camera(q)
    if not is_in_picture(scene.loaded.cell, T_base_camera, scene.T_base_bin):
        return OUT_OF_SIGHT
    body = camera.hidden_by(q, T_base_camera, _corners(scene))
    return f"{body} hides part of the bin from the camera" if body else ""


def is_in_picture(
    cell: Cell, T_base_camera: FloatArray, T_base_bin: FloatArray
) -> bool:
    """Whether a camera has the pick volume of a bin in its picture and in its range."""
    assert cell.camera is not None
    view = view_of(cell.bin.inner, cell.bin_scan.layers)
    T_bin_camera = inverse_transform(T_base_bin) @ T_base_camera
    return bool(visibility_grades(T_bin_camera[None], view, cell.camera)[0] < NOT_SEEN)


def _parking_configurations(
    scene: Scene, camera: Camera, goals: FloatArray | None, frame: IntArray | None
) -> Iterator[FloatArray]:
    robot, own = scene.robot, scene.scan_configuration
    T_base_camera = camera.T_base_camera(own)
    if not is_in_picture(scene.loaded.cell, T_base_camera, scene.T_base_bin):
        return
    turned = np.tile(own, (len(PARKING_TURNS_DEG), 1))
    turned[:, 0] += np.radians(PARKING_TURNS_DEG)
    random = np.random.default_rng(scene.loaded.cell.seed)
    others = random.uniform(
        robot.lower_rad, robot.upper_rad, (PARKING_SAMPLES, robot.dof)
    )
    others = np.vstack([turned, others])
    inside = (others >= robot.lower_rad) & (others <= robot.upper_rad)
    others = others[inside.all(axis=1)]
    others = others[np.argsort(_farness(others, goals, frame), kind="stable")]
    Q = np.vstack([own, others])
    corners = _corners(scene)
    for q in Q[scene.checker.free_mask(Q)]:
        if not camera.hidden_by(q, T_base_camera, corners):
            yield q


@lru_cache(maxsize=4)
def _views(
    inner: tuple[float, float, float], layers: tuple[float, ...], camera: CameraSpec
) -> tuple[FloatArray, IntArray]:
    """Camera poses T_bin_camera that see the bin, and what each misses.

    The same wherever the bin stands; there are tens of thousands to choose from.
    """
    view = view_of(inner, layers)
    T_bin_camera = camera_poses(view, camera.range_m)
    missing = visibility_grades(T_bin_camera, view, camera)
    seen = missing < NOT_SEEN
    return T_bin_camera[seen], missing[seen]


def _farness(
    Q: FloatArray, goals: FloatArray | None, frame: IntArray | None
) -> FloatArray:
    """How far each of Q is from the grasps, shape (n,).

    The mean over test frames of the straight distance to the nearest grasp, which no
    path can undercut.
    """
    if goals is None or frame is None or not len(goals):
        return np.zeros(len(Q))
    begins = np.flatnonzero(np.r_[True, np.diff(frame) > 0])
    nearest = [
        np.minimum.reduceat(np.linalg.norm(goals - q, axis=1), begins) for q in Q
    ]
    return np.round([float(distances.mean()) for distances in nearest], 6)


def _corners(scene: Scene) -> FloatArray:
    """Corners of the pick volume in robot_base, clear of walls, bottom and heap."""
    cell, T_base_bin = scene.loaded.cell, scene.T_base_bin
    volume = view_of(cell.bin.inner, cell.bin_scan.layers).volume
    middle = volume.mean(axis=0)
    half = np.maximum(np.abs(volume - middle) - INSET_M, INSET_M)
    corners = middle + np.sign(volume - middle) * half
    # Without height it is looked at just above the bottom, or above what lies there.
    corners[:, 2] = np.maximum(corners[:, 2], cell.bin.heap + INSET_M)
    return np.asarray(corners @ T_base_bin[:3, :3].T + T_base_bin[:3, 3])
