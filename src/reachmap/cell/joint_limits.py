"""MoveIt's ``joint_limits.yaml``: limits that tighten those of the URDF."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from reachmap.cell.yaml_text import Document, parse_yaml


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveItLimits:
    """Limits of one joint; None where the file sets none.

    Velocities in rad/s or m/s, accelerations in rad/s² or m/s², positions in rad
    or m.
    """

    velocity: float | None = None
    acceleration: float | None = None
    lower: float | None = None
    upper: float | None = None


def parse_joint_limits(text: str, source: str) -> dict[str, MoveItLimits]:
    """Read the ``has_*_limits`` / ``max_*`` pairs of a MoveIt file.

    Raises
    ------
    CellError
        Every mistake with file, line and column.
    """
    document = parse_yaml(text, source)
    data = document.data
    if not isinstance(data, dict) or not isinstance(data.get("joint_limits"), dict):
        document.add((), "expected a mapping joint_limits: {joint: {...}}")
        document.raise_mistakes()
    limits = {
        name: _one(document, name, entry)
        for name, entry in data["joint_limits"].items()
    }
    document.raise_mistakes()
    return limits


def _one(document: Document, name: str, entry: Any) -> MoveItLimits:
    location = ("joint_limits", name)
    if not isinstance(entry, dict):
        document.add(location, "expected a mapping")
        return MoveItLimits()

    def number(flag: str, key: str, *, positive: bool) -> float | None:
        if entry.get(flag) is not True:
            return None
        value: Any = entry.get(key)
        fine = isinstance(value, int | float) and not isinstance(value, bool)
        if not fine or not abs(value) < 1e6 or (positive and value <= 0):
            wanted = "a positive finite number" if positive else "a finite number"
            document.add((*location, key), f"expected {wanted} (got {value!r:.60})")
            return None
        return float(value)

    limits = MoveItLimits(
        velocity=number("has_velocity_limits", "max_velocity", positive=True),
        acceleration=number(
            "has_acceleration_limits", "max_acceleration", positive=True
        ),
        lower=number("has_position_limits", "min_position", positive=False),
        upper=number("has_position_limits", "max_position", positive=False),
    )
    lower, upper = limits.lower, limits.upper
    if lower is not None and upper is not None and lower >= upper:
        document.add(location, "min_position must be below max_position")
    return limits
