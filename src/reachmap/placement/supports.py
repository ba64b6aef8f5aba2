"""What a bin is to stand on where there is something, and where on it there is room."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from reachmap.cell.bins.support import (
    SLACK_M,
    TOUCH_M,
    TopFace,
    footprint_of_bin,
    support_of,
)
from reachmap.cell.model.cell import Cell
from reachmap.core.collision.bin_fit import BinFit
from reachmap.errors import SettingsError
from reachmap.geometry import yaw_transform
from reachmap.placement.mapped.exact import Pose, bin_at, pose_of_bin
from reachmap.placement.predicted.region import Region

# A face is tried on a grid this wide [m] and at these angles until a bin fits.
STEP_M, YAWS = 0.05, 4


def supports_in(
    cell: Cell, region: Region, faces: Sequence[TopFace], fit: BinFit
) -> tuple[TopFace, ...]:
    """The body that the cell names, else every one that has room for the bin.

    A body that is the frame of a drop-off, a belt say, is for parts, unless the cell's
    own bin stands on it.

    Parameters
    ----------
    cell : Cell
    region : Region
    faces : sequence of TopFace
        In the level frame.
    fit : BinFit

    Raises
    ------
    SettingsError
        The body that the cell names is out of the region.
    """
    low, high = region.low[2] - SLACK_M, region.high[2] + SLACK_M
    within = [face for face in faces if low <= face.z + cell.bin.bottom_m <= high]
    if cell.bin.on is None:
        for_parts = {spec.frame for spec in cell.drop_offs if spec.pose is not None}
        for_parts.discard(
            support_of(cell.bin, yaw_transform(*pose_of_bin(cell)), tuple(faces))
        )
        return tuple(
            face
            for face in within
            if face.name not in for_parts and has_room(cell, region, face, fit)
        )
    named = tuple(face for face in within if face.name == cell.bin.on)
    if not named:
        raise SettingsError(
            f"bin.on: the top of {cell.bin.on!r} is not between the heights that the "
            "map, placement.z and --heights leave"
        )
    return named


def natural_poses(cell: Cell, region: Region, faces: Sequence[TopFace]) -> list[Pose]:
    """Poses that a grid may miss where there is little room.

    That is the pose in the cell, and on each face the middle, along its longest edge
    and across. A bin that stands within :data:`TOUCH_M` of a face is put on it.

    Parameters
    ----------
    cell : Cell
    region : Region
    faces : sequence of TopFace
        In the level frame.
    """
    x, y, z, yaw = pose_of_bin(cell)
    heights = [face.z + cell.bin.bottom_m for face in faces]
    z = next((height for height in heights if abs(height - z) <= TOUCH_M), z)
    found = [(x, y, z, yaw)]
    for face, height in zip(faces, heights, strict=True):
        edges = np.roll(face.polygon, -1, axis=0) - face.polygon
        along = edges[np.linalg.norm(edges, axis=1).argmax()]
        middle = (face.polygon.min(axis=0) + face.polygon.max(axis=0)) / 2
        angle = float(np.arctan2(along[1], along[0]))
        found += [(*middle.tolist(), height, angle + turn) for turn in (0.0, np.pi / 2)]
    return [region.rounded(pose) for pose in found]


def has_room(cell: Cell, region: Region, face: TopFace, fit: BinFit) -> bool:
    """Whether a bin can stand somewhere on a face, within the region."""
    natural = (
        pose
        for pose in natural_poses(cell, region, (face,))
        if not region.outside(np.array(pose))
    )
    return any(
        face.overhang_m(footprint_of_bin(cell.bin, yaw_transform(*pose))) <= SLACK_M
        and fit.contact(bin_at(cell, pose)) is None
        for pose in chain(natural, _grid_on(face, region, face.z + cell.bin.bottom_m))
    )


def _grid_on(face: TopFace, region: Region, z: float) -> Iterator[Pose]:
    """Poses at a height all over a face, as far as the region goes."""
    low = np.maximum(region.low[:2], face.polygon.min(axis=0))
    high = np.minimum(region.high[:2], face.polygon.max(axis=0))
    if (low > high).any():
        return
    x, y = (
        np.linspace(a, b, int(np.ceil((b - a) / STEP_M)) + 1)
        for a, b in zip(low, high, strict=True)
    )
    for yaw in np.linspace(region.low[3], region.high[3], YAWS, endpoint=False):
        for at in np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2):
            yield float(at[0]), float(at[1]), z, float(yaw)
