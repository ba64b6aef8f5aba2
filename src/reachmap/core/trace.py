"""Collision queries of a computation, and whether another cell answers them alike.

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

from reachmap._typing import BoolArray, FloatArray, IntArray

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
# A choice: changed answers show early, and small blocks cost little.
FIRST_BLOCK = 64
EVERY = -1
"""Of a moving body: all of them."""


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
        self._is_clear = np.zeros(0, bool)
        self._in_the_way: dict[frozenset[str], BoolArray] = {}
        self._low = self._high = np.zeros((0, 3, 0), np.float32)
        self._least = self._most = np.zeros((0, 3), np.float32)

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
        if not self._q:
            self._checker = None
            return
        self._Q = np.frombuffer(b"".join(self._q)).reshape(len(self._q), -1)
        self._kind = np.array(self._about, np.int8)
        self._is_clear = np.array([answer is True for answer in self._answers])
        self._q, self._about = [], []

    def _find_boxes(self) -> None:
        """Boxes around the bodies at each question, once another cell wants them.

        Widened by what was asked for, shape (bodies, 3, questions).
        """
        checker, self._checker = self._checker, None
        if checker is None:
            return
        margin_m = checker.margins_m(self._kind)[..., None] + ROUNDING_M
        parts = []
        for begin in range(0, len(self._Q), BLOCK):
            block = slice(begin, begin + BLOCK)
            low, high = checker.bound.boxes(self._Q[block])
            around = np.stack([low - margin_m[block], high + margin_m[block]])
            parts.append(around.astype(np.float32))
        boxes = np.concatenate(parts, axis=1).transpose(0, 2, 3, 1)
        self._low, self._high = np.ascontiguousarray(boxes)
        self._least, self._most = self._low.min(axis=2), self._high.max(axis=2)

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
        if not self._answers_repeat(checker, changed):
            return False
        askers: dict[Asker, Callable[..., Any]] = {}
        for asker, args, answer in self._others if changed else ():
            if asker not in askers:
                askers[asker] = asker(scene)
            if askers[asker](*args) != answer:
                return False
        return all(part.repeats_in(scene, changed) for part in self._parts)

    def _answers_repeat(
        self, checker: CollisionChecker, changed: Sequence[tuple[str, Box]]
    ) -> bool:
        """Ask those questions again that a changed body is near to.

        Most are about that body alone: where it does not touch what was clear before,
        or touches what was not, nothing else needs to be known.
        """
        if not changed or not len(self._Q):
            return True
        self._find_boxes()
        open_rows = np.zeros(len(self._Q), bool)
        touched = open_rows.copy()
        for name, body, near in self._near(checker, changed):
            open_rows |= near
            for kind in set(self._kind[near].tolist()) - {TOUCHING}:
                for block in _blocks(np.flatnonzero(near & (self._kind == kind))):
                    hit = checker.touched_mask(kind, self._Q[block], name, body)
                    if (hit & self._is_clear[block]).any():
                        return False
                    touched[block] |= hit
        open_rows &= ~self._is_clear & ~touched
        return self._others_are_in_the_way(
            checker, np.flatnonzero(open_rows), frozenset(name for name, _ in changed)
        )

    def _others_are_in_the_way(
        self, checker: CollisionChecker, rows: IntArray, names: frozenset[str]
    ) -> bool:
        """Whether what was in the way is still there, without the changed bodies.

        Found once for every set of bodies: those that are in the way stay there.
        """
        known = self._in_the_way.setdefault(names, np.zeros(len(self._Q), bool))
        for k in rows[~known[rows]].tolist():
            if checker.asked(int(self._kind[k]), self._Q[k]) != self._answers[k]:
                return False
            known[k] = self._kind[k] != TOUCHING
        return True

    def _near(
        self, checker: CollisionChecker, changed: Sequence[tuple[str, Box]]
    ) -> Iterator[tuple[str, int, BoolArray]]:
        """Each changed body, each moving one, and the questions at which they are near.

        Changed bodies that meet others than those that the chain moves are near to
        ``EVERY`` one, always.
        """
        for name in dict.fromkeys(name for name, _ in changed):
            bodies = checker.bodies_against(name)
            if bodies is None:
                yield name, EVERY, np.ones(len(self._Q), bool)
            for body in bodies or ():
                near = np.zeros(len(self._Q), bool)
                for low, high in (box for other, box in changed if other == name):
                    if (self._least[body] <= high).all() and (
                        self._most[body] >= low
                    ).all():
                        near |= np.logical_and.reduce(
                            [
                                (self._low[body, k] <= high[k])
                                & (self._high[body, k] >= low[k])
                                for k in range(3)
                            ]
                        )
                if near.any():
                    yield name, body, near


def _blocks(rows: IntArray) -> Iterator[IntArray]:
    """Few rows first: where answers differ, that shows soon."""
    begin, size = 0, FIRST_BLOCK
    while begin < len(rows):
        yield rows[begin : begin + size]
        begin, size = begin + size, min(2 * size, BLOCK)
