"""The held part as a body of the last joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from reachmap._typing import FloatArray
from reachmap.cell.files.files import body_key
from reachmap.cell.meshes.reading import MeshError, read_mesh
from reachmap.cell.model.shapes import (
    ROUND_STEPS,
    ConvexBody,
    Solid,
    triangles_of,
)
from reachmap.errors import SceneError
from reachmap.geometry import AXES, transform_points

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.cell.model.cell import PartSpec

# Corners of the rings of a swept body, which are around the true circles: 0.5 % more.
_RING_STEPS = 32
# Rounding of an axis that is meant to be the TCP's [m, and 1 less a cosine].
_COAXIAL_M = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeldPart:
    """The part that the tool holds between grasp and release.

    Attributes
    ----------
    solid : Solid
    T_tcp_part : array, shape (4, 4)
    points : array, shape (n, 3)
        Corners of its convex hull in the TCP frame [m].
    touch : tuple of str
        Links and bodies that it may touch.
    is_round : bool
        Whether a turn about the approach axis changes nothing.
    """

    solid: Solid
    T_tcp_part: FloatArray
    points: FloatArray
    touch: tuple[str, ...]
    is_round: bool

    @classmethod
    def of(cls, loaded: LoadedCell) -> HeldPart | None:
        """The part of a cell; None where it has none.

        Raises
        ------
        SceneError
            Its mesh cannot be read.
        """
        held = loaded.cell.held()
        if held is None:
            return None
        key, spec = held
        solid, T = _solid(loaded, key, spec), spec.pose.matrix()
        points = _hull_corners(transform_points(T, triangles_of(solid).vertices))
        column = AXES[loaded.cell.robot.tcp.approach_axis][0]
        is_round = _is_round_about(spec, T, column)
        if spec.yaw == "free" and not is_round:
            points = swept_points(points, column)
            solid, T, is_round = ConvexBody(points=points), np.eye(4), True
        return cls(
            solid=solid,
            T_tcp_part=T,
            points=points,
            touch=spec.touch,
            is_round=is_round,
        )


def _solid(loaded: LoadedCell, key: str, spec: PartSpec) -> Solid:
    mesh = spec.shape.mesh
    if mesh is None:
        return spec.shape
    path = loaded.mesh_paths[body_key(key, mesh.file)]
    try:
        return read_mesh(path.read_bytes(), path.suffix, mesh.scale)
    except (OSError, MeshError) as error:
        raise SceneError(f"part: {path.name} is not a mesh ({error})") from error


def _hull_corners(points: FloatArray) -> FloatArray:
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):  # a flat mesh
        return np.unique(points, axis=0)


def _is_round_about(spec: PartSpec, T_tcp_part: FloatArray, column: int) -> bool:
    """Whether a turn about an axis of the TCP changes nothing."""
    kind, _ = spec.shape.kind()
    aside = np.delete(T_tcp_part[:3, 3], column)
    if np.abs(aside).max() > _COAXIAL_M:
        return False
    turns = kind in ("cylinder", "capsule") and (
        1.0 - abs(T_tcp_part[column, 2]) < _COAXIAL_M
    )
    return kind == "sphere" or turns


def swept_points(points: FloatArray, column: int) -> FloatArray:
    """Corners of a convex body around all turns of points about an axis.

    Parameters
    ----------
    points : array, shape (n, 3)
    column : int
        The axis, through the origin: 0, 1 or 2.

    Returns
    -------
    array, shape (m, 3)
    """
    after, last = (column + 1) % 3, (column + 2) % 3
    along = points[:, column]
    # Where the surface is round its corners are on it, and the faces inside.
    radius = np.hypot(points[:, after], points[:, last]) / np.cos(np.pi / ROUND_STEPS)
    profile = np.column_stack([radius, along])
    mirrored = profile * [-1.0, 1.0]
    hull = ConvexHull(np.concatenate([profile, mirrored]))
    corners = np.array([row for row in hull.points[hull.vertices] if row[0] >= 0])
    angle = 2.0 * np.pi * np.arange(_RING_STEPS) / _RING_STEPS
    ring = corners[:, :1] / np.cos(np.pi / _RING_STEPS)
    swept = np.empty((len(corners), _RING_STEPS, 3))
    swept[..., column] = corners[:, 1:]
    swept[..., after] = ring * np.cos(angle)
    swept[..., last] = ring * np.sin(angle)
    return swept.reshape(-1, 3)
