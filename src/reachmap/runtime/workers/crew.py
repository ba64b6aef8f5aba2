"""Handing units to executors whose workers may die.

A *lane* is one executor with a bounded number of units in flight. When its workers
die, the units it held are handed out again; the one that was being worked on gets a
strike, and with three strikes it is given up as an error. A lane of one process
takes its units in order, so there is no doubt which one that was. In a lane of many
workers there is: there the units are tried again one at a time before any is blamed.

Workers may also be killed from outside, and hit the same unit more than once by
chance. Every unit that lost a worker and was computed all the same is a sign of that,
and allows the others one strike more.
"""

from __future__ import annotations

import logging
import traceback
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from dataclasses import dataclass
from typing import Any

from reachmap.errors import EngineError, IncompleteError, ReachmapError
from reachmap.runtime.encoding import compact
from reachmap.runtime.workers.tasks import Reply, compute, get_ready

READY = -1  # stands for the unit while a worker gets ready


def is_broken(error: BaseException) -> bool:
    """Whether an exception says that an executor's processes have died."""
    return isinstance(error, BrokenExecutor)


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneSpec:
    """How a lane is made.

    Attributes
    ----------
    start : callable
        Makes the executor, and a new one after its workers died.
    stop : callable
        Ends an executor and its workers promptly; takes what ``start`` made.
    parcel : Parcel or object
        The job, or what the executor turns into it for the functions it calls. A new
        executor gets it first, to get ready with.
    label : Parcel or object
        What goes with each unit: the parcel again, or its label where the workers
        keep what they got ready.
    window : callable
        Number of units that may be in flight now.
    in_order : bool
        Whether one worker takes the units in the order they were handed in.
    lost : callable
        Whether an exception of a future says that the executor is of no use any more.
    deaths : callable
        How many workers an exception of a future says have died of its unit, for
        executors that replace dead workers themselves; 0 for other exceptions.
    """

    start: Callable[[], Executor]
    stop: Callable[[Executor], None]
    parcel: Any
    label: Any
    window: Callable[[], int]
    in_order: bool = False
    lost: Callable[[BaseException], bool] = is_broken
    deaths: Callable[[BaseException], int] = lambda error: 0


class Lane:
    """One executor at work: what it holds, and what has become of it."""

    def __init__(self, spec: LaneSpec) -> None:
        self.spec = spec
        self.held: dict[Future[Any], int] = {}
        self.suspects: deque[int] = deque()
        self.alone = False
        self.is_ready = False
        self._executor: Executor | None = None

    def has_room(self) -> bool:
        """Whether one more unit may be handed in."""
        if self.suspects or self.alone:
            return not self.held
        return len(self.held) < self.spec.window()

    def hand_in(self, unit: int) -> None:
        """Submit a unit; a new executor gets ready first.

        Raises
        ------
        BrokenExecutor, OSError
            When the executor's workers have died; the unit is not held.
        """
        if self._executor is None:
            self._executor = self.spec.start()
            self.held[self._executor.submit(get_ready, self.spec.parcel)] = READY
        self.held[self._executor.submit(compute, self.spec.label, unit)] = unit

    def let_go(self) -> list[int]:
        """End the executor; returns the units it held, in order."""
        units = [unit for unit in self.held.values() if unit != READY]
        self.held.clear()
        self.alone = self.is_ready = False
        executor, self._executor = self._executor, None
        if executor is not None:
            self.spec.stop(executor)
        return units


STRIKES = 3
MORE_STRIKES = 9
FAILED_STARTS = 20
TICK_S = 0.1

log = logging.getLogger(__name__)


