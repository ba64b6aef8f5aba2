"""A cell as YAML text that :func:`reachmap.cell.loading.read_cell` reads back."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from reachmap.cell.model.cell import Cell

# A choice: cells read like the code around them.
WIDTH = 88
_PLAIN = re.compile(r"(package://)?[A-Za-z][A-Za-z0-9_/.-]*")
_WORDS = frozenset({"true", "false", "null", "yes", "no", "on", "off", "y", "n"})


def cell_yaml(cell: Cell, *, comment: str = "") -> str:
    """Write a cell as YAML.

    Values that are not set (null, empty tables) are left out; defaults are written,
    so that the text means the same under later versions.

    Parameters
    ----------
    cell : Cell
    comment : str, optional
        Lines that go on top.
    """
    head = [f"# {line}".rstrip() for line in comment.splitlines()]
    changed = cell.model_dump(mode="json", exclude_defaults=True)
    data = _without_empty(cell.model_dump(mode="json"), changed)
    mount = cell.robot.mount
    if mount is not None:
        # Both follow from the mount, which could not be changed beside them.
        del data["robot"]["base_pose"]
        data["bodies"] = [b for b in data["bodies"] if b["name"] != mount.name]
    return "\n".join([*head, *_mapping(data, 0)]) + "\n"


def scalar(value: Any) -> str:
    """Write one value on one line: flow style, which is JSON with fewer quotes."""
    if isinstance(value, dict):
        inside = ", ".join(f"{_key(k)}: {scalar(v)}" for k, v in value.items())
        return "{" + inside + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(scalar(item) for item in value) + "]"
    if isinstance(value, str):
        if _PLAIN.fullmatch(value) and value.lower() not in _WORDS:
            return value
        return json.dumps(value, ensure_ascii=not value.isprintable())
    if isinstance(value, float) and value.is_integer() and 0 < abs(value) < 1e15:
        return str(int(value))
    return json.dumps(value)


def _key(key: str) -> str:
    plain = key.replace("_", "").replace("-", "")
    fine = plain.isalnum() and plain.isascii() and not key.startswith("-")
    return key if fine else json.dumps(key, ensure_ascii=False)


def _without_empty(value: Any, changed: Any) -> Any:
    """Drop what is empty, unless that is not the default (``changed`` has it)."""
    if isinstance(value, dict):
        table = changed if isinstance(changed, dict) else {}
        kept = {key: _without_empty(v, table.get(key)) for key, v in value.items()}
        return {
            key: inner
            for key, inner in kept.items()
            if key in table or not (inner is None or inner in ({}, [], ""))
        }
    if isinstance(value, list):
        changes = changed if isinstance(changed, list) else [None] * len(value)
        return [_without_empty(v, c) for v, c in zip(value, changes, strict=True)]
    return value


def _mapping(data: dict[str, Any], indent: int) -> Iterator[str]:
    margin = " " * indent
    for key, value in data.items():
        line = f"{margin}{_key(key)}: {scalar(value)}"
        nested = isinstance(value, dict | list) and value
        if not nested or len(line) <= WIDTH or not _splits(value):
            yield line
        elif isinstance(value, dict):
            yield f"{margin}{_key(key)}:"
            yield from _mapping(value, indent + 2)
        else:
            yield f"{margin}{_key(key)}:"
            yield from _items(value, indent + 2)


def _items(items: list[Any], indent: int) -> Iterator[str]:
    margin = " " * indent
    for item in items:
        if not isinstance(item, dict):
            yield f"{margin}- {scalar(item)}"
            continue
        lines = list(_mapping(item, indent + 2))
        yield f"{margin}- {lines[0].lstrip()}"
        yield from lines[1:]


def _splits(value: Any) -> bool:
    """Whether a value may go over several lines: not a plain list of numbers."""
    if isinstance(value, dict):
        return True
    return any(isinstance(item, dict | list) for item in value)
