"""Looking into YAML data whose shape nobody has checked yet."""

from __future__ import annotations

from typing import Any


def at(data: Any, *location: str | int) -> Any:
    """Member of nested data at a location, None where there is none."""
    for part in location:
        if isinstance(data, list):
            data = dict(enumerate(data))
        if not isinstance(data, dict) or part not in data:
            return None
        data = data[part]
    return data


def text_at(data: Any, *location: str | int) -> str | None:
    """Text at a location, None where there is no text."""
    value = at(data, *location)
    return value if isinstance(value, str) else None


def entries(data: Any, *location: str | int) -> list[Any]:
    """List at a location, empty where there is none."""
    value = at(data, *location)
    return value if isinstance(value, list) else []
