"""Simulated emptying: which parts are picked, which remain, in what order and where."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.records import BinMap
from reachmap.maps.summary.emptying import CLEARLY, wall_name
from reachmap.picking.heap import Heap

Order = Literal["highest", "rank"]

# What stays is said to be in one place if this much of it is; a part within this
# share of the half side of a wall lies along it.
MOST, ALONG = 0.6, 0.6


class Fate(IntEnum):
    """Outcome of a part."""

    PICKED = 0
    UNREACHABLE = 1
    COVERED = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Emptied:
    """A heap after the last pick.

    Attributes
    ----------
    fate : uint8 array, shape (n,)
        :class:`Fate` codes: picked, not reached, or below a part that stays.
    turn : int array, shape (n,)
        Number of the pick, from 0; -1 for what stays.
    """

    fate: CodeArray
    turn: IntArray


def empty_heap(heap: Heap, cost: FloatArray, order: Order = "highest") -> Emptied:
    """Pick what can be picked, one part after the other.

    Parameters
    ----------
    heap : Heap
    cost : array, shape (n,)
        Of picking each part where it lies; infinite where it is not reached.
    order : {"highest", "rank"}
        Of what lies free: the highest first, or the cheapest.
    """
    count = len(heap)
    waiting = np.array([len(parts) for parts in heap.above], np.int64)
    below: list[list[int]] = [[] for _ in range(count)]
    for part, parts in enumerate(heap.above):
        for other in parts.tolist():
            below[other].append(part)
    key = -heap.position[:, 2] if order == "highest" else cost
    turn = np.full(count, -1)
    free = [k for k in range(count) if waiting[k] == 0 and np.isfinite(cost[k])]
    picks = 0
    while free:
        part = min(free, key=lambda k: (float(key[k]), k))
        free.remove(part)
        turn[part] = picks
        picks += 1
        for other in below[part]:
            waiting[other] -= 1
            if waiting[other] == 0 and np.isfinite(cost[other]):
                free.append(other)
    fate = np.where(turn >= 0, Fate.PICKED, Fate.COVERED).astype(np.uint8)
    # What lies free and was not picked is what the arm does not reach.
    fate[(turn < 0) & (waiting == 0)] = Fate.UNREACHABLE
    return Emptied(fate=fate, turn=turn)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeapSummary:
    """One heap after the last pick.

    Attributes
    ----------
    seed : int
    parts, picked : int
    unreachable, covered : int
        Parts that stay: not reached, and below those.
    outside_map : int
        Of the unreachable, those that the map says nothing about.
    left_percent : float
        Parts that stay.
    where : str
        Where most of them lie, as in "along the far wall"; "" where none stay.
    highest_left_m : float or None
        Height of the highest part that stays.
    """

    seed: int
    parts: int
    picked: int
    unreachable: int
    covered: int
    outside_map: int
    left_percent: float
    where: str
    highest_left_m: float | None


def summarise_heap(
    bin_map: BinMap, heap: Heap, emptied: Emptied, outside: BoolArray, seed: int
) -> HeapSummary:
    """Count picked and remaining parts.

    Parameters
    ----------
    bin_map : BinMap
    heap : Heap
    emptied : Emptied
    outside : bool array, shape (n,)
        Parts that the map says nothing about.
    seed : int
        Of the heap.
    """
    stays = emptied.fate != Fate.PICKED
    heights = heap.position[stays, 2]
    return HeapSummary(
        seed=seed,
        parts=len(heap),
        picked=int((~stays).sum()),
        unreachable=int((emptied.fate == Fate.UNREACHABLE).sum()),
        covered=int((emptied.fate == Fate.COVERED).sum()),
        outside_map=int((outside & (emptied.fate == Fate.UNREACHABLE)).sum()),
        left_percent=100.0 * int(stays.sum()) / max(len(heap), 1),
        where=place_of(bin_map, heap, stays),
        highest_left_m=float(heights.max()) if len(heights) else None,
    )


def place_of(bin_map: BinMap, heap: Heap, stays: BoolArray) -> str:
    """Where parts lie, seen from the robot, "" where there are none."""
    if not stays.any():
        return ""
    share = heap.position[:, :2] / (bin_map.bin_inner[:2] / 2.0)
    near_wall = np.abs(share).max(axis=1) >= ALONG
    share, beside = share[stays], near_wall[stays]
    axis = np.argmax(np.abs(share), axis=1)
    value = share[np.arange(len(share)), axis]
    count = len(share)
    for k in range(2):
        for sign in (1, -1):
            if (beside & (axis == k) & (np.sign(value) == sign)).sum() >= MOST * count:
                return f"along the {wall_name(bin_map, k, sign)} wall"
    near, elsewhere = (
        float(stays[here].mean()) if here.any() else 0.0
        for here in (near_wall, ~near_wall)
    )
    if beside.sum() >= MOST * count and near >= CLEARLY * elsewhere:
        return "around the walls"
    if beside.sum() <= (1 - MOST) * count and elsewhere >= CLEARLY * near:
        return "in the middle"
    return "all over the bin"
