"""A scan configuration that sees the whole bin, and from which paths are short."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.scene import Scene
from reachmap.core.sight import Camera
from reachmap.geometry import inverse_transform
from reachmap.placement.evaluator import Evaluator
from reachmap.placement.exact import PlacedScene, Pose, PoseScore
from reachmap.placement.viewpoints import (
    NOT_SEEN,
    View,
    camera_poses,
    seen_from,
    view_of,
)

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

FINALISTS = 6
APART_RAD = 0.4
EQUAL_POINTS = 0.5
INSET_M = 0.001


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScanChoice:
    """A configuration to image the bin from.

    Attributes
    ----------
    q : array, shape (dof,)
        [rad].
    score : PoseScore
        Of the bin, seen from it.
    is_new : bool
        Whether it was searched for; otherwise it is the cell's own.
    """

    q: FloatArray
    score: PoseScore
    is_new: bool


def can_choose(scene: Scene) -> bool:
    """Whether the cell has a camera that moves with the tool."""
    loaded = scene.loaded
    return loaded.cell.camera is not None and Camera(scene.robot, loaded).is_carried


def choose_scan(
    loaded: LoadedCell, pose: Pose, evaluator: Evaluator
) -> ScanChoice | None:
    """Find the best configuration that images the bin at a pose.

    Candidates see the pick volume from within the camera's range, with nothing in
    between, and are free of collision. Among the few that promise the shortest paths,
    the highest score wins; of scores within half a point the shortest mean path.

    Parameters
    ----------
    loaded : LoadedCell
        With a camera on the tool.
    pose : (x, y, z [m], yaw [rad])
    evaluator : Evaluator

    Returns
    -------
    ScanChoice or None
        None if no configuration images the bin.
    """
    placed = PlacedScene(loaded, pose)
    finalists = list(_finalists(placed))
    if not finalists:
        return None
    found = evaluator.evaluate([pose] * len(finalists), np.array(finalists))
    scored = [
        (e.score, q)
        for e, q in zip(found, finalists, strict=True)
        if e.score is not None
    ]
    if not scored:
        return None
    best = max(score.score for score, _ in scored)
    near = [pair for pair in scored if pair[0].score >= best - EQUAL_POINTS]
    score, q = min(near, key=lambda pair: pair[0].path_length_rad)
    return ScanChoice(q=q, score=score, is_new=True)


def _finalists(placed: PlacedScene) -> Iterator[FloatArray]:
    """Few configurations that image the bin, far from each other, best first."""
    scene = placed.scene
    cell = scene.loaded.cell
    assert cell.camera is not None
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
        if len(chosen) == FINALISTS:
            return


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
