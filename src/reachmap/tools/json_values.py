"""Values as JSON has them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from typing import Any

from reachmap.maps.tree import plain


def json_ready(value: Any) -> Any:
    """Plain values; keys that are states are their names, NaN and infinity are null.

    Examples
    --------
    >>> json_ready({"mean": float("nan"), "counts": (1, 2)})
    {'mean': None, 'counts': [1, 2]}
    """
    if isinstance(value, Mapping):
        return {
            key.name.lower() if isinstance(key, Enum) else str(key): json_ready(item)
            for key, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [json_ready(item) for item in value]
    value = plain(value)
    if isinstance(value, list):
        return [json_ready(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
