"""One executor at work: how it is made, what it holds, how it ends."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import dataclass
from typing import Any

from reachmap.scans.tasks import compute, get_ready

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