class Crew:
    """All lanes of a run; a context manager that leaves no worker behind.

    Parameters
    ----------
    specs : iterable of LaneSpec
    """

    def __init__(self, specs: Iterable[LaneSpec]) -> None:
        self._lanes = [Lane(spec) for spec in specs]
        self._waiting: deque[int] = deque()
        self._strikes: Counter[int] = Counter()
        self._acquitted = 0
        self._failed_starts = 0
        self._given_up: deque[Reply] = deque()

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, *exception: object) -> None:
        for lane in self._lanes:
            lane.let_go()

    def replies(self, units: Iterable[int]) -> Generator[Reply | None, None, None]:
        """Compute units, in whatever order they get done.

        Parameters
        ----------
        units : iterable of int

        Yields
        ------
        Reply or None
            None once a round, at least ten times a second, so that the caller can
            look after other things, and stop before dead workers are replaced.

        Raises
        ------
        ReachmapError
            Wrong input that a unit met, workers that do not start, or an executor
            that was lost.
        """
        self._waiting.extend(units)
        while True:
            self._hand_out()
            while self._given_up:
                yield self._given_up.popleft()
            futures = [future for lane in self._lanes for future in lane.held]
            if not futures:
                if self._waiting or any(lane.suspects for lane in self._lanes):
                    continue
                return
            wait(futures, timeout=TICK_S, return_when=FIRST_COMPLETED)
            for lane in self._lanes:
                yield from self._collect(lane)
            yield None

    def _hand_out(self) -> None:
        # Round by round, so that the last units are spread over the lanes.
        busy = True
        while busy:
            busy = False
            for lane in self._lanes:
                unit = self._next_for(lane)
                if unit is not None:
                    self._hand_in(lane, unit)
                    busy = True

    def _next_for(self, lane: Lane) -> int | None:
        if not lane.has_room():
            return None
        if lane.suspects:
            lane.alone = True
            return lane.suspects.popleft()
        return self._waiting.popleft() if self._waiting else None

    def _hand_in(self, lane: Lane, unit: int) -> None:
        try:
            lane.hand_in(unit)
        except (BrokenExecutor, OSError) as error:
            self._waiting.appendleft(unit)
            self._after_death(lane, error)

    def _collect(self, lane: Lane) -> Iterator[Reply]:
        done = {future: _exception(future) for future in lane.held if future.done()}
        lost = [error for error in done.values() if error and lane.spec.lost(error)]
        for future, error in done.items():
            if error in lost:
                continue  # a lost executor may yet have finished other units
            unit = lane.held.pop(future)
            if unit == READY:
                self._check_ready(lane, error)
                continue
            alone, lane.alone = lane.alone, False
            if error is None:
                self._acquitted += unit in self._strikes
                yield future.result()
            elif deaths := lane.spec.deaths(error):
                self._after_deaths_of(lane, unit, deaths, alone=alone)
            else:
                raise _as_failure(error)
        if lost:
            self._after_death(lane, lost[0])

    def _check_ready(self, lane: Lane, error: BaseException | None) -> None:
        if error is not None:
            raise _as_failure(error)
        lane.is_ready = True
        self._failed_starts = 0

    def _after_death(self, lane: Lane, error: BaseException) -> None:
        """Hand out again what a broken executor held, and blame whom to blame."""
        was_ready, sure = lane.is_ready, lane.spec.in_order or lane.alone
        units = lane.let_go()
        if not was_ready:
            self._count_failed_start(error)
            self._waiting.extendleft(reversed(units))
        elif sure or len(units) < 2:
            self._waiting.extendleft(reversed(units[1:]))
            for unit in units[:1]:
                self._strike(lane, unit, 1)
        else:
            log.info("workers died over units %s: each is tried alone", units)
            lane.suspects.extend(units)

    def _count_failed_start(self, error: BaseException) -> None:
        self._failed_starts += 1
        if self._failed_starts >= FAILED_STARTS:
            raise EngineError(
                f"workers died {FAILED_STARTS} times before their first unit "
                f"({error}): is memory short? Try fewer workers, or one (-j 1) to see "
                "the error itself"
            ) from error

    def _after_deaths_of(
        self, lane: Lane, unit: int, deaths: int, *, alone: bool
    ) -> None:
        if alone:
            self._strike(lane, unit, deaths)
        else:
            lane.suspects.append(unit)

    def _strike(self, lane: Lane, unit: int, deaths: int) -> None:
        self._strikes[unit] += deaths
        count = self._strikes[unit]
        limit = STRIKES + min(self._acquitted, MORE_STRIKES)
        if count >= limit:
            text = f"killed {count} workers"
            log.warning("unit %d %s and is given up", unit, text)
            reply = Reply(unit=unit, payload=compact(text), failed=True)
            self._given_up.append(reply)
            return
        log.info("a worker died at unit %d (%d of %d)", unit, count, limit)
        if not lane.spec.in_order:
            lane.suspects.append(unit)
        elif count == 1:
            self._waiting.appendleft(unit)
        else:  # judged last, when more is known about who kills workers here
            self._waiting.append(unit)


def _exception(future: Future[Any]) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError:
        return IncompleteError(
            "the executor dropped its work (has the scheduler gone?); what is done is "
            "kept, the same command goes on from there"
        )


def _as_failure(error: BaseException) -> ReachmapError:
    if isinstance(error, ReachmapError):
        return error
    text = "".join(traceback.format_exception(error)).rstrip()
    log.debug("%s", text)
    return EngineError(f"a worker cannot do its work: {type(error).__name__}: {error}")
