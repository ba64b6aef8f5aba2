"""Which keys the cell model knows at a location, and which one was meant."""

from __future__ import annotations

import difflib
import types
from collections.abc import Collection
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

from reachmap.cell.yaml_text import Location


def known_keys(model: type[BaseModel], location: Location) -> tuple[str, ...]:
    """Keys that may stand in the mapping at ``location``, in the model's order.

    Empty where the location holds no mapping or one with free keys.
    """
    kinds: list[Any] = [model]
    for part in location:
        kinds = [inner for kind in kinds for inner in _step(kind, part)]
    keys = [
        name
        for kind in kinds
        if isinstance(kind, type) and issubclass(kind, BaseModel)
        for name in kind.model_fields
    ]
    return tuple(dict.fromkeys(keys))


def did_you_mean(word: str, choices: Collection[str]) -> str:
    """Sentence that names the nearest choice, or all of them."""
    if not choices:
        return ""
    choices = list(choices)
    near = difflib.get_close_matches(word, choices, n=1, cutoff=0.5)
    if near:
        return f"did you mean {near[0]!r}?"
    shown = ", ".join(choices[:20]) + (", …" if len(choices) > 20 else "")
    return f"known: {shown}"


def _alternatives(kind: Any) -> list[Any]:
    """Types behind Optional, Union and Annotated."""
    origin = get_origin(kind)
    if origin is Annotated:
        return _alternatives(get_args(kind)[0])
    if origin in (Union, types.UnionType):
        return [inner for arm in get_args(kind) for inner in _alternatives(arm)]
    return [kind]


def _step(kind: Any, part: str | int) -> list[Any]:
    """Types of the member ``part`` of a type."""
    origin, arguments = get_origin(kind), get_args(kind)
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        info = kind.model_fields.get(str(part))
        return _alternatives(info.annotation) if info else []
    if origin is dict:
        return _alternatives(arguments[1])
    if origin is tuple and isinstance(part, int):
        if arguments[-1] is Ellipsis:
            return _alternatives(arguments[0])
        return _alternatives(arguments[part]) if part < len(arguments) else []
    return []
