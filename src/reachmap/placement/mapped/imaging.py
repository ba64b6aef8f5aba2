"""Configurations from which the camera sees the whole bin."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.cell import CameraSpec
from reachmap.core.collision.camera import Camera
from reachmap.core.scene import Scene
from reachmap.geometry import inverse_transform
from reachmap.placement.mapped.viewpoints import (
    NOT_SEEN,
    View,
    camera_poses,
    seen_from,
    view_of,
)

APART_RAD = 0.4
INSET_M = 0.001
UNSEEN = "no scan configuration images the bin"


def can_choose(scene: Scene) -> bool:
    """Whether the cell has a camera that moves with the tool."""
    loaded = scene.loaded
    return loaded.cell.camera is not None and Camera(scene.robot, loaded).is_carried


def imaging_configurations(
    scene: Scene, goals: FloatArray | None = None, frame: IntArray | None = None
) -> Iterator[FloatArray]:
    """Configurations that image the bin, far from each other, most promising first.

    They see the pick volume from within the camera's range, with nothing in between,
    and are free of collision. Where the rim or a line of sight to a corner is missing,
    others come first; then those nearest to the grasps.

    Parameters
    ----------
    scene : Scene
        Of a cell with a camera on the tool, with the bin.
    goals : array, shape (n, dof), optional
        Free configurations at the grasps [rad].
    frame : int array, shape (n,), optional
        Test frame of each, rising.

    Yields
    ------
    array, shape (dof,)
        [rad].
    """
    cell, T_base_bin = scene.loaded.cell, scene.T_base_bin
    assert cell.camera is not None
    view = view_of(cell.bin.inner, cell.bin_scan.layers)
    camera = Camera(scene.robot, scene.loaded)
    T_bin_camera, missing = _views(cell.bin.inner, cell.bin_scan.layers, cell.camera)
    T_base_camera = T_base_bin @ T_bin_camera
    Q, pose = scene.kinematics.solve_many(
        T_base_camera @ inverse_transform(camera.T_tcp_camera),
        windings=False,
        near=scene.scan_configuration,
    )
    free = scene.checker.free_mask(Q)
    Q, pose = Q[free], pose[free]
    corners = _inset(view, T_base_bin)
    chosen: list[FloatArray] = []
    for k in np.lexsort((_farness(Q, goals, frame), missing[pose])):
        q = Q[k]
        if any(np.linalg.norm(q - other) < APART_RAD for other in chosen):
            continue
        if camera.hidden_by(q, T_base_camera[pose[k]], corners):
            continue
        chosen.append(q)
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
    missing = seen_from(T_bin_camera, view, camera)
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


def _inset(view: View, T_base_bin: FloatArray) -> FloatArray:
    """Corners of the pick volume in robot_base, clear of walls and bottom."""
    middle = view.volume.mean(axis=0)
    half = np.maximum(np.abs(view.volume - middle) - INSET_M, INSET_M)
    corners = middle + np.sign(view.volume - middle) * half
    # A pick volume without height is looked at just above the bottom.
    corners[:, 2] = np.maximum(corners[:, 2], INSET_M)
    return np.asarray(corners @ T_base_bin[:3, :3].T + T_base_bin[:3, 3])
