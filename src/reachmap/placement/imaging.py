"""Configurations from which the camera sees the whole bin."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.scene import Scene
from reachmap.core.sight import Camera
from reachmap.geometry import inverse_transform
from reachmap.placement.exact import PlacedScene
from reachmap.placement.viewpoints import (
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


def imaging_configurations(placed: PlacedScene) -> Iterator[FloatArray]:
    """Configurations that image the bin, far from each other, most promising first.

    They see the pick volume from within the camera's range, with nothing in between,
    and are free of collision. Where the rim or a line of sight to a corner is missing,
    others come first; then those nearest to the grasps.

    Parameters
    ----------
    placed : PlacedScene
        Of a cell with a camera on the tool.

    Yields
    ------
    array, shape (dof,)
        [rad].
    """
    scene = placed.scene
    cell = scene.loaded.cell
    assert cell.camera is not None
    scene.checker.reset()
    view = view_of(cell.bin, cell.bin_scan.layers)
    camera = Camera(scene.robot, scene.loaded)
    T_bin_camera = camera_poses(view, cell.camera.range_m)
    missing = seen_from(T_bin_camera, view, cell.camera)
    rows = np.flatnonzero(missing < NOT_SEEN)
    T_base_camera = scene.T_base_bin @ T_bin_camera[rows]
    Q, pose = scene.kinematics.solve_many(
        T_base_camera @ inverse_transform(camera.T_tcp_camera), windings=False
    )
    free = scene.checker.free_mask(Q)
    Q, pose = Q[free], pose[free]
    corners = _inset(view, scene.T_base_bin)
    chosen: list[FloatArray] = []
    for k in _order(placed, Q, missing[rows][pose]):
        q = Q[k]
        if any(np.linalg.norm(q - other) < APART_RAD for other in chosen):
            continue
        if camera.hidden_by(q, T_base_camera[pose[k]], corners):
            continue
        chosen.append(q)
        yield q


def _order(placed: PlacedScene, Q: FloatArray, missing: IntArray) -> IntArray:
    """Rows of Q: those that miss least first, then by nearness to the grasps.

    Nearness is the mean over test frames of the straight distance to the nearest
    grasp, which no path can undercut.
    """
    goals, frame = placed.Q, placed.frame
    if not len(goals) or not len(Q):
        return np.argsort(missing, kind="stable")
    begins = np.flatnonzero(np.r_[True, np.diff(frame) > 0])
    nearness = np.array(
        [
            np.minimum.reduceat(np.linalg.norm(goals - q, axis=1), begins).mean()
            for q in Q
        ]
    )
    return np.lexsort((np.round(nearness, 6), missing))


def _inset(view: View, T_base_bin: FloatArray) -> FloatArray:
    """Corners of the pick volume in robot_base, clear of walls and bottom."""
    middle = view.volume.mean(axis=0)
    half = np.maximum(np.abs(view.volume - middle) - INSET_M, INSET_M)
    corners = middle + np.sign(view.volume - middle) * half
    # A pick volume without height is looked at just above the bottom.
    corners[:, 2] = np.maximum(corners[:, 2], INSET_M)
    return np.asarray(corners @ T_base_bin[:3, :3].T + T_base_bin[:3, 3])
