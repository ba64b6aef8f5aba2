"""Validation errors in words: where, what was expected, what was found."""

from __future__ import annotations

import difflib
import types
from collections.abc import Collection
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from reachmap.cell.model.fields import MAX_LENGTH_M, NAMES
from reachmap.cell.model.robot import ROLLS
from reachmap.cell.text.yaml_reader import Document, Location


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
    near = _nearest(word, choices)
    if near is not None:
        return f"did you mean {near!r}?"
    shown = ", ".join(choices[:20]) + (", …" if len(choices) > 20 else "")
    return f"known: {shown}"


def _nearest(word: str, choices: Collection[str]) -> str | None:
    near = difflib.get_close_matches(word, choices, n=1, cutoff=0.5)
    return near[0] if near else None


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


_EXPECTED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number of at most 18 digits",
    "int_from_float": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a mapping of names to values",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "none_required": "nothing",
}
_BOUNDS = {
    "greater_than": ("a number > {}", "gt"),
    "greater_than_equal": ("a number >= {}", "ge"),
    "less_than": ("a number < {}", "lt"),
    "less_than_equal": ("a number <= {}", "le"),
    "string_too_short": ("text of at least {} characters", "min_length"),
    "string_too_long": ("text of at most {} characters", "max_length"),
    "string_pattern_mismatch": ("text that matches {}", "pattern"),
}
# What patterns mean; others stand for themselves.
_PATTERNS = {
    NAMES: "a name of letters, digits, spaces and . + - _",
    ROLLS: "listed, free, or N-fold such as 2-fold",
}


def add_validation_errors(
    document: Document, error: ValidationError, model: type[BaseModel]
) -> None:
    """Add every problem of a pydantic error to the document as a mistake."""
    details = [
        (strip_tags(detail["loc"], document.data, detail["type"]), detail)
        for detail in error.errors(include_url=False)
    ]
    meant = {
        (*location[:-1], _nearest(str(location[-1]), known_keys(model, location[:-1])))
        for location, detail in details
        if detail["type"] == "extra_forbidden"
    }
    for location, detail in details:
        if detail["type"] == "missing" and location in meant:
            continue  # given under a misspelt name, which is reported
        if detail["type"] == "too_short" and any(
            inner[: len(location)] == location and len(inner) > len(location)
            for inner, _ in details
        ):
            continue  # pydantic counts only the entries that were right
        of_key = detail["type"] == "extra_forbidden"
        message = _sentence(detail, location, document.data, model)
        document.add(location, message, of_key=of_key)


def strip_tags(loc: tuple[str | int, ...], data: Any, kind: str) -> Location:
    """Remove from a pydantic ``loc`` the union tags, which the user never wrote."""
    kept: list[str | int] = []
    for index, part in enumerate(loc):
        inner = _member(data, part)
        if inner is not _ABSENT:
            kept.append(part)
            data = inner
        elif kind == "missing" and index == len(loc) - 1:
            kept.append(part)
    return tuple(kept)


_ABSENT = object()


def _member(data: Any, part: str | int) -> Any:
    if isinstance(data, dict) and part in data:
        return data[part]
    if isinstance(data, list) and isinstance(part, int) and part < len(data):
        return data[part]
    return _ABSENT


def _sentence(
    detail: ErrorDetails, location: Location, data: Any, model: type[BaseModel]
) -> str:
    kind, context = detail["type"], detail.get("ctx", {})
    found = f"(got {_short(detail['input'])})"
    if kind == "missing":
        return _missing(location, data)
    if kind == "extra_forbidden":
        hint = did_you_mean(str(location[-1]), known_keys(model, location[:-1]))
        return f"unknown key; {hint}"
    if kind in {"value_error", "assertion_error"}:
        return str(context.get("error", detail["msg"]))
    if kind in _EXPECTED:
        quotes = kind == "string_type" and isinstance(detail["input"], int | float)
        hint = "; write it in quotes" if quotes else ""
        return f"expected {_EXPECTED[kind]} {found}{hint}"
    if kind in _BOUNDS:
        pattern, key = _BOUNDS[kind]
        bound = context[key]
        if bound in _PATTERNS:
            return f"expected {_PATTERNS[bound]} {found}"
        words = pattern.format(f"{bound:g}" if isinstance(bound, float) else bound)
        metres = (
            "; lengths are in metres" if bound in (MAX_LENGTH_M, -MAX_LENGTH_M) else ""
        )
        return f"expected {words} {found}{metres}"
    if kind in {"too_short", "too_long"}:
        few = kind == "too_short"
        bound = context["min_length" if few else "max_length"]
        return (
            f"expected at {'least' if few else 'most'} {bound} "
            f"value{'' if bound == 1 else 's'} "
            f"(got {context['actual_length']})"
        )
    if kind in {"literal_error", "enum"}:
        return f"expected {context['expected']} {found}"
    if kind in {"union_tag_invalid", "union_tag_not_found"}:
        name = str(context["discriminator"]).strip("'")
        wanted = context.get("expected_tags", "'cone', 'list'")
        return f"expected a mapping with {name}: one of {wanted} {found}"
    return f"{detail['msg']} {found}"


def _missing(location: Location, data: Any) -> str:
    if isinstance(location[-1], int):
        for part in location[:-1]:
            data = _member(data, part)
        return f"a value is missing (got only {len(data)}: {_short(data)})"
    return "is missing"


def _short(value: Any) -> str:
    if value is None or isinstance(value, bool):
        return {None: "nothing", True: "true", False: "false"}[value]
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
