"""The budget of an attempt: state checks, with a safety net in seconds."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from reachmap.core.collision import CollisionChecker

_CLOCK_EVERY = 64
# A planner asks once per iteration whether to go on. Some iterations check nothing;
# a planner that only makes such iterations is to end by a count as well.
_CALLS_PER_CHECK = 20


class Budget:
    """State checks left for searching; shortening does not count.

    Parameters
    ----------
    checker : CollisionChecker
        Counts the checks.
    checks : int
    seconds : float
        Wall-clock time after which the attempt ends in any case.
    """

    def __init__(self, checker: CollisionChecker, checks: int, seconds: float) -> None:
        self.checks = checks
        self._checker = checker
        self._limit = checker.checks + checks
        self._search_limit = self._limit
        self._begin = checker.checks
        self._deadline = time.monotonic() + seconds
        self._calls = 0
        self._most_calls = _CALLS_PER_CHECK * checks
        self._most_search_calls = self._most_calls
        self.search_interrupted = False
        self.out_of_time = False

    def used(self) -> int:
        """State checks spent on searching."""
        return self._checker.checks - self._begin

    def spent(self) -> bool:
        """Whether the checks, or the seconds of the safety net, are used up."""
        self._calls += 1
        if self._checker.checks >= self._limit or self._calls >= self._most_calls:
            return True
        if self._calls % _CLOCK_EVERY == 0 and time.monotonic() > self._deadline:
            self.out_of_time = True
        return self.out_of_time

    def begin_search(self, checks: int) -> None:
        """Allow the search that begins so many checks of those that are left."""
        self._search_limit = self._checker.checks + checks
        self._most_search_calls = self._calls + _CALLS_PER_CHECK * checks
        self.search_interrupted = False

    def search_ends(self) -> bool:
        """Whether the search has to end: the budget is spent, or its part of it."""
        if self.spent():
            return True
        self.search_interrupted = (
            self._checker.checks >= self._search_limit
            or self._calls >= self._most_search_calls
        )
        return self.search_interrupted

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Context in which checks are not counted."""
        used = self.used()
        yield
        unpaid = self.used() - used
        self._limit += unpaid
        self._begin += unpaid
