"""Simulated emptying: which parts are picked, in what order, and which remain."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.picking.heap import Heap

Order = Literal["highest", "rank"]


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
