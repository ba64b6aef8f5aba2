"""What a computation asked about collisions, and whether another cell answers the same.

A computation that sees its cell through a checker alone ends the same way in another
cell, to the last bit, if everything it asked has the same answer there. So a result is
taken over from a cell that differs by bodies which stand still: most questions were
asked far away from these, and the others are asked again ("verifying traces"; Mokhov,
Mitchell and Peyton Jones, "Build systems à la carte", 2018).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from reachmap._typing import BoolArray, FloatArray

if TYPE_CHECKING:
    from reachmap.core.collision.checker import CollisionChecker
    from reachmap.core.scene import Scene

Box = tuple[FloatArray, FloatArray]
Asker = Callable[["Scene"], Callable[..., Any]]
FREE, TOUCHING = -1, -2
"""What was asked of a configuration; a number from 0 on is a rung of the ladder."""
# Boxes are kept in single precision: a micrometre covers the rounding.
ROUNDING_M = 1e-6
# About 300 bytes a question: what a process keeps stays well below a gigabyte.
MOST_QUESTIONS = 2_000_000
# Configurations at a time, for the sake of memory.
BLOCK = 4096


class Trace:
    """Questions of a computation with their answers, in their order.

    Parameters
    ----------
    checker : CollisionChecker
        Whom they are put to. Where another one is asked as well, or very much is asked,
        the trace is not whole and says nothing about other cells.

    Attributes
    ----------
    is_whole : bool
    """

    current: ClassVar[Trace | None] = None
    """Where questions are noted now."""

    def __init__(self, checker: CollisionChecker) -> None:
        self.is_whole = True
        self._checker: CollisionChecker | None = checker
        self._body_pairs = checker.body_pairs
        self._q: list[bytes] = []
        self._about: list[int] = []
        self._answers: list[Any] = []
        self._others: list[tuple[Asker, tuple[Any, ...], Any]] = []
        self._parts: list[Trace] = []
        self._Q, self._kind = np.zeros((0, 0)), np.zeros(0, np.int8)
        self._low = self._high = np.zeros((0, 0, 3), np.float32)

    def __len__(self) -> int:
        """Questions about configurations, without those of parts."""
        return len(self._answers)

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Context in which questions are noted here; then the trace is closed."""
        outer, Trace.current = Trace.current, self
        try:
            yield
        finally:
            Trace.current = outer
            self._close()

    def include(self, part: Trace) -> None:
        """Take in all that a part of the computation has asked."""
        self._parts.append(part)
        self.is_whole &= part.is_whole

    def note(
        self, checker: CollisionChecker, about: int, q: FloatArray, answer: Any
    ) -> None:
        """Note what a checker answered about a configuration (dof,)."""
        if checker is not self._checker or len(self._answers) == MOST_QUESTIONS:
            self.is_whole = False
            # What is no use takes no room.
            self._q, self._about, self._answers = [], [], []
        if not self.is_whole:
            return
        self._q.append(np.asarray(q, float).tobytes())
        self._about.append(about)
        self._answers.append(answer)

    def note_other(self, asker: Asker, answer: Any, *args: Any) -> None:
        """Note the answer to another question, which ``asker(scene)(*args)`` repeats.

        What is asked of the checker to find the answer need not be noted beside it.
        """
        self._others.append((asker, args, answer))

    def _close(self) -> None:
        checker = self._checker
        assert checker is not None
        self._checker = None
        if not self._q:
            return
        self._Q = np.frombuffer(b"".join(self._q)).reshape(len(self._q), -1)
        self._kind = np.array(self._about, np.int8)
        self._q, self._about = [], []
        margin_m = checker.margins_m(self._kind)[..., None] + ROUNDING_M
        parts = []
        for begin in range(0, len(self._Q), BLOCK):
            block = slice(begin, begin + BLOCK)
            low, high = checker.bound.boxes(self._Q[block])
            around = np.stack([low - margin_m[block], high + margin_m[block]])
            parts.append(around.astype(np.float32))
        self._low, self._high = np.concatenate(parts, axis=1)

    def repeats_in(self, scene: Scene, changed: Sequence[tuple[str, Box]]) -> bool:
        """Whether another cell gives the same answers, all of them.

        Parameters
        ----------
        scene : Scene
            Of the other cell, with the same moving bodies.
        changed : sequence of (str, (array, array))
            Every body that the cells do not have in common, by name, with the low and
            high corners (3,) of a box around it in robot_base: in the one cell, and in
            the other.
        """
        checker = scene.checker
        if checker.body_pairs != self._body_pairs:
            return False
        near = np.zeros(len(self._Q), bool)
        if len(near):
            for name, box in changed:
                near |= self._near(box, checker.bodies_against(name))
        ask = checker.asked
        for k in np.flatnonzero(near).tolist():
            if ask(int(self._kind[k]), self._Q[k]) != self._answers[k]:
                return False
        askers: dict[Asker, Callable[..., Any]] = {}
        for asker, args, answer in self._others if changed else ():
            if asker not in askers:
                askers[asker] = asker(scene)
            if askers[asker](*args) != answer:
                return False
        return all(part.repeats_in(scene, changed) for part in self._parts)

    def _near(self, box: Box, bodies: Sequence[int] | None) -> BoolArray:
        """Questions that a box may matter to, shape (questions,)."""
        if bodies is None:
            return np.ones(len(self._Q), bool)
        near = np.zeros(len(self._Q), bool)
        low, high = box
        for body in bodies:
            below, above = self._low[:, body], self._high[:, body]
            if (below.min(axis=0) <= high).all() and (above.max(axis=0) >= low).all():
                near |= ((below <= high) & (above >= low)).all(axis=1)
        return near
