"""Test frames of a map as a table of poses, and the poses that two maps share."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.cell.model.fields import PoseSpec
from reachmap.errors import SettingsError
from reachmap.geometry import (
    inverse_transform,
    rotation_from_quaternion_wxyz,
    transform_points,
)
from reachmap.maps.parts import freeze
from reachmap.maps.records import BinMap, Status, WorkspaceMap

Frame: TypeAlias = Literal["robot_base", "bin", "world"]

# Above the rounding of files, far below any spacing of frames.
TOLERANCE_M = 1e-4
TOLERANCE_DEG = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameTable:
    """Test frames of a map that were attempted, one per row; each pose once.

    Attributes
    ----------
    position : array, shape (n, 3)
        In the frame that poses are matched in [m].
    rotation : array, shape (n, 3, 3)
        TCP orientation in that frame.
    square : array, shape (n, 3)
        x, y, z of the square that the frame belongs to [m]: of the lattice in
        robot_base for a workspace map, of the grid in the bin frame for a bin map.
    status : uint8 array, shape (n,)
    blocking_pair : int array, shape (n,)
    path_length_rad : array, shape (n,)
        Mean over the attempts that found a path [rad], NaN without one.
    """

    position: FloatArray
    rotation: FloatArray
    square: FloatArray
    status: CodeArray
    blocking_pair: IntArray
    path_length_rad: FloatArray

    def __post_init__(self) -> None:
        freeze(self)

    def __len__(self) -> int:
        return len(self.status)

    def rows(self, chosen: IntArray) -> FrameTable:
        """Some rows, in the order given."""
        return FrameTable(
            **{name: getattr(self, name)[chosen] for name in FrameTable.__slots__}
        )


def frame_table(
    record: WorkspaceMap | BinMap,
    frame: Frame = "robot_base",
    tolerance_m: float = TOLERANCE_M,
    tolerance_deg: float = TOLERANCE_DEG,
) -> FrameTable:
    """List the test frames of a map that were attempted.

    Poses that occur more than once, as on the row that two cubes share, are listed
    once, with a path if one of them has a path.

    Parameters
    ----------
    record : WorkspaceMap or BinMap
    frame : {"robot_base", "bin", "world"}
        Where poses are given; "bin" is for bin maps only.
    tolerance_m, tolerance_deg : float
        Poses closer than this are the same [m, deg].
    """
    parts = (
        [_bin_part(record, frame)]
        if isinstance(record, BinMap)
        else _cube_parts(record)
    )
    if frame == "world":
        parts = [_in_world(part, record) for part in parts]
    table = FrameTable(
        **{
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in FrameTable.__slots__
        }
    )
    known = ~np.isin(table.status, [Status.NOT_ATTEMPTED, Status.ERROR])
    reachable = table.status == Status.PATH_FOUND
    # Reachable frames first: of equal poses, the first row stays.
    order = np.flatnonzero(known)[np.argsort(~reachable[known], kind="stable")]
    table = table.rows(order)
    key = _key(table, tolerance_m, tolerance_deg)
    pairs = cKDTree(key).query_pairs(1.0, output_type="ndarray")
    return table.rows(
        np.setdiff1d(np.arange(len(table)), pairs.max(axis=1, initial=-1))
    )


def match_frames(
    a: FrameTable,
    b: FrameTable,
    tolerance_m: float = TOLERANCE_M,
    tolerance_deg: float = TOLERANCE_DEG,
) -> tuple[IntArray, IntArray]:
    """Rows of the frames that both tables have.

    Returns
    -------
    in_a, in_b : int array, shape (matches,)
        Each row at most once; position and angle both lie within their tolerance.
    """
    if not len(a) or not len(b):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    tree = cKDTree(_key(b, tolerance_m, tolerance_deg))
    reach = np.sqrt(2.0) * (1.0 + 1e-9)
    _, nearest = tree.query(
        _key(a, tolerance_m, tolerance_deg), distance_upper_bound=reach
    )
    in_a = np.flatnonzero(nearest < len(b))
    in_b = np.asarray(nearest[in_a])
    close = _within(a.rows(in_a), b.rows(in_b), tolerance_m, tolerance_deg)
    in_a, in_b = in_a[close], in_b[close]
    _, first = np.unique(in_b, return_index=True)
    first.sort()
    return in_a[first], in_b[first]


def _key(table: FrameTable, tolerance_m: float, tolerance_deg: float) -> FloatArray:
    """Poses as points in 12 dimensions, one unit apart at either tolerance.

    Rotation matrices serve, since they have no two signs as quaternions do; their
    Frobenius distance is √2 times a small angle.
    """
    turn = table.rotation.reshape(-1, 9) / (np.sqrt(2.0) * np.radians(tolerance_deg))
    return np.concatenate([table.position / tolerance_m, turn], axis=1)


def _within(
    a: FrameTable, b: FrameTable, tolerance_m: float, tolerance_deg: float
) -> FloatArray:
    apart = np.linalg.norm(a.position - b.position, axis=1)
    turned = np.linalg.norm(a.rotation - b.rotation, axis=(1, 2)) / np.sqrt(2.0)
    slack = 1.0 + 1e-9
    return np.asarray(
        (apart <= tolerance_m * slack) & (turned <= np.radians(tolerance_deg) * slack)
    )


def _cube_parts(record: WorkspaceMap) -> Sequence[FrameTable]:
    parts = []
    for cube in record.cubes.values():
        z, y, x = np.meshgrid(cube.z, cube.y, cube.x, indexing="ij")
        count = cube.status.shape[-1]
        points = np.stack([x, y, z], axis=-1).reshape(-1, 3).repeat(count, axis=0)
        R = rotation_from_quaternion_wxyz(cube.quaternion_wxyz)
        parts.append(
            FrameTable(
                position=points,
                rotation=np.tile(R, (points.shape[0] // count, 1, 1)),
                square=points,
                status=cube.status.ravel(),
                blocking_pair=cube.blocking_pair.ravel(),
                path_length_rad=cube.path_length.ravel(),
            )
        )
    return parts


def _in_world(part: FrameTable, record: WorkspaceMap | BinMap) -> FrameTable:
    """The same frames in the world; squares of a workspace are, too."""
    T = T_world_base_of(record)
    position = transform_points(T, part.position)
    return dataclasses.replace(
        part,
        position=position,
        rotation=T[:3, :3] @ part.rotation,
        square=part.square if isinstance(record, BinMap) else position,
    )


def T_world_base_of(record: WorkspaceMap | BinMap) -> FloatArray:  # noqa: N802
    """robot_base of a map's cell in the world, shape (4, 4).

    Raises
    ------
    SettingsError
        The map does not tell.
    """
    if record.T_world_base is not None:
        return record.T_world_base
    try:
        cell = json.loads(record.provenance.cell_resolved_json)
        return PoseSpec.model_validate(cell["robot"]["base_pose"]).matrix()
    except (ValueError, KeyError, TypeError, RecursionError):
        raise SettingsError(
            "a map does not say where its robot is in the world; compare it in "
            "robot_base or bin"
        ) from None


def _bin_part(record: BinMap, frame: Frame) -> FrameTable:
    count = record.status.shape[-1]
    position = record.position.reshape(-1, 3).repeat(count, axis=0)
    R = rotation_from_quaternion_wxyz(record.quaternion_wxyz.reshape(-1, 4))
    if frame == "bin":
        T_bin_base = inverse_transform(record.bin_pose)
        position = transform_points(T_bin_base, position)
        R = T_bin_base[:3, :3] @ R
    z, y, x = np.meshgrid(record.layer, record.y, record.x, indexing="ij")
    square = np.stack([x, y, z], axis=-1).reshape(-1, 3).repeat(count, axis=0)
    found = record.path_found == 1
    total = np.where(found, record.path_length, 0.0).sum(axis=-1)
    mean = np.full(total.shape, np.nan)
    np.divide(total, found.sum(axis=-1), out=mean, where=found.any(axis=-1))
    return FrameTable(
        position=position,
        rotation=R,
        square=square,
        status=record.status.ravel(),
        blocking_pair=record.blocking_pair.ravel(),
        path_length_rad=mean.ravel(),
    )
