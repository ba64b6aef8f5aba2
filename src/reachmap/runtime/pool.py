"""Handing units to executors whose workers may die.

A *slot* is one executor with a bounded number of units in flight. When its workers
die, what it held is handed out again. If that was a single unit, the unit gets a
strike, and with three strikes it is given up as an error. If there were several, they
are tried again one at a time before any is blamed.

Workers may also be killed from outside, and hit the same unit more than once by
chance. Every unit that lost a worker and was computed all the same is a sign of that,
and allows the others one strike more.
"""

from __future__ import annotations

import logging
import traceback
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from typing import Any, ClassVar

from reachmap.errors import EngineError, IncompleteError, ReachmapError
from reachmap.runtime.encoding import encode
from reachmap.runtime.job import Job, Reply, Ticket, compute, get_ready, ticket_for

# One death may be chance (memory, an impatient scheduler), three are the unit's.
STRIKES = 3
# A choice: a unit gets one more chance for each suspect that proved innocent, at most.
MORE_STRIKES = 9
FAILED_STARTS = 3
"""Workers that die one after another before any got ready: they cannot start here."""
FAILED_RESTARTS = 20
"""The same where workers have been ready before, and something kills them now."""
# A choice: how soon an interrupt is heeded.
TICK_S = 0.1

log = logging.getLogger(__name__)


class Slot:
    """An executor, and the units it holds; see the subclasses for what they differ in.

    Parameters
    ----------
    start : callable
        Makes the executor, and a new one after its workers died.
    """

    is_wide: bool = True
    """Whether several units may be in flight, so that a death has several suspects."""
    is_here: ClassVar[bool] = False
    """Whether it works in this process."""

    def __init__(self, start: Callable[[], Executor]) -> None:
        self._start = start
        self.executor: Executor | None = None
        self.held: dict[Future[Any], int | None] = {}
        self.suspects: deque[int] = deque()
        self.alone = False
        self.is_ready = False
        self._key = ""

    def window(self) -> int:
        """Units that may be in flight now."""
        return 1

    def ticket(self, ticket: Ticket) -> Ticket:
        """Return what goes with each unit."""
        return ticket

    def stop(self, executor: Executor) -> None:
        """End an executor and its workers promptly."""
        executor.shutdown(wait=False, cancel_futures=True)

    def is_lost(self, error: BaseException) -> bool:
        """Whether an error of a future says that the executor is broken."""
        return isinstance(error, BrokenExecutor)

    def deaths(self, error: BaseException) -> int:
        """How many workers died of a unit, where the executor replaces them itself."""
        return 0

    def has_room(self) -> bool:
        """Whether one more unit may be handed in."""
        if self.suspects or self.alone:
            return not self.held
        # Nothing but the job until a worker is ready: no unit is to blame then.
        return None not in self.held.values() and len(self.held) < self.window()

    def get_ready(self, ticket: Ticket) -> bool:
        """Start the executor if need be and send it the job; True once it has it."""
        if self.executor is None:
            self.executor, self._key = self._start(), ""
        if self._key != ticket.key:
            self.held[self.executor.submit(get_ready, ticket)] = None
            self._key = ticket.key
        return None not in self.held.values()

    def submit(self, ticket: Ticket, index: int, unit: Any) -> None:
        """Hand in a unit.

        Raises
        ------
        BrokenExecutor, OSError
            When the executor's workers have died; the unit is not held.
        """
        assert self.executor is not None
        future = self.executor.submit(compute, self.ticket(ticket), index, unit)
        self.held[future] = index

    def release(self) -> list[int]:
        """End the executor; returns the units it held, in order."""
        indices = [index for index in self.held.values() if index is not None]
        self.held.clear()
        self.alone = self.is_ready = False
        executor, self.executor = self.executor, None
        if executor is not None:
            self.stop(executor)
        return indices


class Pool:
    """Slots that outlive a job; a context manager that leaves no worker behind.

    Parameters
    ----------
    slots_for : callable
        ``slots_for(units, most)``: the slots for a number of units, of which at most
        that many may be used.
    """

    def __init__(self, slots_for: Callable[[int, int | None], Sequence[Slot]]) -> None:
        self._slots_for = slots_for
        self._used: dict[int, Slot] = {}
        self._last: Ticket | None = None

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *exception: object) -> None:
        for slot in self._used.values():
            slot.release()

    def slots(self, units: int, most: int | None = None) -> Sequence[Slot]:
        """Slots for a number of units, at most ``most``; one is this process then."""
        slots = self._slots_for(max(1, units), most)
        self._used.update({id(slot): slot for slot in slots})
        return slots

    def replies(
        self,
        job: Job,
        units: Mapping[int, Any],
        slots: Sequence[Slot] | None = None,
    ) -> Generator[Reply | None, None, None]:
        """Compute units, in any order; None now and then, for looking at the clock.

        Parameters
        ----------
        job : Job
        units : mapping
            Index to unit.
        slots : sequence of Slot, optional
            Of :meth:`slots`; by default as many as there is work for.

        Raises
        ------
        ReachmapError
            Wrong input, or workers that cannot do their work.
        """
        slots = slots or self.slots(len(units))
        for slot in slots:  # an aborted job may have left something
            if slot.held or slot.suspects:
                slot.suspects.clear()
                slot.release()
        yield from _Round(slots, self._ticket(job), units).replies()

    def _ticket(self, job: Job) -> Ticket:
        """The ticket of a job; workers that are ready for it need not get so again."""
        if self._last is None or self._last.job is not job:
            self._last = ticket_for(job)
        return self._last


