"""A grasp list as arrays: metres, unit vectors, rotation matrices."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.geometry import (
    approach_directions,
    nearest_rotation,
    rotation_from_quaternion_wxyz,
    transform_from_parts,
)
from reachmap.maps.bytes.to_json import json_ready
from reachmap.ranking.lists.document import LENGTH_UNITS
from reachmap.ranking.lists.fields import NUMBER_KEYS, ORIENTATIONS


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspList:
    """Grasps in the frame of their document. Row order is the supplied order.

    Attributes
    ----------
    document : mapping
        The native document, without results of an earlier ranking.
    source : str
        Where it was read from.
    frame : str
        Frame of everything below.
    T_frame_bin : array, shape (4, 4), or None
        Pose of the bin when the grasps were made.
    points : array, shape (n, 3)
        Grasp points [m].
    directions : array, shape (n, 3)
        Unit approach directions, into the object.
    rotations : array, shape (n, 3, 3)
        Orientations as given, NaN where only a direction is.
    approach_axis : str
        Axis of ``rotations`` that approaches.
    has_rotation : bool array, shape (n,)
    scores : array, shape (n,)
        NaN where there is none.
    quadrants : tuple of str or None
    ids : tuple of str
        ``#k`` where the k-th grasp has no id, from 1.
    warnings : tuple of str
    """

    document: Mapping[str, Any]
    source: str
    frame: str
    T_frame_bin: FloatArray | None
    points: FloatArray
    directions: FloatArray
    rotations: FloatArray
    approach_axis: str
    has_rotation: BoolArray
    scores: FloatArray
    quadrants: tuple[str | None, ...]
    ids: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.ids)


def arrays_from_document(
    document: Mapping[str, Any],
    source: str,
    warnings: Sequence[str],
    invalid: Collection[object] | None = None,
) -> GraspList:
    """Convert a checked document to arrays, in metres and unit vectors.

    Rows that are ``invalid`` become NaN; what is not finite is null where the document
    is written again.
    """
    grasps: list[dict[str, Any]] = document["grasps"]
    if invalid is not None:
        document = json_ready(document)
        grasps = [
            _without_pose(grasp) if row in invalid else grasp
            for row, grasp in enumerate(grasps)
        ]
    scale = LENGTH_UNITS[document.get("units", {}).get("length", "m")]
    axis = document.get("approach_axis", "+z")
    rotations = _rotations(grasps)
    has_rotation = np.isfinite(rotations[:, 0, 0])
    outward = document.get("direction_convention", "approach") == "outward_normal"
    given = _directions(grasps) * (-1.0 if outward else 1.0)
    own = approach_directions(rotations, axis)
    directions = np.where(has_rotation[:, None], own, given)
    bin_pose = document.get("bin_pose")
    return GraspList(
        document=document,
        source=source,
        frame=document["frame"],
        T_frame_bin=None if bin_pose is None else _pose(bin_pose, scale),
        points=_rows([g["position"] for g in grasps], 3) * scale,
        directions=directions,
        rotations=rotations,
        approach_axis=axis,
        has_rotation=has_rotation,
        scores=_rows([[_score(g)] for g in grasps], 1)[:, 0],
        quadrants=tuple(g.get("quadrant") for g in grasps),
        ids=tuple(str(g.get("id", f"#{n}")) for n, g in enumerate(grasps, 1)),
        warnings=tuple(warnings),
    )


def _without_pose(grasp: Mapping[str, Any]) -> dict[str, Any]:
    """An invalid grasp: NaN for its position and direction, and no score."""
    nowhere = 3 * [np.nan]
    rest = {key: value for key, value in grasp.items() if key not in NUMBER_KEYS}
    return {**rest, "position": nowhere, "direction": nowhere}


def _rows(values: list[Any], width: int) -> FloatArray:
    return np.array(values, dtype=float).reshape(len(values), width)


def _score(grasp: Mapping[str, Any]) -> float:
    score = grasp.get("score")
    return np.nan if score is None else float(score)


def _directions(grasps: list[dict[str, Any]]) -> FloatArray:
    """Return unit vectors, shape (n, 3); zero where a full orientation is given."""
    V = _rows([g.get("direction", (0.0, 0.0, 0.0)) for g in grasps], 3)
    # Scaled first: squares of very large or small components would over- or underflow.
    V = V / np.maximum(np.abs(V).max(axis=1, keepdims=True, initial=0.0), 1e-300)
    length = np.linalg.norm(V, axis=1, keepdims=True)
    return np.asarray(V / np.where(length > 0, length, 1.0))


def _rotations(grasps: Sequence[Mapping[str, Any]]) -> FloatArray:
    """Proper rotations, shape (n, 3, 3); NaN where only a direction is given."""
    R = np.full((len(grasps), 3, 3), np.nan)
    by_form: dict[str, list[int]] = {}
    for n, grasp in enumerate(grasps):
        form = next((form for form in ORIENTATIONS[1:] if form in grasp), None)
        if form is not None:
            by_form.setdefault(form, []).append(n)
    for form, rows in by_form.items():
        values = np.array([grasps[n][form] for n in rows], dtype=float)
        if form == "rotation_matrix":
            R[rows] = nearest_rotation(values)  # printed digits are off a little
        else:
            wxyz = values if form.endswith("wxyz") else np.roll(values, 1, axis=1)
            R[rows] = rotation_from_quaternion_wxyz(wxyz)
    return R


def _pose(pose: Mapping[str, Any], scale: float) -> FloatArray:
    R = _rotations([pose])[0]
    R = np.eye(3) if np.isnan(R[0, 0]) else R
    return transform_from_parts(R, np.array(pose["position"], dtype=float) * scale)
