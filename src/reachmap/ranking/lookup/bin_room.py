"""Whether part and tool have room in the bin, in closed form.

A map says so at its test grasps, and a few millimetres beside one it may be the other
way round: a part that is gripped lower would be inside the bottom, one nearer to the
middle is clear of the wall. So each grasp is asked for itself: no corner of a hull may
be lower than is allowed, and what of it is below the rim must be inside the inner faces
of the walls.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.errors import MapFileError
from reachmap.geometry import (
    axis_rotations,
    axis_vector,
    inverse_transform,
    rotation_between,
    rotation_from_quaternion_wxyz,
    transform_points,
)
from reachmap.maps.records import BinMap
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.queries import pose_matrix

# Turns of the tool that are asked where any will do.
_TURNS = 24
# Grasps looked at together: some hundreds of megabytes for a part of many corners.
_AT_ONCE = 500
_ROUNDING_M = 1e-9
# Corners of a cylinder's end face; inside it, so that what has no room surely has none.
_ROUND = 16


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BinRoom:
    """A bin, and what is to have room in it.

    Attributes
    ----------
    hulls : tuple of array, shape (n, 3)
        Corners of convex bodies in the TCP frame, which move together [m].
    T_bin_base : array, shape (4, 4)
    approach_axis : str
    inner : array, shape (3,)
        Inner x and y at the bottom, and depth [m].
    top : array, shape (2,)
        Inner x and y at the rim [m]; inf where walls are not known, or may be touched.
    wall_m : float
        Thickness of the walls, beyond which there is room again; inf where no hull can
        be on the other side.
    lowest_m, over_rim_m, margin_m : float
        Least height over the bottom, least height over the rim of what is above a
        wall, and least distance to a wall.
    """

    hulls: tuple[FloatArray, ...]
    T_bin_base: FloatArray
    approach_axis: str
    inner: FloatArray
    top: FloatArray
    wall_m: float
    lowest_m: float
    over_rim_m: float
    margin_m: float

    @classmethod
    def for_part(cls, bin_map: BinMap, T_bin_base: FloatArray) -> BinRoom | None:
        """For the part of a map; None where it does not say what the part is."""
        corners = bin_map.part_corners
        if corners is None:
            return None
        with _unreadable_in_a_map():
            cell = json.loads(bin_map.provenance.cell_resolved_json)
            return cls._of(
                cell,
                hulls=(corners,),
                T_bin_base=T_bin_base,
                approach_axis=bin_map.approach_axis,
                walls_known="bin" not in _part_of(cell)["touch"],
                wall_m=np.inf,
                lowest_m=-float(cell["lift"]["contact_allowance_m"]),
                over_rim_m=float(cell["collision"]["safety_margin_m"]),
            )

    @classmethod
    def for_tool(cls, resolved_json: str, T_bin_base: FloatArray) -> BinRoom | None:
        """For the tool of a resolved cell, as far as boxes and cylinders make it up.

        Bodies of other shapes, and the links of the arm, are left out: what has room
        here may still collide, what has none surely does. None of a cell without bin.
        """
        with _unreadable_in_a_map():
            cell = json.loads(resolved_json)
            if cell.get("bin") is None:
                return None
            return cls._of(
                cell,
                hulls=tuple(_tool_hulls(cell)),
                T_bin_base=T_bin_base,
                approach_axis=str(cell["robot"]["tcp"]["approach_axis"]),
                walls_known=True,
                wall_m=float(cell["bin"]["wall"]),
                lowest_m=float(cell["collision"]["safety_margin_m"]),
                # Aslant over the rim the margin may be kept with less.
                over_rim_m=0.0,
            )

    @classmethod
    def _of(
        cls, cell: Mapping[str, Any], *, walls_known: bool, **values: Any
    ) -> BinRoom:
        spec = cell["bin"]
        inner = np.array(spec["inner"], float)
        top = np.array(spec["inner_top"] or inner[:2], float)
        known = walls_known and spec["mesh"] is None
        return cls(
            inner=inner,
            top=top if known else np.full(2, np.inf),
            margin_m=float(cell["collision"]["safety_margin_m"]),
            **values,
        )

    def is_there(self, queries: Queries) -> BoolArray:
        """Whether there is room at each grasp, at any turn of a free roll, (n,)."""
        found = np.zeros(len(queries), bool)
        for begin in range(0, len(queries), _AT_ONCE):
            rows = np.arange(begin, min(begin + _AT_ONCE, len(queries)))
            found[rows] = self._is_there(queries.take(rows))
        return found

    def _is_there(self, queries: Queries) -> BoolArray:
        axis = axis_vector(self.approach_axis)
        R_given = rotation_from_quaternion_wxyz(queries.quaternions)
        R_any = rotation_between(axis, queries.axes)
        R_base_tcp = np.where(queries.free[:, None, None], R_any, R_given)
        R_bin_base, shift = self.T_bin_base[:3, :3], self.T_bin_base[:3, 3]
        place = queries.points @ R_bin_base.T + shift
        turns = axis_rotations(
            self.approach_axis, 2.0 * np.pi * np.arange(_TURNS) / _TURNS
        )
        found = np.zeros(len(queries), bool)
        for turn, R_turn in enumerate(turns):
            asked = np.flatnonzero(~found & (queries.free | (turn == 0)))
            if not len(asked):
                break
            R_tcp_bin = (R_bin_base @ R_base_tcp[asked] @ R_turn).transpose(0, 2, 1)
            holds = np.ones(len(asked), bool)
            for hull in self.hulls:
                left = np.flatnonzero(holds)
                corners = hull @ R_tcp_bin[left] + place[asked[left], None]
                holds[left] = self._holds(corners)
            found[asked] = holds
        return found

    def _holds(self, corners: FloatArray) -> BoolArray:
        """Whether the bin has room for hulls with corners (m, n, 3) in its frame."""
        z, depth = corners[..., 2], float(self.inner[2])
        limit = depth + self.over_rim_m
        inside = np.ones(len(corners), bool)
        outside = np.zeros(len(corners), bool)
        for axis, (low, high) in enumerate(zip(self.inner, self.top, strict=False)):
            if np.isinf(high):
                continue
            # Inner faces that lean are planes, too: linear in x or y, and in z.
            half = 0.5 * (low + (high - low) * z / depth) - self.margin_m
            for sign in (1.0, -1.0):
                beyond = sign * corners[..., axis] - half
                inside &= _greatest_below(beyond, z, limit) <= 0.0
                if np.isfinite(self.wall_m):
                    far = self.wall_m + 2.0 * self.margin_m
                    outside |= _greatest_below(-beyond, z, limit) <= -far
        high_enough = z.min(axis=1) >= self.lowest_m - _ROUNDING_M
        return np.asarray((inside & high_enough) | outside)


def _tool_hulls(cell: Mapping[str, Any]) -> Iterator[FloatArray]:
    """Corners of the boxes and cylinders on the tool's link, in the TCP frame."""
    tcp = cell["robot"]["tcp"]
    T_tcp_link = inverse_transform(pose_matrix(tcp))
    for body in cell["bodies"]:
        if body["attach_to"] != tcp["parent"]:
            continue
        if any(name.startswith("bin") for name in body["touch"]):
            continue
        corners = _corners_of(body["shape"])
        if corners is not None:
            T = T_tcp_link @ pose_matrix(body["pose"])
            yield transform_points(T, corners)


