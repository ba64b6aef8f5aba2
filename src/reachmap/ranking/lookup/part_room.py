"""Whether a gripped part fits in the bin, in closed form.

A map says so at its test grasps, and a few millimetres beside one it may be the other
way round: a part that is gripped lower would be inside the bottom, one nearer to the
middle is clear of the wall. So each grasp is asked for itself: no corner of the part's
hull may be lower than the allowance, and what of it is below the rim must be inside
the inner faces of the walls.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.errors import MapFileError
from reachmap.geometry import (
    axis_rotations,
    axis_vector,
    rotation_from_quaternion_wxyz,
)
from reachmap.maps.records import BinMap
from reachmap.ranking.lookup.approach import rotation_between
from reachmap.ranking.lookup.matching import Queries

# Rolls of the tool that are tried where any is allowed.
_TURNS = 24
# Grasps looked at together: some hundred megabytes for a part of many corners.
_AT_ONCE = 500
_ROUNDING_M = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartRoom:
    """A bin, and the part that is gripped in it.

    Attributes
    ----------
    corners : array, shape (n, 3)
        Of the part's convex hull, in the TCP frame [m].
    T_bin_base : array, shape (4, 4)
    approach_axis : str
    inner : array, shape (3,)
        Inner x and y at the bottom, and depth [m].
    top : array, shape (2,)
        Inner x and y at the rim [m]; inf where walls are not known, or may be touched.
    allowance_m, margin_m : float
        How deep the part may be in the bottom, and its least distance to a wall.
    """

    corners: FloatArray
    T_bin_base: FloatArray
    approach_axis: str
    inner: FloatArray
    top: FloatArray
    allowance_m: float
    margin_m: float

    @classmethod
    def of(cls, bin_map: BinMap, T_bin_base: FloatArray) -> PartRoom | None:
        """Room in the bin of a map; None where the map does not define the part."""
        corners = bin_map.part_corners
        if corners is None:
            return None
        try:
            cell = json.loads(bin_map.provenance.cell_resolved_json)
            spec = cell["bin"]
            inner = np.array(spec["inner"], float)
            known = spec["mesh"] is None and "bin" not in _part_of(cell)["touch"]
            top = np.array(spec["inner_top"] or inner[:2], float)
            return cls(
                corners=corners,
                T_bin_base=T_bin_base,
                approach_axis=bin_map.approach_axis,
                inner=inner,
                top=top if known else np.full(2, np.inf),
                allowance_m=float(cell["lift"]["contact_allowance_m"]),
                margin_m=float(cell["collision"]["safety_margin_m"]),
            )
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise MapFileError(
                f"the cell in the bin map is unreadable: {error}"
            ) from None

    def is_there(self, queries: Queries) -> BoolArray:
        """Whether the part has room at each grasp, at any turn of a free roll, (n,)."""
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
            turned = self.corners @ R_turn.T
            R_bin_tcp = R_bin_base @ R_base_tcp[asked]
            corners = turned @ R_bin_tcp.transpose(0, 2, 1) + place[asked, None]
            found[asked] = self._holds(corners)
        return found

    def _holds(self, corners: FloatArray) -> BoolArray:
        """Whether the bin has room for parts with corners (m, n, 3) in its frame."""
        z, depth = corners[..., 2], float(self.inner[2])
        room = z.min(axis=1) >= -self.allowance_m - _ROUNDING_M
        for axis, (low, high) in enumerate(zip(self.inner, self.top, strict=False)):
            if np.isinf(high):
                continue
            # Inner faces that lean are planes, too: linear in x or y, and in z.
            half = 0.5 * (low + (high - low) * z / depth) - self.margin_m
            for sign in (1.0, -1.0):
                beyond = sign * corners[..., axis] - half
                room &= _greatest_below(beyond, z, depth + self.margin_m) <= 0.0
        return np.asarray(room)


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
