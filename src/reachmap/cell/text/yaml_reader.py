"""YAML text to plain data with the line and column of every value.

Only what a cell file needs is read: mappings with text keys, lists and scalars of
the YAML 1.2 core schema. Anchors, aliases, merge keys and all tags but units that the
caller allows are refused, so that no text can grow, recurse or name a Python type.
``ruamel.yaml`` scans and parses; the tree is built here from its events, which keeps
all marks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NoReturn

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from reachmap.cell.text.data import at, text_at
from reachmap.errors import CellError

# A choice against hostile input: the shipped cells have up to 6,300 bytes, 300 values
# and 5 levels.
MAX_TEXT_BYTES = 256_000
MAX_DEPTH = 24
MAX_VALUES = 20_000

Location = tuple[str | int, ...]

_NULL = frozenset({"", "~", "null", "Null", "NULL"})
_BOOL = {"true": True, "True": True, "TRUE": True} | {
    "false": False,
    "False": False,
    "FALSE": False,
}
_INT = re.compile(r"[-+]?[0-9]{1,400}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]{1,9})?")
_INF = re.compile(r"([-+]?)\.(inf|Inf|INF)")
_NAN = frozenset({".nan", ".NaN", ".NAN"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a value was written: a file and a 1-based line and column.

    ``line`` 0 means that the whole of ``source`` is meant (an override, say).
    """

    source: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        if self.line:
            return f"{self.source}:{self.line}:{self.column}"
        return self.source


@dataclass(frozen=True, slots=True, kw_only=True)
class Mistake:
    """One thing that is wrong, where it is written, and what was expected."""

    place: Place
    message: str
    location: Location = ()

    def text(self, data: Any) -> str:
        """The mistake in one line, with the names that entries of lists have."""
        path = spelled(self.location, data)
        return f"{self.place}: {path + ': ' if path else ''}{self.message}"


def spelled(location: Location, data: Any) -> str:
    """Path as people read it; an entry of a list goes by its name if it has one.

    >>> spelled(("bodies", 0, "pose"), {"bodies": [{"name": "post", "pose": 1}]})
    'bodies[post].pose'
    """
    path = ""
    for part in location:
        data = at(data, part)
        name = text_at(data, "name") if isinstance(part, int) else None
        path += f"[{name}]" if name else f".{part}"
    return path.removeprefix(".")


def is_within(path: str, outer: str) -> bool:
    """Whether a path as people read it is another one, or leads further.

    >>> is_within("bin.pose.xyz", "bin.pose"), is_within("bin.poses", "bin.pose")
    (True, False)
    """
    return path == outer or path.startswith((f"{outer}.", f"{outer}["))


@dataclass(slots=True, kw_only=True)
class Document:
    """Data of one YAML text with the place of every value and key.

    Attributes
    ----------
    data : object
        Dicts, lists, text, numbers, booleans and None.
    places, key_places : dict
        Location (path of keys and indices) to the place of the value or its key.
    mistakes : list of Mistake
        Duplicate keys and other things that do not stop the reading.
    """

    source: str
    data: Any = None
    places: dict[Location, Place] = field(default_factory=dict)
    key_places: dict[Location, Place] = field(default_factory=dict)
    mistakes: list[Mistake] = field(default_factory=list)
    _moved: dict[Location, Location] = field(default_factory=dict)

    def copy(self) -> Document:
        """A document that may be changed on its own."""
        return Document(
            source=self.source,
            data=deepcopy(self.data),
            places=dict(self.places),
            key_places=dict(self.key_places),
            mistakes=list(self.mistakes),
            _moved=dict(self._moved),
        )

    def move(self, written: Location, location: Location) -> None:
        """Take what is written at one location for what is at another from now on."""
        for places in (self.places, self.key_places):
            for inner in [k for k in places if k[: len(written)] == written]:
                places[(*location, *inner[len(written) :])] = places[inner]
        self._moved[location] = written

    def _as_written(self, location: Location) -> Location:
        for moved, written in self._moved.items():
            if location[: len(moved)] == moved:
                return (*written, *location[len(moved) :])
        return location

    def place(self, location: Location, *, of_key: bool = False) -> Place:
        """Place of a value, or of the nearest enclosing value that was written."""
        if of_key and location in self.key_places:
            return self.key_places[location]
        for length in range(len(location), -1, -1):
            if location[:length] in self.places:
                return self.places[location[:length]]
        return Place(source=self.source)

    def add(self, location: Location, message: str, *, of_key: bool = False) -> None:
        """Record a mistake at a location."""
        place = self.place(location, of_key=of_key)
        written = self._as_written(location)
        self.mistakes.append(Mistake(place=place, location=written, message=message))

    def raise_mistakes(self) -> None:
        """Raise CellError with every mistake recorded, in the order of the file."""
        if not self.mistakes:
            return
        ordered = sorted(
            self.mistakes, key=lambda m: (m.place.source, m.place.line, m.place.column)
        )
        raise CellError(dict.fromkeys(one.text(self.data) for one in ordered))


