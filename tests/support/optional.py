"""What a record may lack, where a test knows that it is there."""

from __future__ import annotations

from typing import TypeVar

Value = TypeVar("Value")


def present(value: Value | None) -> Value:
    """Return the value itself; fail where there is none."""
    assert value is not None
    return value
