"""What differs between the cells that two maps were made from."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from reachmap.maps.records import Provenance


def cell_changes(
    before: Provenance, after: Provenance
) -> tuple[tuple[str, str, str], ...]:
    """Fields of the resolved cells that differ, with both values as JSON."""
    try:
        a, b = (
            dict(flat_json(json.loads(item.cell_resolved_json)))
            for item in (before, after)
        )
    except (ValueError, RecursionError):
        return ()
    return tuple(
        (key, a.get(key, "-"), b.get(key, "-"))
        for key in [*a, *(key for key in b if key not in a)]
        if a.get(key) != b.get(key)
    )


def flat_json(value: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Leaves of nested JSON as ``key.name.key`` and JSON text.

    Elements of a list go by their ``name`` if they have one, else by ``[0]``, …
    """
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from flat_json(item, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(value, list) and any(isinstance(i, dict | list) for i in value):
        for index, item in enumerate(value):
            name = item.get("name") if isinstance(item, Mapping) else None
            place = f".{name}" if isinstance(name, str) else f"[{index}]"
            yield from flat_json(item, f"{prefix}{place}")
    else:
        yield prefix, json.dumps(value)
