"""Checks of single values of a grasp list: numbers, positions, orientations."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from reachmap.ranking.lists.json_text import JsonPath

# The largest length of a cell as well; numbers beyond it are in other units.
MAX_COORDINATE_M: Final = 100.0
# A shorter vector is a zero with rounding, and points nowhere.
MIN_DIRECTION: Final = 1e-6
ORIENTATIONS: Final = (
    "direction",
    "quaternion_wxyz",
    "quaternion_xyzw",
    "rotation_matrix",
)
POSE_KEYS: Final = ("position", *ORIENTATIONS)
NUMBER_KEYS: Final = (*POSE_KEYS, "score", "width", "object_id")

# Published files hold quaternions of length 0.99985 and matrices of three decimals.
NORM_WARNING: Final = 1e-3
NORM_LIMIT: Final = 1e-2
DETERMINANT_LIMIT: Final = 1e-3
ORTHOGONALITY_LIMIT: Final = 5e-3


@dataclass(slots=True)
class Findings:
    """Mistakes and warnings of one document, each with the path of its value."""

    mistakes: list[tuple[JsonPath, str]] = field(default_factory=list)
    warnings: list[tuple[JsonPath, str]] = field(default_factory=list)

    def mistake(self, path: JsonPath, message: str) -> None:
        """Record something that makes the document unusable."""
        self.mistakes.append((path, message))

    def warn(self, path: JsonPath, message: str) -> None:
        """Record something usable but suspicious."""
        self.warnings.append((path, message))


def plain_parts(
    value: Mapping[Any, Any], known: Collection[str], prefix: str = ""
) -> dict[str, Any]:
    """Entries of a foreign record that are to be copied through.

    Those whose names are not `known`, with a prefix, if they can be written as JSON:
    YAML has dates and numbers that are not finite, for example.
    """
    return {
        f"{prefix}{key}": part
        for key, part in value.items()
        if isinstance(key, str) and key not in known and _is_plain(part)
    }


def _is_plain(value: Any) -> bool:
    if isinstance(value, dict):
        return all(isinstance(k, str) and _is_plain(v) for k, v in value.items())
    if isinstance(value, list):
        return all(map(_is_plain, value))
    if isinstance(value, float):
        return math.isfinite(value)
    return value is None or isinstance(value, str | int)


def shown(value: Any) -> str:
    """Spell a value for a message: short, on one line, printable."""
    if isinstance(value, dict):
        return f"an object with {len(value)} keys"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    text = ascii(value) if isinstance(value, str) else repr(value)
    if isinstance(value, float):
        text = json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "…"


def number(value: Any) -> float | None:
    """Return a finite JSON number as float; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        result = float(value)
    except OverflowError:
        return None
    return result if math.isfinite(result) else None


def _vector(found: Findings, path: JsonPath, value: Any, n: int) -> list[float] | None:
    if isinstance(value, list) and len(value) == n:
        numbers = [number(item) for item in value]
        clean = [item for item in numbers if item is not None]
        if len(clean) == n:
            return clean
        bad = numbers.index(None)
        got = shown(value[bad])
        found.mistake((*path, bad), f"expected a finite number (got {got})")
        return None
    found.mistake(path, f"expected {n} numbers (got {shown(value)})")
    return None


def check_position(found: Findings, path: JsonPath, value: Any, scale: float) -> None:
    """Check three coordinates in units of ``scale`` metres."""
    vector = _vector(found, path, value, 3)
    if vector is None:
        return
    farthest = max(abs(item) for item in vector) * scale
    if farthest > MAX_COORDINATE_M:
        found.mistake(
            path,
            f"a coordinate of {farthest:.4g} m is beyond {MAX_COORDINATE_M:g} m; for "
            'millimetres give "units": {"length": "mm"}',
        )


def check_pose(found: Findings, path: JsonPath, value: Any, scale: float) -> None:
    """Check a pose object: a position and at most one orientation."""
    if not isinstance(value, dict):
        found.mistake(path, f"expected an object with position (got {shown(value)})")
        return
    for key in value:
        if key not in POSE_KEYS or key == "direction":
            allowed = ", ".join(key for key in POSE_KEYS if key != "direction")
            found.mistake((*path, key), f"unknown key; allowed are {allowed}")
    if "position" in value:
        check_position(found, (*path, "position"), value["position"], scale)
    else:
        found.mistake(path, "position is missing")
    check_orientation(found, path, value, ORIENTATIONS[1:], required=False)


def check_orientation(
    found: Findings,
    path: JsonPath,
    value: Mapping[str, Any],
    forms: tuple[str, ...],
    *,
    required: bool,
) -> None:
    """Check that one of the forms is given, and that it is a direction or rotation."""
    given = [key for key in forms if key in value]
    if len(given) > 1 or (required and not given):
        got = ", ".join(given) or "none"
        found.mistake(path, f"give exactly one of {', '.join(forms)} (got {got})")
    for key in given:
        where = (*path, key)
        if key == "rotation_matrix":
            _check_matrix(found, where, value[key])
        elif key == "direction":
            _check_direction(found, where, value[key])
        else:
            _check_quaternion(found, where, value[key])


def _check_direction(found: Findings, path: JsonPath, value: Any) -> None:
    vector = _vector(found, path, value, 3)
    if vector is not None and not MIN_DIRECTION <= math.hypot(*vector) < math.inf:
        length = math.hypot(*vector)
        found.mistake(
            path, f"a direction needs a finite length above 0 (got {length:g})"
        )


def _check_quaternion(found: Findings, path: JsonPath, value: Any) -> None:
    vector = _vector(found, path, value, 4)
    if vector is None:
        return
    error = abs(math.hypot(*vector) - 1.0)
    if error > NORM_LIMIT:
        length = math.hypot(*vector)
        found.mistake(
            path, f"a unit quaternion has length 1 ± {NORM_LIMIT} (got {length:.4g})"
        )
    elif error > NORM_WARNING:
        found.warn(path, f"length {math.hypot(*vector):.5f} instead of 1; normalised")


def _check_matrix(found: Findings, path: JsonPath, value: Any) -> None:
    if not isinstance(value, list) or len(value) != 3:
        found.mistake(path, f"expected 3 rows of 3 numbers (got {shown(value)})")
        return
    rows = [_vector(found, (*path, i), row, 3) for i, row in enumerate(value)]
    clean = [row for row in rows if row is not None]
    if len(clean) < 3:
        return
    R = np.array(clean)
    if np.abs(R).max() > 1.0 + NORM_LIMIT:
        found.mistake(path, f"not a rotation: an element is {np.abs(R).max():.4g}")
        return
    determinant = float(np.linalg.det(R))
    skew = float(np.abs(R.T @ R - np.eye(3)).max())
    if abs(determinant - 1.0) > DETERMINANT_LIMIT:
        mirror = " (a mirror image)" if determinant < 0 else ""
        found.mistake(
            path, f"a rotation has determinant +1 (got {determinant:.4g}{mirror})"
        )
    elif skew > ORTHOGONALITY_LIMIT:
        found.mistake(
            path, f"not a rotation: its columns are {skew:.2g} off a right angle"
        )
    elif skew > NORM_WARNING:
        found.warn(
            path, f"columns {skew:.2g} off a right angle; nearest rotation taken"
        )
