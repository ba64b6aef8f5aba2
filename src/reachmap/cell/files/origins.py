"""Origins in a URDF: where an element is, its orientation in one of two forms.

Orientations are roll, pitch and yaw, or from version 1.1 of the format a quaternion,
which is written as the former before anything is read.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from reachmap._typing import FloatArray
from reachmap.geometry import (
    rotation_from_quaternion_wxyz,
    rotation_from_rpy_deg,
    transform_from_parts,
)

Triple = tuple[float, float, float]
# Larger than a turn: many files write 6.28 or 6.2832 [rad].
_LARGEST_RAD = 6.4


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """``<origin>`` of an element [m, rad]."""

    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)

    @classmethod
    def of(cls, element: ElementTree.Element) -> Origin:
        """Read the origin of an element; its numbers must have been checked."""
        origin = element.find("origin")
        given = {} if origin is None else origin.attrib
        return cls(
            xyz=_triple(given.get("xyz", "0 0 0")),
            rpy=_triple(given.get("rpy", "0 0 0")),
        )

    def matrix(self) -> FloatArray:
        """Homogeneous matrix, shape (4, 4)."""
        R = rotation_from_rpy_deg(np.degrees(self.rpy))
        return transform_from_parts(R, np.array(self.xyz))


NO_ORIGIN = Origin()


def write_quaternions_as_rpy(
    root: ElementTree.Element, faults: list[str], notes: list[str]
) -> None:
    """Write the ``quat_xyzw`` of origins as ``rpy``, where the version has them.

    Parameters
    ----------
    root : Element
        The URDF, changed in place.
    faults, notes : list of str
        What is wrong, or not used, is added to them.
    """
    found = [e for e in root.iter("origin") if "quat_xyzw" in e.attrib]
    if found and not _has_quaternions(root.get("version", "1.0")):
        notes.append(
            "<origin quat_xyzw> is not read before version 1.1 of the format; write "
            '<robot version="1.1"> if it is to count'
        )
    for origin in found:
        text = origin.attrib.pop("quat_xyzw")
        if not _has_quaternions(root.get("version", "1.0")):
            continue
        q = finite_numbers(text, 4)
        if "rpy" in origin.attrib:
            faults.append("<origin>: has both rpy and quat_xyzw; only one can count")
        elif q is None or not any(q):
            faults.append(
                "<origin quat_xyzw>: expected 4 finite numbers, not all of them 0 "
                f"(got {text[:40]!r})"
            )
        else:
            R = rotation_from_quaternion_wxyz(np.array(q)[[3, 0, 1, 2]])
            origin.set("rpy", " ".join(map(repr, _rpy(R))))


def _has_quaternions(version: str) -> bool:
    numbers = re.match(r"(\d+)(?:\.(\d+))?", version)
    return numbers is not None and (int(numbers[1]), int(numbers[2] or 0)) >= (1, 1)


def _rpy(R: FloatArray) -> Triple:
    """Roll, pitch and yaw [rad] of a rotation Rz(yaw) Ry(pitch) Rx(roll)."""
    yaw = math.atan2(R[1, 0], R[0, 0])
    pitch = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    # Of what yaw leaves: exact also where the two turn about one axis.
    c, s = math.cos(yaw), math.sin(yaw)
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return roll, pitch, yaw


_NUMERIC = (
    ("origin", "xyz", 3),
    ("origin", "rpy", 3),
    ("axis", "xyz", 3),
)


def number_faults(root: ElementTree.Element) -> list[str]:
    """Origins and axes that are not three finite numbers, in words."""
    faults = []
    for tag, key, count in _NUMERIC:
        for element in root.iter(tag):
            text = element.get(key)
            if text is not None and finite_numbers(text, count) is None:
                faults.append(
                    f"<{tag} {key}>: expected {count} finite numbers "
                    f"(got {text[:40]!r})"
                )
    return faults


def angles_in_degrees(root: ElementTree.Element) -> list[str]:
    """Origins of joints and collision elements whose angles can hardly be radians."""
    places = [(f"joint {e.get('name')!r}", e) for e in root.findall("joint")]
    places += [
        (f"collision of link {link.get('name')!r}", e)
        for link in root.findall("link")
        for e in link.findall("collision")
    ]
    angles = [(place, Origin.of(element).rpy) for place, element in places]
    return [
        f"{place}: <origin rpy> is in radians (got {' '.join(f'{a:g}' for a in rpy)})"
        for place, rpy in angles
        if max(map(abs, rpy)) > _LARGEST_RAD
    ]


def finite_numbers(text: str, count: int) -> list[float] | None:
    """Numbers of an attribute; None unless there are ``count``, all of them finite."""
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return None
    return values if len(values) == count and all(map(math.isfinite, values)) else None


def _triple(text: str) -> Triple:
    x, y, z = (float(word) for word in text.split())
    return x, y, z
