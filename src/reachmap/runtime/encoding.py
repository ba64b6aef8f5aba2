"""Payloads as JSON text, bit for bit, as stored in lines of the journal.

An array is written as the base64 of its little-endian bytes with dtype and shape, a
float that is not finite as Python's JSON does. NumPy scalars come back as Python
numbers, tuples as lists.
"""

from __future__ import annotations

import base64
import json
from typing import Any, TypeAlias

import numpy as np

Json: TypeAlias = Any
"""None, bool, int, float, str, list or dict with str keys."""

ARRAY = "$array"
KINDS = "biuf"  # of dtypes: bool, signed, unsigned, float


def encode(payload: Any) -> str:
    """Write numbers, text, arrays and nests of them as one line of ASCII.

    Raises
    ------
    TypeError
        For anything else; a defect of the program, not of its input.
    """
    return json.dumps(payload, separators=(",", ":"), default=_json_from_array)


def decode(text: str | bytes) -> Any:
    """Undo :func:`encode`; arrays come back read-only.

    Raises
    ------
    ValueError
        It is not what :func:`encode` writes.
    """
    try:
        return json.loads(text, object_hook=_from_object)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def _json_from_array(value: Any) -> Json:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray) and value.dtype.kind in KINDS:
        portable = value.astype(value.dtype.newbyteorder("<"), order="C", copy=False)
        return {
            ARRAY: portable.dtype.str,
            "shape": list(value.shape),
            "data": base64.b64encode(portable.tobytes()).decode("ascii"),
        }
    raise TypeError(f"no JSON form for a {type(value).__name__}")


def _from_object(data: dict[str, Json]) -> Any:
    if ARRAY not in data:
        return data
    try:
        dtype = np.dtype(str(data[ARRAY]))
        raw = base64.b64decode(data["data"], validate=True)
        array = np.frombuffer(raw, dtype).reshape(data["shape"])
    except (TypeError, LookupError, OverflowError) as error:
        raise ValueError(f"not an array: {error}") from None
    if dtype.kind not in KINDS or list(array.shape) != data["shape"]:
        raise ValueError(f"not an array of {data[ARRAY]!r} and {data['shape']!r}")
    return array.astype(dtype.newbyteorder("="), copy=False)
