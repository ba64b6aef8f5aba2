"""The ``reachmap.grasps`` 1.x document: every rule of its schema, and of geometry.

The JSON Schema shipped beside this module describes the same format for editors and
producers; these checks also find what is physically impossible.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from reachmap.geometry import AXES
from reachmap.ranking.lists.fields import (
    ORIENTATIONS,
    Findings,
    check_orientation,
    check_pose,
    check_position,
    number,
    shown,
)
from reachmap.ranking.lists.json_text import JsonPath

FORMAT: Final = "reachmap.grasps"
# A choice against hostile input: the longest list we met had 12,000 grasps.
MAX_GRASPS: Final = 100_000
LENGTH_UNITS: Final[Mapping[str, float]] = {"m": 1.0, "mm": 1e-3}
QUADRANTS: Final = ("NE", "NW", "SE", "SW", None)

_ROOT_KEYS: Final = (
    "format",
    "format_version",
    "frame",
    "units",
    "approach_axis",
    "direction_convention",
    "bin_pose",
    "source",
    "grasps",
)
# What grasp sources call it, and what it is called here.
_ORDER = "name the order of its numbers: quaternion_wxyz or quaternion_xyzw"
_POSE = (
    "give a 4x4 matrix as position, its last column, and rotation_matrix, its upper "
    "left 3x3"
)
_ROLL = (
    "a direction leaves the roll open; to fix it give quaternion_wxyz, quaternion_xyzw "
    "or rotation_matrix"
)
_HINTS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("quaternion", "quat", "orientation"), _ORDER),
    **dict.fromkeys(("pose", "transform", "transformation", "matrix", "T"), _POSE),
    **dict.fromkeys(("roll", "roll_deg", "roll_rad", "angle", "yaw"), _ROLL),
    **dict.fromkeys(("point", "xyz", "translation", "center"), "called position here"),
    **dict.fromkeys(("approach", "approach_vector", "axis"), "called direction here"),
    "normal": 'called direction here, with "direction_convention": "outward_normal"',
    "rotation": "called rotation_matrix here, if it is one",
}
_GRASP_KEYS: Final = (
    "id",
    "position",
    *ORIENTATIONS,
    "score",
    "quadrant",
    "width",
    "object_id",
)


def check_document(document: Any) -> Findings:
    """Check a parsed document against format version 1.

    Parameters
    ----------
    document : object
        What the JSON parser returned.

    Returns
    -------
    Findings
        Every mistake, not only the first. Objects called ``reachmap``, the results
        of an earlier ranking, are accepted: they are dropped on reading.
    """
    found = Findings()
    if not isinstance(document, dict):
        found.mistake((), f"expected an object with grasps (got {shown(document)})")
        return found
    if not _is_native(document, found):
        return found
    _check_keys(found, (), document, _ROOT_KEYS)
    _check_header(found, document)
    scale = _length_scale(found, document)
    if "bin_pose" in document:
        check_pose(found, ("bin_pose",), document["bin_pose"], scale)
    _check_grasps(found, document.get("grasps", []), scale)
    return found


def _is_native(document: dict[str, Any], found: Findings) -> bool:
    missing = [key for key in ("format", "format_version", "frame", "grasps")
               if key not in document]  # fmt: skip
    if "format" in missing or len(missing) > 1:
        found.mistake((), f"not a {FORMAT} document: {', '.join(missing)} missing")
        return False
    for key in missing:
        remedy = ": bin, robot_base, world or a frame of the cell; there is no default"
        found.mistake((), f"{key} is missing{remedy if key == 'frame' else ''}")
    return True


def _check_keys(
    found: Findings, path: JsonPath, value: Mapping[str, Any], allowed: tuple[str, ...]
) -> None:
    for key in value:
        if key in allowed or key.startswith("x_") or (key == "reachmap"):
            continue
        hint = f"; {_HINTS[key]}" if path and key in _HINTS else ""
        found.mistake(
            (*path, key),
            f"unknown key{hint}; allowed are {', '.join(allowed)} and keys that begin "
            "with x_, which are copied through",
        )


def _check_choice(
    found: Findings, path: JsonPath, value: Any, allowed: tuple[Any, ...]
) -> None:
    if value not in allowed:
        names = ", ".join("null" if choice is None else choice for choice in allowed)
        found.mistake(path, f"expected one of {names} (got {shown(value)})")


def _check_header(found: Findings, document: Mapping[str, Any]) -> None:
    if document["format"] != FORMAT:
        found.mistake(
            ("format",), f"expected {FORMAT} (got {shown(document['format'])})"
        )
    version = document.get("format_version", "1.0")
    if not (isinstance(version, str) and re.fullmatch(r"1\.[0-9]+", version, re.ASCII)):
        found.mistake(
            ("format_version",),
            f'expected a string "1.N", this program reads version 1 '
            f"(got {shown(version)})",
        )
    frame = document.get("frame", "bin")
    if not isinstance(frame, str) or not frame:
        found.mistake(("frame",), f"expected the name of a frame (got {shown(frame)})")
    if "approach_axis" in document:
        axes = tuple(AXES)
        _check_choice(found, ("approach_axis",), document["approach_axis"], axes)
    if "direction_convention" in document:
        path, value = ("direction_convention",), document["direction_convention"]
        _check_choice(found, path, value, ("approach", "outward_normal"))
    if not isinstance(document.get("source", {}), dict):
        found.mistake(("source",), "expected an object (it is copied through)")


def _length_scale(found: Findings, document: Mapping[str, Any]) -> float:
    units = document.get("units", {})
    if not isinstance(units, dict):
        found.mistake(("units",), f"expected an object (got {shown(units)})")
        return 1.0
    for key, value in units.items():
        if key == "length":
            _check_choice(found, ("units", key), value, tuple(LENGTH_UNITS))
        elif key == "angle":
            _check_choice(found, ("units", key), value, ("rad", "deg"))
        else:
            found.mistake(("units", key), "unknown key; allowed are length, angle")
    length = units.get("length", "m")
    return LENGTH_UNITS.get(length, 1.0) if isinstance(length, str) else 1.0


def _check_grasps(found: Findings, grasps: Any, scale: float) -> None:
    if not isinstance(grasps, list):
        found.mistake(("grasps",), f"expected a list (got {shown(grasps)})")
        return
    if len(grasps) > MAX_GRASPS:
        found.mistake(
            ("grasps",), f"{len(grasps)} grasps in one list; the limit is {MAX_GRASPS}"
        )
        return
    for index, grasp in enumerate(grasps):
        path: JsonPath = ("grasps", index)
        if not isinstance(grasp, dict):
            found.mistake(path, f"expected an object (got {shown(grasp)})")
            continue
        _check_grasp(found, path, grasp, scale)


def _check_grasp(
    found: Findings, path: JsonPath, grasp: dict[str, Any], scale: float
) -> None:
    _check_keys(found, path, grasp, _GRASP_KEYS)
    if "position" in grasp:
        check_position(found, (*path, "position"), grasp["position"], scale)
    else:
        found.mistake(path, "position is missing")
    check_orientation(found, path, grasp, ORIENTATIONS, required=True)
    for key in ("id", "object_id"):
        if key in grasp and not _is_name(grasp[key]):
            got = shown(grasp[key])
            found.mistake((*path, key), f"expected text or an integer (got {got})")
    score = grasp.get("score")
    if score is not None and number(score) is None:
        found.mistake((*path, "score"), f"expected a number (got {shown(score)})")
    if "width" in grasp:
        width = number(grasp["width"])
        if width is None or width < 0:
            got = shown(grasp["width"])
            found.mistake((*path, "width"), f"expected a length >= 0 (got {got})")
    if "quadrant" in grasp:
        _check_choice(found, (*path, "quadrant"), grasp["quadrant"], QUADRANTS)


def _is_name(value: Any) -> bool:
    if isinstance(value, float):
        return value.is_integer()
    return isinstance(value, (str, int)) and not isinstance(value, bool)
