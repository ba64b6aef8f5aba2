"""Values as JSON: plain, readable, flattened to named leaves; hashed as one text."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Convert a value to JSON types: NumPy scalars, arrays and tuples become plain.

    Raises
    ------
    TypeError
        For anything else, so that nothing unforeseen slips into a checksum.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    raise TypeError(f"{type(value).__name__} has no plain form")


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


def canonical_json(value: Any) -> str:
    """Write a value as the one JSON text for it: keys sorted, no spaces, no NaN.

    Examples
    --------
    >>> canonical_json({"b": (1, 2.5), "a": "é"})
    '{"a":"é","b":[1,2.5]}'
    """
    return json.dumps(
        plain(value),
        sort_keys=True,
        separators=(",", ":"),
        ensure_ascii=False,
        allow_nan=False,
    )


def config_sha256(
    *,
    kind: str,
    cell_sha256: str,
    seed: int,
    settings: Mapping[str, Any],
    method: str = "",
    source_sha256: str = "",
) -> str:
    """Hash of everything that determines a result.

    Parameters
    ----------
    kind : str
        What is made, as in ``"bin_map"``.
    cell_sha256 : str
        Of the cell's contents, not of paths on one machine.
    seed : int
    settings : mapping
        Whatever else the result depends on: repeats, planner, checking. Never the
        number of workers, names of files or limits on time.
    method : str
    source_sha256 : str
        ``content_sha256`` of the artefact this one is made from.
    """
    facts = {
        "kind": kind,
        "cell_sha256": cell_sha256,
        "seed": seed,
        "settings": settings,
        "method": method,
        "source_sha256": source_sha256,
    }
    return hashlib.sha256(canonical_json(facts).encode()).hexdigest()
