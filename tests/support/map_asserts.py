"""Comparing records and trees, field by field, types included."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np


def assert_records_equal(
    a: Any, b: Any, where: str = "", skip: tuple[str, ...] = ()
) -> None:
    """Two records hold the same values in the same types; NaN equals NaN."""
    assert type(a) is type(b), where
    for item in dataclasses.fields(a):
        if item.name not in skip:
            assert_values_equal(
                getattr(a, item.name), getattr(b, item.name), f"{where}.{item.name}"
            )


def assert_values_equal(a: Any, b: Any, where: str) -> None:
    """Compare two values of a record."""
    if dataclasses.is_dataclass(a):
        assert_records_equal(a, b, where)
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, where
        np.testing.assert_array_equal(a, b, err_msg=where)
    elif isinstance(a, Mapping):
        assert list(a) == list(b), where
        for key, value in a.items():
            assert_values_equal(value, b[key], f"{where}[{key}]")
    else:
        assert a == b, where
