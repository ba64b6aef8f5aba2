"""Memoized results of computations, shared between cells that give the same result."""

from __future__ import annotations

import hashlib
import json
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from reachmap.core.collision.bodies import world_placements, world_shapes
from reachmap.core.collision.static_bodies import box_around
from reachmap.core.trace import MOST_QUESTIONS, Box, Trace

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.core.scene import Scene

Result = TypeVar("Result")
# What a cell is called, and how its numbers were written.
NEVER_READ = ("name", "description", "parameters", "expressions")


def fingerprint(
    loaded: LoadedCell, *, without: Collection[str] = (), surroundings: bool = True
) -> str:
    """Hash that is equal for cells a computation cannot distinguish.

    Parameters
    ----------
    loaded : LoadedCell
    without : collection of str
        Parts of the cell that the computation does not read: ``bin``, ``bin.pose``.
    surroundings : bool
        Whether poses and sizes of the bodies on the world count.
    """
    data = json.loads(loaded.resolved_json)
    for name in (*NEVER_READ, *without):
        *parents, last = name.split(".")
        part = data
        for parent in parents:
            part = part[parent]
        part.pop(last, None)
    if not surroundings:
        # A camera moves with the body that it is mounted on.
        camera = loaded.cell.camera
        names = {*world_shapes(loaded)} - {camera.parent if camera else ""}
        for body in data["bodies"]:
            if body["name"] in names:
                body["shape"] = body["pose"] = None
    files = dict(sorted(loaded.files_sha256.items()))
    text = json.dumps([data, loaded.urdf, loaded.srdf, files], sort_keys=True)
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Surroundings:
    """What :func:`fingerprint` may leave out: text and box of each body, by name."""

    text: dict[str, str]
    box: dict[str, Box]

    @classmethod
    def of(cls, scene: Scene) -> _Surroundings:
        robot, loaded = scene.robot, scene.loaded
        place = world_placements(robot, loaded)
        return cls(
            text={
                body.name: body.model_dump_json(include={"shape", "pose"})
                for body in loaded.cell.bodies
            },
            box={
                name: box_around(shape, robot.T_base_root @ place[name])
                for name, shape in world_shapes(loaded).items()
            },
        )

    def changed(self, other: _Surroundings) -> list[tuple[str, Box]]:
        """Bodies that differ in another cell, with their boxes in both."""
        return [
            (name, box)
            for name in self.box
            if self.text[name] != other.text[name]
            for box in (self.box[name], other.box[name])
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Known:
    surroundings: _Surroundings
    trace: Trace
    result: Any
    checks: int


@dataclass(frozen=True, slots=True)
class _Within:
    """The result that is being computed."""

    key: str
    scene: Scene
    surroundings: _Surroundings


class Memo:
    """Cache of results with the queries they depend on; the oldest are evicted.

    Attributes
    ----------
    found, computed : int
        Results reused so far, and those that had to be computed.
    """

    current: ClassVar[Memo | None] = None
    """The memo that :func:`memoized` uses; None computes everything."""

    def __init__(self, most_questions: int = MOST_QUESTIONS) -> None:
        self._most, self._questions = most_questions, 0
        self._known: OrderedDict[str, list[_Known]] = OrderedDict()
        self._within: _Within | None = None
        self.found = self.computed = 0

    @contextmanager
    def active(self) -> Iterator[None]:
        """Context in which :func:`memoized` uses this memo."""
        Memo.current = self
        try:
            yield
        finally:
            Memo.current = None

    def result(self, key: str, scene: Scene, compute: Callable[[], Result]) -> Result:
        """See :func:`memoized`."""
        within = _Within(key, scene, _Surroundings.of(scene))
        outer, self._within = self._within, within
        try:
            return self._result(key, within, compute)
        finally:
            self._within = outer

    def part(self, key: str, compute: Callable[[], Result]) -> Result:
        """See :func:`memoized_part`."""
        if self._within is None:
            return compute()
        return self._result(f"{self._within.key} {key}", self._within, compute)

    def _result(
        self, key: str, within: _Within, compute: Callable[[], Result]
    ) -> Result:
        checker, outer = within.scene.checker, Trace.current
        before = checker.checks
        known = self._transferable(key, within)
        if known is None:
            self.computed += 1
            trace = Trace(checker)
            with trace.recording():
                result = compute()
            known = _Known(
                surroundings=within.surroundings,
                trace=trace,
                result=result,
                checks=checker.checks - before,
            )
            if trace.is_whole:
                self._known.setdefault(key, []).append(known)
                self._questions += len(trace)
                self._evict_oldest()
        else:
            self.found += 1
            # Budgets count the checks of a computation even where it was reused.
            checker.checks = before + known.checks
        if outer is not None:
            outer.include(known.trace)
        found: Result = known.result
        return found

    def _transferable(self, key: str, within: _Within) -> _Known | None:
        """Result of another cell that is also valid here, or None."""
        entries = self._known.setdefault(key, [])
        self._known.move_to_end(key)
        # Queries that are repeated here belong to no computation, and to no budget.
        outer, Trace.current = Trace.current, None
        checker = within.scene.checker
        checks = checker.checks
        try:
            for known in reversed(entries):
                changed = known.surroundings.changed(within.surroundings)
                if known.trace.repeats_in(within.scene, changed):
                    return known
        finally:
            Trace.current, checker.checks = outer, checks
        return None

    def _evict_oldest(self) -> None:
        while self._questions > self._most and self._known:
            _, entries = self._known.popitem(last=False)
            self._questions -= sum(len(known.trace) for known in entries)


def memoized(key: str, scene: Scene, compute: Callable[[], Result]) -> Result:
    """Compute a result, or reuse that of a cell in which it is the same.

    Parameters
    ----------
    key : str
        Equal where the result depends only on the answers of the scene's checker; see
        :func:`fingerprint`.
    scene : Scene
    compute : callable
        Its result must not be changed afterwards.
    """
    if Memo.current is None or Trace.current is not None:
        return compute()
    return Memo.current.result(key, scene, compute)


def memoized_part(name: str, compute: Callable[[], Result], *args: Any) -> Result:
    """Compute a part of such a result, or reuse it where the whole cannot be reused.

    Parameters
    ----------
    name : str
        Of the computation.
    compute : callable
        Its result must not be changed afterwards.
    *args : array, number, text or state of a generator, or sequence of these
        All that it depends on besides the cell; only hashed while a memo is active.
    """
    if Memo.current is None:
        return compute()
    text = hashlib.sha256(repr(_plain(args)).encode()).hexdigest()
    return Memo.current.part(f"{name} {text}", compute)


def _plain(value: Any) -> Any:
    """Arrays as their bytes, in lists as deep as they were."""
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
