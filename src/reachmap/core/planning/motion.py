"""Whether a straight joint-space motion is free, at the two resolutions of the cell.

*Planning step*: configurations no further apart than a joint-space step are checked.
This is for searching.

*Verification*: no point of the robot moves further than the verification distance
between two checked configurations. Where the surroundings are far, a wider margin
proves a longer stretch at once (:class:`.CollisionChecker`);
where the safety margin is at least half the verification distance, as in the shipped
cells, acceptance is a proof for the whole continuous motion. The idea is adaptive
subdivision with distance bounds, after Schwarzer, Saha and Latombe, "Adaptive dynamic
collision checking for single and multiple articulated robots in complex environments"
(2005), with margins in place of distances.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.collision.checker import WIDEST_M, CollisionChecker

# A piece is short enough (sum over joints) for its second-order term to be small.
PIECE_RAD = 0.4
_Piece = tuple[float, float, float]


class MotionChecker:
    """Checks of straight motions between configurations.

    Parameters
    ----------
    checker : CollisionChecker
    planning_step_rad : float
    verification_distance_m : float
    """

    def __init__(
        self,
        checker: CollisionChecker,
        planning_step_rad: float,
        verification_distance_m: float,
    ) -> None:
        self.checker = checker
        self.planning_step_rad = planning_step_rad
        self.verification_distance_m = verification_distance_m

    @property
    def is_proof(self) -> bool:
        """Whether a verified motion is proved free, not only densely sampled."""
        return self.checker.safety_margin_m >= self.verification_distance_m / 2

    def is_free(self, q_from: FloatArray, q_to: FloatArray) -> bool:
        """Check a motion at the planning step; ``q_from`` is known to be free."""
        is_free = self.checker.is_free
        if not is_free(q_to):
            return False
        change = q_to - q_from
        steps = math.ceil(math.sqrt(change @ change) / self.planning_step_rad)
        return all(is_free(q_from + share * change) for share in _middle_first(steps))

    def is_verified(self, q_from: FloatArray, q_to: FloatArray) -> bool:
        """Check a motion, ends included, at the verification distance."""
        change = q_to - q_from
        return self._covers(q_from, change, self._pieces(q_from, change))

    def _covers(
        self, q_from: FloatArray, change: FloatArray, pending: deque[_Piece]
    ) -> bool:
        """Whether pieces of a motion, or what they are halved into, are all free."""
        checker, finest_m = self.checker, self.verification_distance_m / 2
        unseen = len(pending)
        while pending:
            share, half_share, reach_m = pending.popleft()
            unseen -= 1
            q = q_from + share * change
            if finest_m < reach_m <= WIDEST_M and checker.is_clear(q, reach_m):
                continue
            # Collisions mostly show in the first pieces; halves are only checked once
            # they are short enough to count.
            if (unseen >= 0 or reach_m <= finest_m) and not checker.is_free(q):
                return False
            if reach_m > finest_m:
                half_share, reach_m = half_share / 2, reach_m / 2
                pending.append((share - half_share, half_share, reach_m))
                pending.append((share + half_share, half_share, reach_m))
        return True

    def parabola_is_verified(
        self, begin: FloatArray, corner: FloatArray, end: FloatArray
    ) -> bool:
        """Check the parabola that touches two straight motions, as densely as those.

        Parameters
        ----------
        begin, corner, end : array, shape (dof,)
            Its control points: a quadratic Bézier curve.
        """
        checker, finest_m = self.checker, self.verification_distance_m / 2
        pending = deque([(begin, corner, end)])
        while pending:
            a, b, c = pending.popleft()
            left, right = (a + b) / 2, (b + c) / 2
            middle = (left + right) / 2
            # A piece lies in the triangle of its control points, and how far a point
            # moves at most is convex in where the joints are.
            reach_m = max(
                float(np.abs(x - middle) @ checker.reach_m) for x in (a, b, c)
            )
            if finest_m < reach_m <= WIDEST_M and checker.is_clear(middle, reach_m):
                continue
            if not checker.is_free(middle):
                return False
            if reach_m > finest_m:
                pending += [(a, left, middle), (middle, right, c)]
        return True

    def _pieces(self, q_from: FloatArray, change: FloatArray) -> deque[_Piece]:
        """Pieces that cover a motion: middle, half width (as shares), displacement."""
        checker = self.checker
        size = np.abs(change)
        half_width_m = 0.5 * float(size @ checker.reach_m)
        if half_width_m <= WIDEST_M:
            return deque([(0.5, 0.5, half_width_m)])
        coarse = math.ceil(float(size.sum()) / PIECE_RAD)
        middles = (np.arange(coarse) + 0.5) / coarse
        reach_m = np.minimum(
            checker.bound.displacement_m(
                q_from + middles[:, None] * change, change / (2 * coarse)
            ),
            half_width_m / coarse,
        )
        # As wide as the ladder can prove at once, no wider.
        parts = np.maximum(1, np.ceil(reach_m / WIDEST_M)).astype(int)
        pieces = [
            (
                middle + (2 * part + 1 - count) / (2 * coarse * count),
                0.5 / coarse / count,
                reach / count,
            )
            for middle, count, reach in zip(
                middles.tolist(), parts.tolist(), reach_m.tolist(), strict=True
            )
            for part in range(count)
        ]
        return deque(pieces[k] for k in (0, *_halving(len(pieces))))

    def ways_are_verified(self, ways: Sequence[FloatArray]) -> BoolArray:
        """:meth:`path_is_verified` of ways of short steps, in less time, shape (n,).

        The tighter bound, found for all steps at once, leaves fewer configurations to
        be checked; others than by :meth:`is_verified`.

        Parameters
        ----------
        ways : sequence of array, shape (k, dof)
        """
        begins = [way[:-1] for way in ways]
        changes = [np.diff(way, axis=0) for way in ways]
        if not sum(map(len, changes)):
            return np.ones(len(ways), bool)
        change = np.concatenate(changes)
        middle, half = np.concatenate(begins) + change / 2, change / 2
        reach_m = np.minimum(
            np.abs(half) @ self.checker.reach_m,
            self.checker.bound.displacement_m(middle, half),
        )
        ends = np.cumsum([len(steps) for steps in changes])[:-1]
        reaches = [part.tolist() for part in np.split(reach_m, ends)]
        return np.array(
            [
                all(map(self._step_is_verified, *steps))
                for steps in zip(begins, changes, reaches, strict=True)
            ]
        )

    def _step_is_verified(
        self, q_from: FloatArray, change: FloatArray, reach_m: float
    ) -> bool:
        return self._covers(q_from, change, deque([(0.5, 0.5, reach_m)]))

    def path_is_verified(self, path: FloatArray) -> bool:
        """:meth:`is_verified` of every segment, shape (n, dof)."""
        return all(self.is_verified(path[k], path[k + 1]) for k in range(len(path) - 1))

    def blocking_pair(self, path: FloatArray) -> int:
        """Pair that touches first along a path, or -1 (for explanations)."""
        checker = self.checker
        for q_from, q_to in zip(path[:-1], path[1:], strict=True):
            change = q_to - q_from
            length_m = float(np.abs(change) @ checker.reach_m)
            steps = max(1, math.ceil(length_m / self.verification_distance_m))
            for k in range(steps + 1):
                q = q_from + (k / steps) * change
                if not checker.is_free(q):
                    return checker.blocking_pair(q)
        return -1


@lru_cache(maxsize=4096)
def _middle_first(steps: int) -> tuple[float, ...]:
    """Inner points k/steps of a motion, collisions being found soonest so."""
    return tuple(k / steps for k in _halving(steps))


@lru_cache(maxsize=4096)
def _halving(steps: int) -> tuple[int, ...]:
    """Numbers 1 … steps − 1 in the order of repeated halving (van der Corput)."""
    order: list[int] = []
    spans = deque([(1, steps - 1)])
    while spans:
        low, high = spans.popleft()
        if low > high:
            continue
        middle = (low + high) // 2
        order.append(middle)
        spans.append((low, middle - 1))
        spans.append((middle + 1, high))
    return tuple(order)
