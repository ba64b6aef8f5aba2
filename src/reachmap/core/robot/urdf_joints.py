"""What the URDF text says that a Pinocchio model no longer tells.

Joint types and mimic joints are read from the XML, and continuous joints are given
bounds, so that every joint is one number (Pinocchio would use a cosine and a sine,
and a configuration would no longer be a vector of angles).
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from reachmap.cell.files.urdf import MOVING
from reachmap.cell.files.xml_text import parse_xml
from reachmap.errors import SceneError

# Stands in the engine's URDF for a bound that the robot's URDF does not give.
UNBOUNDED = 1e300


@dataclass(frozen=True, slots=True, kw_only=True)
class Mimic:
    """A joint that follows another: ``multiplier * position(joint) + offset``."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfJoints:
    """Joints of a URDF that move, by name.

    Attributes
    ----------
    text : str
        The URDF with continuous joints turned into revolute ones, ±π.
    types : mapping
        Original type: ``revolute``, ``continuous`` or ``prismatic``.
    mimics : mapping
        Joints that follow another joint.
    """

    text: str
    types: Mapping[str, str]
    mimics: Mapping[str, Mimic]


def read_urdf_joints(urdf: str) -> UrdfJoints:
    """Read the moving joints of a URDF and bound the continuous ones.

    Parameters
    ----------
    urdf : str
        URDF text.

    Raises
    ------
    CellError
        The text is not XML.
    SceneError
        It is no URDF, or a joint has more than one degree of freedom.
    """
    root = parse_xml(urdf, "robot.urdf")
    if root.tag != "robot":
        raise SceneError(f"robot.urdf: expected a <robot> element, got <{root.tag}>")
    types: dict[str, str] = {}
    changed = False
    mimics: dict[str, Mimic] = {}
    problems: list[str] = []
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        if kind == "fixed":
            continue
        if kind not in MOVING:
            problems.append(
                f"robot.urdf: joint {name!r} has type {kind!r}; "
                f"only fixed, {', '.join(MOVING)} joints are supported"
            )
        mimics.update(_mimic_of(joint, name))
        changed |= _drop_infinite(joint)
        types[name] = joint.get("type", "")
        changed |= _bound_if_continuous(joint)
    if problems:
        raise SceneError(problems)
    text = ET.tostring(root, encoding="unicode") if changed else urdf
    return UrdfJoints(text=text, types=types, mimics=mimics)


def _mimic_of(joint: ET.Element, name: str) -> Iterator[tuple[str, Mimic]]:
    mimic = joint.find("mimic")
    if mimic is not None:
        yield (
            name,
            Mimic(
                joint=mimic.get("joint", ""),
                multiplier=float(mimic.get("multiplier", 1.0)),
                offset=float(mimic.get("offset", 0.0)),
            ),
        )


def _drop_infinite(joint: ET.Element) -> bool:
    """Rewrite infinite numbers, which urdfdom refuses, as numbers not given.

    A revolute joint without either bound becomes a continuous one; another bound that
    is missing becomes ±UNBOUNDED. True if anything was rewritten.
    """
    rewritten = False
    for part in (e for e in joint if e.tag in ("limit", "dynamics")):
        for key in [k for k, text in part.items() if _is_infinite(text)]:
            rewritten = True
            sign = -1.0 if key == "lower" else 1.0
            part.set(key, repr(sign * UNBOUNDED) if key in ("lower", "upper") else "0")
    for part in joint.findall("safety_controller"):
        if any(_is_infinite(text) for text in part.attrib.values()):
            joint.remove(part)
            rewritten = True
    bounds = [(e.get("lower"), e.get("upper")) for e in joint.findall("limit")]
    if rewritten and bounds == [(repr(-UNBOUNDED), repr(UNBOUNDED))]:
        joint.set("type", joint.get("type", "").replace("revolute", "continuous"))
    return rewritten


def _is_infinite(text: str) -> bool:
    try:
        return math.isinf(float(text))
    except ValueError:
        return False


def _bound_if_continuous(joint: ET.Element) -> bool:
    if joint.get("type") != "continuous":
        return False
    joint.set("type", "revolute")
    limit = joint.find("limit")
    if limit is None:
        # A revolute joint must state both; 0 stands for "not given".
        limit = ET.SubElement(joint, "limit", effort="0", velocity="0")
    limit.set("lower", repr(-math.pi))
    limit.set("upper", repr(math.pi))
    return True
