"""MoveIt's ``joint_limits.yaml``: limits that tighten those of the URDF.

Read as MoveIt reads it: each side of a range counts separately, a number counts unless
its ``has_…_limits`` says no, ``!degrees`` and ``!radians`` are units.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from reachmap.cell.files.urdf import UrdfDescription, UrdfJoint, full_turn
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_reader import Document, parse_yaml
from reachmap.errors import CellError

MoveItLimits = dict[str, float | bool]
_RATES = (
    ("velocity_rad_s", "velocity"),
    ("acceleration_rad_s2", "acceleration"),
    ("jerk_rad_s3", "jerk"),
)
_READ = {
    "position": ("min_position", "max_position"),
    **{kind: (f"max_{kind}",) for _, kind in _RATES},
}
_KEYS = tuple(
    key for kind, keys in _READ.items() for key in (f"has_{kind}_limits", *keys)
)
# Say nothing that a map depends on.
_NEEDLESS = ("has_effort_limits", "max_effort", "angle_wraparound")
# Larger than any limit of a joint; a number beyond it is refused as a mistake.
_LARGEST = 1e6
_TAGS = {"!degrees": math.radians, "!radians": float}
# As yaml-cpp and rospy read them; YAML 1.2 knows only true and false.
_FLAGS = {"yes": True, "on": True, "true": True, "y": True} | {
    "no": False, "off": False, "false": False, "n": False,
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveItFile:
    """What a joint limits file says.

    Attributes
    ----------
    joints : dict
        Joint name to its ``has_*_limits`` and ``max_*``/``min_*`` entries, with
        only the limits that are switched on [rad, rad/s, rad/s², rad/s³; m for a
        prismatic joint].
    notes : tuple of str
        What is not used, in words.
    """

    joints: dict[str, MoveItLimits] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def parse_joint_limits(
    text: str, source: str, robot: UrdfDescription | None
) -> MoveItFile:
    """Read a MoveIt file, and note names that are not joints of the robot.

    Raises
    ------
    CellError
        Every mistake with file, line and column.
    """
    document = parse_yaml(text, source, _TAGS)
    data = document.data
    table = data.get("joint_limits") if isinstance(data, dict) else None
    if not isinstance(table, dict):
        place = document.place(())
        raise CellError(f"{place}: expected a mapping joint_limits: {{joint: {{…}}}}")
    limits = {name: _one(document, name, entry) for name, entry in table.items()}
    document.raise_mistakes()
    notes = _scaling_notes(document) + _unread_notes(document)
    known = limits if robot is None else robot.joints
    unknown = [name for name in limits if name not in known]
    if unknown:
        place = document.place(("joint_limits", unknown[0]), of_key=True)
        shown = ", ".join(unknown[:10]) + (", …" if len(unknown) > 10 else "")
        notes.append(f"{place}: ignored, not joints of the robot: {shown}")
    return MoveItFile(joints=limits, notes=tuple(notes))


def _scaling_notes(document: Document) -> list[str]:
    """Warn of scaling factors by which MoveIt would slow the arm down."""
    notes = []
    for kind in ("velocity", "acceleration"):
        key = f"default_{kind}_scaling_factor"
        value = document.data.get(key)
        if value is not None and value != 1:
            notes.append(
                f"{document.place((key,))}: {key}: {value!r:.20} is not applied; to "
                "slow the arm down set robot.limits.scaling in the cell"
            )
    return notes


def _unread_notes(document: Document) -> list[str]:
    """Warn of ignored keys of joints, each at its first occurrence."""
    places = {
        str(key): ("joint_limits", name, key)
        for name, entry in reversed(document.data["joint_limits"].items())
        for key in entry
        if key not in _KEYS and key not in _NEEDLESS
    }
    return [
        f"{document.place(location, of_key=True)}: {key} is not read; "
        f"{did_you_mean(key, _KEYS)}"
        for key, location in sorted(places.items())
    ]


def _one(document: Document, name: str, entry: Any) -> MoveItLimits:
    location = ("joint_limits", name)
    if not isinstance(entry, dict):
        document.add(location, "expected a mapping")
        return {}
    limits: MoveItLimits = {}
    for kind, keys in _READ.items():
        flag = f"has_{kind}_limits"
        given = entry.get(flag, any(key in entry for key in keys))
        on = _FLAGS.get(str(given).lower())
        if on is None:
            document.add((*location, flag), f"expected true or false (got {given!r})")
        limits[flag] = bool(on)
        if on and not any(key in entry for key in keys):
            document.add(location, f"{flag} needs {' or '.join(keys)}")
        for key in keys if on else ():
            if key not in entry:
                continue
            value = _number(entry.get(key), positive=kind != "position")
            if value is None:
                wanted = "a finite number" + (" > 0" if kind != "position" else "")
                message = f"expected {wanted} (got {entry.get(key)!r:.60})"
                document.add((*location, key), message)
            else:
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
) -> list[str]:
    """Write the limits of a MoveIt file into ``robot.limits``; the tightest wins.

    Joints that are left without a range are reported.

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
        given = limits.get(key)
        if found and isinstance(given, float):
            given = dict.fromkeys(moving, given)
        for joint, value in found.items():
            given = {
                **(given or {}),
                joint: min(value, (given or {}).get(joint, value)),
            }
        limits[key] = given
    problems: list[str] = []
    for joint in moving:
        file = table.get(joint, {})
        if "min_position" not in file and "max_position" not in file:
            continue
        turns = robot.joints[joint].type != "prismatic"
        low, high = _range(file, robot.joints[joint])
        if low is None or high is None:
            continue  # a slide with one end; the model asks for the other
        pair = [math.degrees(low), math.degrees(high)] if turns else [low, high]
        own = limits["position_deg"].get(joint, pair)
        low, high = max(pair[0], own[0]), min(pair[1], own[1])
        limits["position_deg"][joint] = [low, high]
        if not low < high:
            unit = "deg" if turns else "m"
            problems.append(
                f"joint {joint!r}: no range is left of that in the URDF or "
                f"robot.limits (lower {low:.6g}, upper {high:.6g} {unit})"
            )
    return problems


def _range(file: MoveItLimits, joint: UrdfJoint) -> tuple[float | None, float | None]:
    """Ends of the file, or of the URDF where the file gives none [rad or m]."""
    low = file.get("min_position", joint.lower)
    high = file.get("max_position", joint.upper)
    return (low, high) if joint.type == "prismatic" else full_turn(low, high)