def read_text(path: Path, *, limit: int) -> str:
    """Read a UTF-8 text file of bounded size; CellError names the file."""
    data = read_bytes(path, limit=limit)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise CellError(
            f"{path}:{line}:1: expected UTF-8 text (got byte 0x{data[error.start]:02x})"
        ) from None


def read_bytes(path: Path, *, limit: int) -> bytes:
    """Read a regular file of bounded size; CellError names the file."""
    data = problem = None
    try:
        if path.is_file():
            with path.open("rb") as stream:
                data = stream.read(limit + 1)
        else:
            problem = "is a folder" if path.is_dir() else "no such file"
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        problem = f"cannot be read ({reason})"
    if data is None:
        raise CellError(f"{path}: {problem}")
    if len(data) > limit:
        raise CellError(f"{path}: larger than the limit of {limit:,} bytes")
    return data


def parse_yaml(
    text: str, source: str, tags: Mapping[str, Callable[[float], float]] | None = None
) -> Document:
    """Parse one YAML document.

    Parameters
    ----------
    text : str
    source : str
        Name used in error messages.
    tags : mapping, optional
        Tags that numbers may have, ``!degrees`` for example, to what they mean.

    Raises
    ------
    CellError
        The text is not YAML, or uses a construct that is refused.
    """
    if len(text) > MAX_TEXT_BYTES:
        raise CellError(f"{source}: larger than the limit of {MAX_TEXT_BYTES:,} bytes")
    return _parse(text, source, tags) if tags else _parsed(text, source).copy()


@lru_cache(maxsize=4)
def _parsed(text: str, source: str) -> Document:
    """A study reads the same text for each of its variants."""
    return _parse(text, source, {})


def _parse(
    text: str, source: str, tags: Mapping[str, Callable[[float], float]]
) -> Document:
    document = Document(source=source)
    try:
        _Builder(document, tags).build(YAML(typ="safe", pure=True).parse(text))
    except CellError:
        raise  # a ValueError too, which the last clause would wrap
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(source=source)
        if mark is not None:
            place = Place(source=source, line=mark.line + 1, column=mark.column + 1)
        problem = error.problem or error.context or "cannot be parsed"
        raise CellError(f"{place}: not valid YAML: {problem}") from None
    except (YAMLError, ValueError, IndexError, AssertionError, TypeError) as error:
        # ruamel's scanner raises bare builtin errors on some malformed texts
        # (a directive cut short, an impossible code point).
        first = str(error).strip().splitlines()
        reason = first[0] if first else type(error).__name__
        raise CellError(f"{source}: not valid YAML: {reason}") from None
    return document


def scalar_value(text: str) -> str | int | float | bool | None:
    """Value of an unquoted scalar in the YAML 1.2 core schema.

    Examples
    --------
    >>> scalar_value("1e-3"), scalar_value("no"), scalar_value("012")
    (0.001, 'no', 12)
    """
    if text in _NULL:
        return None
    if text in _BOOL:
        return _BOOL[text]
    if _INT.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if match := _INF.fullmatch(text):
        return -math.inf if match[1] == "-" else math.inf
    return math.nan if text in _NAN else text


