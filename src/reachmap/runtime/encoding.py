"""Results as JSON text, bit for bit: what a journal line holds.

Numbers keep every bit: a float that is not finite is written as the hexadecimal of
its eight bytes, an array as the base64 of its little-endian bytes with dtype and
shape. NumPy scalars come back as Python numbers, tuples as lists.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import struct
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

Json: TypeAlias = Any
"""None, bool, int, float, str, list or dict with str keys."""

ARRAY = "$array"
FLOAT = "$float"
DTYPES = frozenset(
    ["|b1", "|i1", "|u1", "<i2", "<u2", "<i4", "<u4", "<i8", "<u8", "<f2", "<f4", "<f8"]
)
MAX_SIZE = 2**40


def json_from_value(value: Any) -> Json:
    """Turn numbers, text, arrays and nests of them into JSON values.

    Parameters
    ----------
    value : None, bool, int, float, str, ndarray, sequence or mapping of these

    Returns
    -------
    Json
        What :func:`value_from_json` turns back into ``value``.

    Raises
    ------
    TypeError
        For anything else; a defect of the program, not of its input.

    Examples
    --------
    >>> json_from_value({"cost": float("inf")})
    {'cost': {'$float': '7ff0000000000000'}}
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        if math.isfinite(value):
            return value
        return {FLOAT: struct.pack(">d", value).hex()}
    if isinstance(value, np.ndarray):
        return _json_from_array(value)
    if isinstance(value, list | tuple):
        return [json_from_value(item) for item in value]
    if isinstance(value, Mapping):
        return {_checked_key(key): json_from_value(item) for key, item in value.items()}
    raise TypeError(f"no JSON form for a {type(value).__name__}")


def value_from_json(data: Json) -> Any:
    """Undo :func:`json_from_value`; arrays come back read-only.

    Raises
    ------
    ValueError
        When an array or float is not what :func:`json_from_value` writes.
    """
    if isinstance(data, list):
        return [value_from_json(item) for item in data]
    if not isinstance(data, dict):
        return data
    if ARRAY in data:
        return _array_from_json(data)
    if FLOAT in data:
        return _float_from_json(data[FLOAT])
    return {key: value_from_json(item) for key, item in data.items()}


def compact(data: Json) -> str:
    """JSON text on one line, without spaces; refuses NaN and infinities."""
    return json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def json_sha256(data: Json) -> str:
    """Sha256 of JSON data, whatever the order of its keys."""
    text = json.dumps(data, separators=(",", ":"), sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _json_from_array(array: np.ndarray[Any, Any]) -> Json:
    portable = array.astype(array.dtype.newbyteorder("<"), order="C", copy=False)
    if portable.dtype.str not in DTYPES:
        raise TypeError(f"no JSON form for an array of {array.dtype}")
    return {
        ARRAY: portable.dtype.str,
        "shape": list(array.shape),
        "data": base64.b64encode(portable.tobytes()).decode("ascii"),
    }


def _array_from_json(data: Mapping[str, Json]) -> np.ndarray[Any, Any]:
    shape, text = data.get("shape"), data.get("data")
    if data[ARRAY] not in DTYPES:
        raise ValueError(f"{data[ARRAY]!r} is not the dtype of an array")
    dtype = np.dtype(data[ARRAY])
    if not isinstance(shape, list) or not all(_is_size(size) for size in shape):
        raise ValueError(f"{shape!r} is not the shape of an array")
    raw = base64.b64decode(text if isinstance(text, str) else "", validate=True)
    if len(raw) != math.prod(shape) * dtype.itemsize:
        raise ValueError(f"{len(raw)} bytes do not fill an array {shape} of {dtype}")
    array = np.frombuffer(raw, dtype=dtype).reshape(shape)
    return array.astype(dtype.newbyteorder("="), copy=False)


def _float_from_json(text: Json) -> float:
    raw = bytes.fromhex(text) if isinstance(text, str) else b""
    if len(raw) != 8:
        raise ValueError(f"{text!r} is not a number")
    value: float = struct.unpack(">d", raw)[0]
    return value


def _is_size(size: Json) -> bool:
    return (
        isinstance(size, int) and not isinstance(size, bool) and 0 <= size <= MAX_SIZE
    )


def _checked_key(key: Any) -> str:
    if not isinstance(key, str) or key.startswith("$"):
        raise TypeError(f"{key!r} cannot be a key: text that does not start with '$'")
    return key
