"""Strict JSON: no NaN, no repeated keys, and the line of every value."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from reachmap.errors import GraspListError

JsonPath: TypeAlias = tuple[str | int, ...]

# A choice: what fits on a screen.
MAX_LINES = 20
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*+"|[{}\[\],:]|[^\s{}\[\],:"]+')
_CONSTANTS = frozenset({"NaN", "Infinity", "-Infinity"})


@dataclass(slots=True)
class _Findings:
    """What the parser met that JSON readers usually accept."""

    repeated: bool = False
    not_finite: bool = False

    def object(self, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        self.repeated |= len(result) != len(pairs)
        return result

    def number(self, text: str) -> float:
        value = float(text)
        self.not_finite |= math.isinf(value)
        return value

    def constant(self, text: str) -> float:
        self.not_finite = True
        return math.nan


@dataclass(slots=True)
class _Level:
    """An open object or array while the tokens are walked."""

    is_object: bool
    index: int = 0
    key: str | None = None
    seen: set[str] = field(default_factory=set)


@dataclass(frozen=True, slots=True)
class _Value:
    """The first token of a value, and where it stands."""

    path: JsonPath
    line: int
    token: str
    repeated: bool


def parse_json(text: str, source: str, *, finite: bool = True) -> Any:
    """Parse JSON text, refusing what cannot be written back as JSON.

    Parameters
    ----------
    text : str
    source : str
        Name of the file in messages.
    finite : bool
        Whether NaN, Infinity and what is as large are refused.

    Raises
    ------
    GraspListError
        Wrong syntax, NaN or Infinity, a number too large for a double, a key that
        occurs twice in one object; with the line.
    """
    found = _Findings()
    try:
        value = json.loads(
            text,
            object_pairs_hook=found.object,
            parse_float=found.number,
            parse_constant=found.constant,
        )
    except json.JSONDecodeError as error:
        where = f"{source}:{error.lineno}:{error.colno}"
        raise GraspListError(f"{where}: not valid JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        # Integers of thousands of digits, and nesting deeper than the stack.
        raise GraspListError(f"{source}: not usable JSON: {error}") from None
    if found.repeated or (finite and found.not_finite):
        raise GraspListError(limited(_complaints(text, source)))
    return value


def _complaints(text: str, source: str) -> Iterator[str]:
    for value in _walk(text):
        where = f"{source}:{value.line}: {dotted(value.path)}"
        if value.repeated:
            yield f"{where}: the key occurs twice in one object; keep one"
        if value.token in _CONSTANTS or _overflows(value.token):
            yield f"{where}: expected a finite number (got {value.token[:40]})"


def _overflows(token: str) -> bool:
    try:
        return token[0] in "-0123456789" and math.isinf(float(token))
    except ValueError:
        return False


def dotted(path: Sequence[str | int]) -> str:
    """Spell a path as ``grasps[3].position``; the document itself is ``document``.

    >>> dotted(("grasps", 3, "position"))
    'grasps[3].position'
    """
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            name = part if part.isidentifier() else json.dumps(part)[:60]
            text += f".{name}" if text else name
    return text or "document"


def limited(lines: Iterable[str]) -> list[str]:
    """Return the first mistakes and a count of the others."""
    lines = list(lines)
    more = len(lines) - MAX_LINES
    return lines[:MAX_LINES] + ([f"… and {more} more mistakes"] if more > 0 else [])


def lines_of(text: str, paths: Iterable[JsonPath]) -> dict[JsonPath, int]:
    """Line of each path in the text; a missing value has the line of its parent.

    Parameters
    ----------
    text : str
        Valid JSON.
    paths : iterable of path

    Returns
    -------
    dict
        From path to line, counted from 1.
    """
    wanted = list(paths)
    prefixes = {path[:n] for path in wanted for n in range(len(path) + 1)}
    found: dict[JsonPath, int] = {}
    for value in _walk(text):
        if value.path in prefixes and value.path not in found:
            found[value.path] = value.line
            if len(found) == len(prefixes):
                break
    return {
        path: next(
            found[path[:n]] for n in range(len(path), -1, -1) if path[:n] in found
        )
        for path in wanted
    }


def _walk(text: str) -> Iterator[_Value]:
    """Yield every value of valid JSON text in order."""
    levels: list[_Level] = []
    line, done, repeated = 1, 0, False
    for match in _TOKEN.finditer(text):
        line += text.count("\n", done, match.start())
        done = match.start()
        token = match.group()
        top = levels[-1] if levels else None
        if token in "}]":
            levels.pop()
        elif token == ",":
            assert top is not None
            top.index, top.key = top.index + 1, None
        elif token == ":":
            continue
        elif top is not None and top.is_object and top.key is None:
            top.key = str(json.loads(token))
            repeated = top.key in top.seen
            top.seen.add(top.key)
        else:
            yield _Value(_path(levels), line, token, repeated)
            repeated = False
            if token in "{[":
                levels.append(_Level(is_object=token == "{"))


def _path(levels: list[_Level]) -> JsonPath:
    return tuple(
        (level.key or "") if level.is_object else level.index for level in levels
    )
