"""Whole turns of joints: other positions of the arm at the same configuration.

A joint with more than a full turn of range reaches every position modulo 2π at two or
more angles. The body is in the same place, so collisions are the same; limits and
paths are not. Each such winding is a solution of its own. There may be dozens of them,
so they are named when they are wanted: the nearest first.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from itertools import islice

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.robot.model import RobotModel

TURN_RAD = 2.0 * np.pi
# Angles this far outside a limit are rounding.
_SLACK_RAD = 1e-9


class Windings:
    """Turns of the joints of a robot that stay within its limits.

    Parameters
    ----------
    robot : RobotModel

    Attributes
    ----------
    turns : bool array, shape (dof,)
        Joints with more than a full turn of range.
    period_rad : array, shape (dof,)
        2π for them, 0 for the others.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._lower, self._upper = robot.lower_rad, robot.upper_rad
        wide = self._upper - self._lower > TURN_RAD + _SLACK_RAD
        self.turns: BoolArray = np.asarray(robot.is_revolute & wide)
        self.period_rad: FloatArray = np.where(self.turns, TURN_RAD, 0.0)

    @property
    def exist(self) -> bool:
        """Whether any joint has more than a full turn."""
        return bool(self.turns.any())

    def shortest(self, change: FloatArray) -> tuple[FloatArray, IntArray]:
        """Differences of configurations without whole turns, and the turns left out.

        Parameters
        ----------
        change : array, shape (..., dof)

        Returns
        -------
        change : array, same shape
            ``change + turns * period_rad``, at most half a turn where joints turn.
        turns : int array, same shape
        """
        turns = np.where(self.turns, -np.round(change / TURN_RAD), 0.0)
        return change + turns * TURN_RAD, turns.astype(np.int64)

    def range_of(self, low: FloatArray, high: FloatArray) -> tuple[IntArray, IntArray]:
        """Fewest and most turns of ways that span ``low`` to ``high``.

        Parameters
        ----------
        low, high : array, shape (..., dof)
            Smallest and largest position of each joint along the way.
        """
        first = np.ceil((self._lower - low - _SLACK_RAD) / TURN_RAD)
        last = np.floor((self._upper - high + _SLACK_RAD) / TURN_RAD)
        first, last = (
            np.where(self.turns, k, 0.0).astype(np.int64) for k in (first, last)
        )
        # A way that is within the limits as it stands stays possible.
        return np.minimum(first, 0), np.maximum(last, 0)

    def allows(self, low: FloatArray, high: FloatArray, turns: IntArray) -> bool:
        """Whether a way, turned, stays within the limits."""
        first, last = self.range_of(low, high)
        return bool(((turns >= first) & (turns <= last)).all())

    def nearest(
        self,
        Q: FloatArray,
        q: FloatArray,
        low: FloatArray | None = None,
        high: FloatArray | None = None,
    ) -> IntArray:
        """Turns that bring configurations nearest to another one, joint by joint.

        Parameters
        ----------
        Q : array, shape (n, dof)
        q : array, shape (dof,)
        low, high : array, shape (n, dof), optional
            What the turned ways span; default: the configurations alone.

        Returns
        -------
        int array, shape (n, dof)
        """
        first, last = self.range_of(
            Q if low is None else low, Q if high is None else high
        )
        wanted = np.where(self.turns, np.round((q - Q) / TURN_RAD), 0.0)
        return np.clip(wanted.astype(np.int64), first, last)

    def in_order(
        self, q_goal: FloatArray, q: FloatArray, low: FloatArray, high: FloatArray
    ) -> Iterator[tuple[float, tuple[int, ...]]]:
        """Turns of one configuration, those nearest to another one first.

        Each is made when it is asked for; of the dozens that there may be, callers
        look at few.

        Yields
        ------
        distance_rad : float
        turns : tuple of int
            One per joint.
        """
        first, last = self.range_of(low, high)
        choices = [
            sorted(
                (abs(q_goal[k] + n * TURN_RAD * bool(self.turns[k]) - q[k]), n)
                for n in range(int(first[k]), int(last[k]) + 1)
            )
            for k in range(len(q_goal))
        ]

        def entry(digits: tuple[int, ...]) -> tuple[float, tuple[int, ...]]:
            away = [c[d][0] for c, d in zip(choices, digits, strict=True)]
            return float(np.linalg.norm(away)), digits

        begin = (0,) * len(choices)
        pending, seen = [entry(begin)], {begin}
        while pending:
            distance, digits = heapq.heappop(pending)
            yield distance, tuple(c[d][1] for c, d in zip(choices, digits, strict=True))
            for k, digit in enumerate(digits):
                following = (*digits[:k], digit + 1, *digits[k + 1 :])
                if digit + 1 < len(choices[k]) and following not in seen:
                    seen.add(following)
                    heapq.heappush(pending, entry(following))

    def spread(
        self,
        Q: FloatArray,
        q: FloatArray,
        low: FloatArray,
        high: FloatArray,
        *,
        each: int,
    ) -> tuple[IntArray, IntArray]:
        """A few turns of several configurations, the nearest to another one first.

        Parameters
        ----------
        Q : array, shape (n, dof)
        q : array, shape (dof,)
        low, high : array, shape (n, dof)
            What the ways on from Q span.
        each : int
            Most turns of each configuration.

        Returns
        -------
        row : int array, shape (m,)
            Row of Q; as they stand, in order, where no joint has more than a turn.
        turns : int array, shape (m, dof)
        """
        if not self.exist:
            return np.arange(len(Q)), np.zeros(Q.shape, np.int64)
        found = sorted(
            (distance, row, turns)
            for row in range(len(Q))
            for distance, turns in islice(
                self.in_order(Q[row], q, low[row], high[row]), each
            )
        )
        rows = np.array([row for _, row, _ in found], np.int64)
        turned = np.array([turns for _, _, turns in found], np.int64)
        return rows, turned.reshape(-1, Q.shape[1])