class _Builder:
    """Builds nested data from a stream of parser events."""

    def __init__(
        self, document: Document, tags: Mapping[str, Callable[[float], float]]
    ) -> None:
        self._document = document
        self._tags = tags
        self._count = 0

    def build(self, events: Iterator[Event]) -> None:
        """Fill the document from all events of the stream."""
        documents = 0
        for event in events:
            if isinstance(event, DocumentStartEvent):
                documents += 1
                if documents > 1:
                    self._refuse(event, "only one YAML document is allowed in a file")
                self._document.data = self._value(next(events), (), events, 0)
        if not documents:
            raise CellError(f"{self._document.source}: the file is empty")

    def _value(
        self, event: Any, location: Location, events: Iterator[Event], depth: int
    ) -> Any:
        self._check(event, depth)
        self._document.places[location] = self._place(event)
        if isinstance(event, ScalarEvent):
            if event.tag:
                return self._tagged(event)
            plain = event.implicit[0] and event.style is None
            return scalar_value(event.value) if plain else event.value
        if isinstance(event, SequenceStartEvent):
            return self._sequence(location, events, depth + 1)
        return self._mapping(location, events, depth + 1)

    def _tagged(self, event: Any) -> float:
        value = scalar_value(event.value)
        if isinstance(value, bool) or not isinstance(value, int | float):
            given = f"(got {event.value[:40]!r})"
            self._refuse(event, f"expected a number after {event.tag} {given}")
        return self._tags[str(event.tag)](value)

    def _sequence(
        self, location: Location, events: Iterator[Event], depth: int
    ) -> list[Any]:
        items: list[Any] = []
        while not isinstance(event := next(events), SequenceEndEvent):
            items.append(self._value(event, (*location, len(items)), events, depth))
        return items

    def _mapping(
        self, location: Location, events: Iterator[Event], depth: int
    ) -> dict[str, Any]:
        items: dict[str, Any] = {}
        while not isinstance(event := next(events), MappingEndEvent):
            self._check(event, depth)
            if not isinstance(event, ScalarEvent):
                self._refuse(event, "keys must be plain text")
            key = str(event.value)
            if key == "<<":
                self._refuse(event, "merge keys (<<) are not supported")
            inner = (*location, key)
            if key in items:
                place = self._place(event)
                message = (
                    f"key given twice (first at {self._document.key_places[inner]})"
                )
                self._document.mistakes.append(
                    Mistake(place=place, location=inner, message=message)
                )
                _Builder(Document(source=""), self._tags)._value(
                    next(events), (), events, depth
                )
                continue
            self._document.key_places[inner] = self._place(event)
            items[key] = self._value(next(events), inner, events, depth)
        return items

    def _check(self, event: Any, depth: int) -> None:
        self._count += 1
        if self._count > MAX_VALUES:
            self._refuse(event, f"more than {MAX_VALUES:,} values")
        if depth > MAX_DEPTH:
            self._refuse(event, f"nested more than {MAX_DEPTH} levels deep")
        if isinstance(event, AliasEvent) or getattr(event, "anchor", None):
            self._refuse(event, "anchors and aliases are not supported")
        tag = getattr(event, "tag", None)
        if not tag:
            return
        if str(tag) not in self._tags:
            others = f" other than {', '.join(self._tags)}" if self._tags else ""
            given = f"(got {str(tag)[:60]})"
            self._refuse(event, f"tags{others} are not supported {given}")
        if not isinstance(event, ScalarEvent):
            kind = "list" if isinstance(event, SequenceStartEvent) else "mapping"
            self._refuse(event, f"expected a number after {tag} (got a {kind})")

    def _place(self, event: Any) -> Place:
        mark = event.start_mark
        return Place(
            source=self._document.source, line=mark.line + 1, column=mark.column + 1
        )

    def _refuse(self, event: Any, message: str) -> NoReturn:
        raise CellError(f"{self._place(event)}: {message}")