class _Round:
    """One job on its way through the slots."""

    def __init__(
        self, slots: Sequence[Slot], ticket: Ticket, units: Mapping[int, Any]
    ) -> None:
        self._slots, self._ticket, self._units = slots, ticket, units
        self._waiting = deque(units)
        self._strikes: Counter[int] = Counter()
        self._acquitted = self._failed_starts = 0
        self._was_ready = False
        self._given_up: deque[Reply] = deque()

    def replies(self) -> Iterator[Reply | None]:
        """See :meth:`Pool.replies`."""
        while True:
            self._hand_out()
            while self._given_up:
                yield self._given_up.popleft()
            futures = [future for slot in self._slots for future in slot.held]
            if futures:
                wait(futures, timeout=TICK_S, return_when=FIRST_COMPLETED)
                for slot in self._slots:
                    yield from self._collect(slot)
                yield None
            elif not self._waiting and not any(s.suspects for s in self._slots):
                return

    def _hand_out(self) -> None:
        # Round by round, so that the last units are spread over the slots.
        busy = True
        while busy:
            busy = False
            for slot in self._slots:
                if (self._waiting or slot.suspects) and slot.has_room():
                    busy |= self._hand_in(slot)

    def _hand_in(self, slot: Slot) -> bool:
        index = None
        try:
            if not slot.get_ready(self._ticket):
                return False
            slot.alone = bool(slot.suspects)
            index = (slot.suspects or self._waiting).popleft()
            slot.submit(self._ticket, index, self._units[index])
        except (BrokenExecutor, OSError) as error:
            if index is not None:
                self._waiting.appendleft(index)
            self._after_death(slot, error)
        return True

    def _collect(self, slot: Slot) -> Iterator[Reply]:
        done = {future: _exception(future) for future in slot.held if future.done()}
        lost = [error for error in done.values() if error and slot.is_lost(error)]
        for future, error in done.items():
            if error in lost:
                continue  # a lost executor may yet have finished other units
            index = slot.held.pop(future)
            if index is None:
                if error is not None:
                    raise _as_failure(error)
                slot.is_ready = self._was_ready = True
                self._failed_starts = 0
                continue
            alone, slot.alone = slot.alone, False
            if error is None:
                self._acquitted += index in self._strikes
                yield future.result()
            elif deaths := slot.deaths(error):
                if alone:
                    self._strike(slot, index, deaths)
                else:
                    slot.suspects.append(index)
            else:
                raise _as_failure(error)
        if lost:
            self._after_death(slot, lost[0])

    def _after_death(self, slot: Slot, error: BaseException) -> None:
        """Reassign the units of a broken executor, and count a strike."""
        was_ready = slot.is_ready
        indices = slot.release()
        if not was_ready:
            self._count_failed_start(error)
            self._waiting.extendleft(reversed(indices))
        elif len(indices) == 1:
            self._strike(slot, indices[0], 1)
        elif indices:
            log.info("workers died at units %s: each is tried alone", indices)
            slot.suspects.extend(indices)

    def _count_failed_start(self, error: BaseException) -> None:
        self._failed_starts += 1
        most = FAILED_RESTARTS if self._was_ready else FAILED_STARTS
        if self._failed_starts >= most:
            raise EngineError(
                f"workers died {most} times before their first unit ({error}): out of "
                "memory? Try fewer workers, or one (-j 1) to see the error itself"
            ) from error

    def _strike(self, slot: Slot, index: int, deaths: int) -> None:
        self._strikes[index] += deaths
        count = self._strikes[index]
        limit = STRIKES + min(self._acquitted, MORE_STRIKES)
        if count >= limit:
            text = f"killed {count} workers"
            log.warning("unit %d %s and is given up", index, text)
            self._given_up.append(Reply(index=index, text=encode(text), failed=True))
            return
        log.info("a worker died at unit %d (%d of %d)", index, count, limit)
        # Without neighbours to spare, it is judged last, when more is known about
        # who kills workers here.
        (slot.suspects if slot.is_wide else self._waiting).append(index)


def _exception(future: Future[Any]) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError:
        return IncompleteError(
            "the executor dropped its work (did the scheduler stop?); finished work is "
            "kept; run the same command again to resume"
        )


def _as_failure(error: BaseException) -> ReachmapError:
    if isinstance(error, ReachmapError):
        return error
    text = "".join(traceback.format_exception(error)).rstrip()
    log.debug("%s", text)
    return EngineError(f"a worker cannot do its work: {type(error).__name__}: {error}")