def _corners_of(shape: Mapping[str, Any]) -> FloatArray | None:
    """Corners (n, 3) of a box or a cylinder about its centre; None of other shapes."""
    if shape["box"] is not None:
        signs = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij"), axis=-1)
        return np.asarray(signs.reshape(-1, 3) * np.array(shape["box"], float))
    if shape["cylinder"] is None:
        return None
    radius, length = (float(shape["cylinder"][k]) for k in ("radius", "length"))
    angle = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    ends = [np.full(_ROUND, sign * length / 2) for sign in (-1.0, 1.0)]
    return np.vstack([np.column_stack([ring, end]) for end in ends])


@contextmanager
def _unreadable_in_a_map() -> Iterator[None]:
    try:
        yield
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise MapFileError(f"the cell in the bin map is unreadable: {error}") from None


def _part_of(cell: Mapping[str, Any]) -> Mapping[str, Any]:
    """The part of a resolved cell: its own, one of several by name, or the first."""
    part, parts = cell["part"], cell["parts"]
    if isinstance(part, dict):
        return part
    return dict(parts[part or next(iter(parts))])


def _greatest_below(values: FloatArray, z: FloatArray, limit: float) -> FloatArray:
    """Greatest of a linear function on each hull, of what is not above a height.

    Parameters
    ----------
    values, z : array, shape (m, n)
        The function and the height at the corners of m hulls.
    limit : float

    Returns
    -------
    array, shape (m,)
        -inf where the whole hull is above.
    """
    below = z <= limit
    greatest = np.where(below, values, -np.inf).max(axis=1)
    for row in np.flatnonzero(below.any(axis=1) & ~below.all(axis=1)):
        # Where edges cross the height; other pairs of corners cross it inside.
        under, over = below[row], ~below[row]
        share = (limit - z[row, under, None]) / (z[row, over] - z[row, under, None])
        start = values[row, under, None]
        crossed = start + share * (values[row, over] - start)
        greatest[row] = max(greatest[row], float(crossed.max()))
    return np.asarray(greatest)
