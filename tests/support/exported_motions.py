"""Reads exported motions back, from their text alone."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Mapping

import numpy as np
from ruamel.yaml import YAML

from reachmap._typing import FloatArray

Reader = Callable[[str], list[FloatArray]]


def from_csv(text: str) -> list[FloatArray]:
    """Waypoints of each motion, (n, dof) each."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    motions: dict[tuple[str, ...], list[list[float]]] = {}
    for row in list(csv.reader(lines))[1:]:
        motions.setdefault(tuple(row[:4]), []).append([float(v) for v in row[7:]])
    return [np.array(way) for way in motions.values()]


def from_json(text: str) -> list[FloatArray]:
    """Waypoints of each motion."""
    return [np.array(one["configuration"]) for one in json.loads(text)["motions"]]


def from_joint_trajectory(text: str) -> list[FloatArray]:
    """Sampled positions of each message."""
    return [_positions(one) for one in _documents(text)]


def from_moveit(text: str) -> list[FloatArray]:
    """Sampled positions of each message."""
    return [_positions(one["joint_trajectory"]) for one in _documents(text)]


def from_urscript(text: str) -> list[FloatArray]:
    """Targets of ``movej`` of each function."""
    return _programs(text, r"def (\w+)\(\):(.*?)\nend", r"movej\(\[([^]]*)\]")


def from_krl(text: str) -> list[FloatArray]:
    """Targets of ``PTP`` of each subroutine, degrees in the file."""
    axes = r"PTP \{AXIS: ([^}]*)\}"
    return _programs(text, r"DEF (\w+)\(\)(.*?)\nEND", axes, degrees=True)


def from_rapid(text: str) -> list[FloatArray]:
    """Targets of ``MoveAbsJ`` of each procedure, degrees in the file."""
    axes = r"MoveAbsJ \[\[([^]]*)\]"
    return _programs(text, r"PROC (\w+)\(\)(.*?)ENDPROC", axes, degrees=True)


READERS: Mapping[str, Reader] = {
    "csv": from_csv,
    "json": from_json,
    "joint-trajectory": from_joint_trajectory,
    "moveit": from_moveit,
    "urscript": from_urscript,
    "krl": from_krl,
    "rapid": from_rapid,
}


def _documents(text: str) -> list[dict]:
    # One JSON object a document, which is faster to read than YAML.
    bodies = [
        "\n".join(line for line in part.splitlines() if not line.startswith("#"))
        for part in text.split("\n---\n")
    ]
    return [_yaml(body) for body in bodies if body.strip()]


def _yaml(body: str) -> dict:
    try:
        return dict(json.loads(body))
    except ValueError:
        return dict(YAML(typ="safe", pure=True).load(body))


def _positions(trajectory: dict) -> FloatArray:
    return np.array([point["positions"] for point in trajectory["points"]])


def _programs(
    text: str, routine: str, target: str, *, degrees: bool = False
) -> list[FloatArray]:
    motions = []
    for _, body in re.findall(routine, text, flags=re.DOTALL):
        rows = [
            [float(re.sub(r"^\s*A\d ", "", value)) for value in row.split(",")]
            for row in re.findall(target, body)
        ]
        motions.append(np.radians(rows) if degrees else np.array(rows))
    return motions
