"""MoveIt's ``joint_limits.yaml``: limits that tighten those of the URDF."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

from reachmap.cell.files.urdf import UrdfDescription
from reachmap.cell.text.yaml_reader import Document, parse_yaml
from reachmap.errors import CellError

MoveItLimits = dict[str, float | bool]
_RATES = (("velocity_rad_s", "velocity"), ("acceleration_rad_s2", "acceleration"))
_LARGEST = 1e6


def parse_joint_limits(text: str, source: str) -> dict[str, MoveItLimits]:
    """Read a MoveIt file.

    Returns
    -------
    dict
        Joint name to its ``has_*_limits`` and ``max_*``/``min_*`` entries, with
        only the limits that are switched on [rad/s, rad/s², rad; m for prismatic].

    Raises
    ------
    CellError
        Every mistake with file, line and column.
    """
    document = parse_yaml(text, source)
    data = document.data
    table = data.get("joint_limits") if isinstance(data, dict) else None
    if not isinstance(table, dict):
        place = document.place(())
        raise CellError(f"{place}: expected a mapping joint_limits: {{joint: {{…}}}}")
    limits = {name: _one(document, name, entry) for name, entry in table.items()}
    document.raise_mistakes()
    return limits


def _one(document: Document, name: str, entry: Any) -> MoveItLimits:
    location = ("joint_limits", name)
    if not isinstance(entry, dict):
        document.add(location, "expected a mapping")
        return {}
    limits: MoveItLimits = {}
    for kind, keys in (
        ("velocity", ("max_velocity",)),
        ("acceleration", ("max_acceleration",)),
        ("position", ("min_position", "max_position")),
    ):
        flag = f"has_{kind}_limits"
        if entry.get(flag) is not True:
            limits[flag] = False
            continue
        for key in keys:
            value = _number(entry.get(key), positive=kind != "position")
            if value is None:
                wanted = "a finite number" + (" > 0" if kind != "position" else "")
                message = f"expected {wanted} (got {entry.get(key)!r:.60})"
                document.add((*location, key), message)
            else:
                limits[flag] = True
                limits[key] = value
    low, high = limits.get("min_position"), limits.get("max_position")
    if low is not None and high is not None and low >= high:
        document.add(location, "min_position must be below max_position")
    return limits


def _number(value: Any, *, positive: bool) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    fine = abs(value) < _LARGEST and (value > 0 or not positive)
    return float(value) if fine else None


def tighten_limits(
    limits: dict[str, Any],
    table: Mapping[str, MoveItLimits],
    robot: UrdfDescription,
    moving: Collection[str],
) -> None:
    """Write the limits of a MoveIt file into ``robot.limits``; the tightest wins.

    Parameters
    ----------
    limits : dict
        ``robot.limits`` of the cell as plain data, changed in place.
    table : mapping
        As read by :func:`parse_joint_limits`; joints that do not move are left out.
    """
    for key, kind in _RATES:
        found = {
            joint: float(table[joint][f"max_{kind}"])
            for joint in moving
            if f"max_{kind}" in table.get(joint, {})
        }
        given = limits[key]
        if found and isinstance(given, float):
            given = dict.fromkeys(moving, given)
        for joint, value in found.items():
            given = {
                **(given or {}),
                joint: min(value, (given or {}).get(joint, value)),
            }
        limits[key] = given
    for joint in moving:
        file = table.get(joint, {})
        if "min_position" not in file or "max_position" not in file:
            continue
        turn = robot.joints[joint].type != "prismatic"
        pair = [float(file["min_position"]), float(file["max_position"])]
        low, high = (math.degrees(v) for v in pair) if turn else pair
        own = limits["position_deg"].get(joint, [low, high])
        limits["position_deg"][joint] = [max(low, own[0]), min(high, own[1])]
