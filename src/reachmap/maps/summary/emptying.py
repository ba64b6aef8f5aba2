"""How far a bin can be emptied: reachability over the height of the parts in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.model.cell import Cell
from reachmap.geometry import inverse_transform
from reachmap.maps.records import BinMap
from reachmap.maps.summary.directions import mean_of_known, reachability_of_directions

# What stays is said to be in one place if this much of it is.
MOST = 0.6
# Most of a bin is near a wall: "around the walls" also needs this many times as much
# there as elsewhere.
CLEARLY = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EmptyingLevel:
    """One height of the parts in the bin.

    Attributes
    ----------
    height_m, fill : float
        Above the bottom [m], and as a share of the depth.
    frames, directions, points : float
        Test grasps with a path, directions with one for at least one roll, points with
        at least one direction [percent].
    cycle : float or None
        Test grasps with a whole cycle [percent]; None where the map has none.
    """

    height_m: float
    fill: float
    frames: float
    directions: float
    points: float
    cycle: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Emptying:
    """Reachability by height, and the share that remains.

    Attributes
    ----------
    filled : bool
        Whether the parts below each level were an obstacle.
    levels : tuple of EmptyingLevel
        Rising.
    empties_to_m : float or None
        Height to which every point can be picked from the top down; None where even
        the highest level has points without a direction.
    left : float
        Share of a full bin that stays [percent]: at each point everything up to the
        highest level at which no direction is reached.
    where : str
        Where most of that is, as in "along the far wall"; "" where nothing stays.
    """

    filled: bool
    levels: tuple[EmptyingLevel, ...]
    empties_to_m: float | None
    left: float
    where: str

    @property
    def sentence(self) -> str:
        """What remains, as a sentence without full stop."""
        if not self.left:
            low = 1000.0 * self.levels[0].height_m
            return f"empties to {low:.0f} mm, the lowest level, everywhere"
        share = f"{self.left:.0f}" if self.left >= 1 else f"{self.left:.1f}"
        rest = f"the last {share} % remain {self.where}"
        if self.empties_to_m is None:
            return f"no level can be picked everywhere; {rest}"
        return f"empties to {1000.0 * self.empties_to_m:.0f} mm; {rest}"


def emptying_of(record: BinMap) -> Emptying | None:
    """Sum up a bin map by the height of its layers.

    None of a single layer, and of a map that has points which were not tried.
    """
    directions, points = reachability_of_directions(record)
    if len(record.layer) < 2 or np.isnan(points).any():
        return None
    depth = float(record.bin_inner[2])
    cycle = None if record.cycle is None else record.cycle.reachability
    levels = tuple(
        EmptyingLevel(
            height_m=float(height),
            fill=float(height) / depth,
            frames=mean_of_known(record.path_reachability[k]),
            directions=mean_of_known(directions[k]),
            points=mean_of_known(points[k]),
            cycle=None if cycle is None else mean_of_known(cycle[k]),
        )
        for k, height in enumerate(record.layer)
    )
    stuck = points == 0
    whole = np.flatnonzero(stuck.any(axis=(1, 2)))
    lowest = 0 if not len(whole) else int(whole[-1]) + 1
    left = volume_left(stuck, record.layer, depth)
    return Emptying(
        filled=_is_filled(record),
        levels=levels,
        empties_to_m=(
            float(record.layer[lowest]) if lowest < len(record.layer) else None
        ),
        left=100.0 * float(left.mean()),
        where=_place(record, left),
    )


def volume_left(stuck: BoolArray, layer: FloatArray, depth_m: float) -> FloatArray:
    """Share of a full column that remains at each point, (nl, ny, nx) to (ny, nx).

    Parameters
    ----------
    stuck : bool array, shape (nl, ny, nx)
        Levels at which a point cannot be picked; parts below one cannot be got at.
    layer : array, shape (nl,)
        Heights of the levels, each of which stands for the parts nearer to it than to
        the others [m].
    depth_m : float
        Of the bin [m].
    """
    tops = np.append((layer[1:] + layer[:-1]) / 2.0, max(depth_m, float(layer[-1])))
    share = np.append(0.0, tops / tops[-1])
    count = np.arange(1, len(layer) + 1)[:, None, None]
    highest = np.where(stuck, count, 0).max(axis=0)
    return np.asarray(share[highest])


def _is_filled(record: BinMap) -> bool:
    try:
        cell = Cell.model_validate_json(record.provenance.cell_resolved_json)
    except ValidationError:
        return False
    return cell.bin_scan.is_filled


def _place(record: BinMap, left: FloatArray) -> str:
    """Where the remaining parts lie, seen from the robot."""
    total = float(left.sum())
    if total == 0:
        return ""
    x, y = (np.abs(c) / (size / 2.0) for c, size in zip(
        (record.x, record.y), record.bin_inner[:2], strict=False))  # fmt: skip
    by_x = np.broadcast_to(x[None, :], left.shape) >= y[:, None]
    sides = {
        (0, 1): by_x & (record.x > 0)[None, :],
        (0, -1): by_x & (record.x < 0)[None, :],
        (1, 1): ~by_x & (record.y > 0)[:, None],
        (1, -1): ~by_x & (record.y < 0)[:, None],
    }
    shares = {side: float(left[here].sum()) / total for side, here in sides.items()}
    side = max(shares, key=lambda key: shares[key])
    if shares[side] >= MOST:
        return f"along the {wall_name(record, *side)} wall"
    for axis, name in ((0, "x"), (1, "y")):
        if shares[axis, 1] + shares[axis, -1] >= 1.2 * MOST:
            walls = {wall_name(record, axis, s) for s in (1, -1)}
            both = " and ".join(sorted(walls)) if len(walls) > 1 else f"two {name}"
            return f"along the {both} walls"
    edge = np.maximum(
        np.broadcast_to(x[None, :], left.shape),
        np.broadcast_to(y[:, None], left.shape),
    )
    near_walls = (
        edge >= 1.0 - 2.0 / min(left.shape) if min(left.shape) > 2 else edge > 0
    )
    elsewhere = float(left[~near_walls].mean()) if not near_walls.all() else 0.0
    if (
        float(left[near_walls].sum()) >= MOST * total
        and float(left[near_walls].mean()) >= CLEARLY * elsewhere
    ):
        return "around the walls"
    return "all over the bin"


def wall_name(record: BinMap, axis: int, sign: int) -> str:
    """Name of a wall: near and far are those that face the robot and its opposite."""
    towards = inverse_transform(record.bin_pose)[:2, 3]
    along = int(np.argmax(np.abs(towards) / record.bin_inner[:2]))
    if axis != along:
        return f"{'+' if sign > 0 else '-'}{'xy'[axis]}"
    return "near" if sign * towards[axis] > 0 else "far"
