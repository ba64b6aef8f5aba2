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

from reachmap.errors import SceneError

_SINGLE_AXIS = ("revolute", "continuous", "prismatic")


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
    SceneError
        The text is no URDF, or a joint has more than one degree of freedom.
    """
    try:
        root = ET.fromstring(urdf)
    except ET.ParseError as error:
        raise SceneError(f"robot.urdf: not valid XML ({error})") from error
    if root.tag != "robot":
        raise SceneError(f"robot.urdf: expected a <robot> element, got <{root.tag}>")
    types: dict[str, str] = {}
    mimics: dict[str, Mimic] = {}
    problems: list[str] = []
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        if kind == "fixed":
            continue
        if kind not in _SINGLE_AXIS:
            problems.append(
                f"robot.urdf: joint {name!r} has type {kind!r}; "
                f"only fixed, {', '.join(_SINGLE_AXIS)} joints are supported"
            )
        types[name] = kind
        mimics.update(_mimic_of(joint, name))
        _bound_if_continuous(joint)
    if problems:
        raise SceneError(problems)
    changed = "continuous" in types.values()
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


def _bound_if_continuous(joint: ET.Element) -> None:
    if joint.get("type") != "continuous":
        return
    joint.set("type", "revolute")
    limit = joint.find("limit")
    if limit is None:
        # A revolute joint must state both; 0 stands for "not given".
        limit = ET.SubElement(joint, "limit", effort="0", velocity="0")
    limit.set("lower", repr(-math.pi))
    limit.set("upper", repr(math.pi))


def read_group(srdf: str, group: str) -> tuple[tuple[str, ...], tuple[str, str] | None]:
    """Joints of an SRDF group, and its chain (base link, tip link) if it has one.

    Raises
    ------
    SceneError
        There is no such group, or it names neither joints nor a chain.
    """
    try:
        root = ET.fromstring(srdf or "<robot/>")
    except ET.ParseError as error:
        raise SceneError(f"robot.srdf: not valid XML ({error})") from error
    groups = {g.get("name", ""): g for g in root.findall("group")}
    if group not in groups:
        raise SceneError(
            f"robot.group: no group {group!r} in the SRDF (groups: {sorted(groups)})"
        )
    joints = tuple(j.get("name", "") for j in groups[group].findall("joint"))
    chain = groups[group].find("chain")
    if chain is not None:
        return joints, (chain.get("base_link", ""), chain.get("tip_link", ""))
    if not joints:
        raise SceneError(
            f"robot.group: group {group!r} names neither joints nor a chain; "
            "give robot.joints instead"
        )
    return joints, None
