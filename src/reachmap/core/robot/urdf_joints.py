"""The joints of a URDF as Pinocchio is given them, and those that follow others.

The text for the engine has no geometry (which is read elsewhere), a bound at each
end of each joint, so that every joint is one number (of a continuous joint Pinocchio
would make a cosine and a sine), and names of links that no joint shares.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass

from reachmap.cell.files.robot_text import parse_xml
from reachmap.cell.files.urdf import (
    FREE_JOINTS,
    MOVING,
    UrdfDescription,
    UrdfJoint,
    full_turn,
    parse_urdf,
)
from reachmap.errors import SceneError

# Joints and links are name spaces of their own in a URDF, and one in Pinocchio.
LINK_MARK = " (link)"
# Stands for the end that a sliding joint lacks [m]; the cell has to give it.
_FAR_M = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class MimicJoint:
    """A joint that mimics another: ``multiplier * position(leader) + offset``."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfJoints:
    """Joints of a URDF that move, by name.

    Attributes
    ----------
    text : str
        What Pinocchio is given.
    description : UrdfDescription
    joints : mapping
        Those that are not fixed.
    followers : mapping
        Joints that mimic another, with the leader that mimics nobody.
    """

    text: str
    description: UrdfDescription
    joints: Mapping[str, UrdfJoint]
    followers: Mapping[str, MimicJoint]


def read_urdf_joints(urdf: str) -> UrdfJoints:
    """Read the moving joints of a URDF and bound the continuous ones.

    Parameters
    ----------
    urdf : str
        URDF text.

    Raises
    ------
    CellError
        The text is no URDF.
    SceneError
        Joints mimic each other in a cycle.
    """
    description = parse_urdf(urdf, "robot.urdf")
    joints = {n: j for n, j in description.joints.items() if j.type in MOVING}
    problems = []
    followers = {}
    for name, joint in joints.items():
        if joint.mimics is not None:
            try:
                followers[name] = _mimic_joint(name, joints)
            except ValueError as error:
                problems.append(f"robot.urdf: joint {name!r}: {error}")
    if problems:
        raise SceneError(problems)
    text = _engine_text(urdf, description)
    return UrdfJoints(
        text=text, description=description, joints=joints, followers=followers
    )


def _mimic_joint(name: str, joints: Mapping[str, UrdfJoint]) -> MimicJoint:
    """Follow a chain of mimicking joints to the one that leads."""
    multiplier, offset, seen = 1.0, 0.0, [name]
    while (joint := joints[seen[-1]]).mimics is not None:
        if joint.mimics in seen:
            raise ValueError(f"circular mimics ({' → '.join(seen)} → …)")
        offset += multiplier * joint.offset
        multiplier *= joint.multiplier
        seen.append(joint.mimics)
    return MimicJoint(leader=seen[-1], multiplier=multiplier, offset=offset)


def _engine_text(urdf: str, description: UrdfDescription) -> str:
    root = parse_xml(urdf, "robot.urdf")
    # The engine refuses a robot without a name, and has a link of this name itself.
    root.set("name", root.get("name") or "robot")
    shared = {*description.links} & {*description.joints, "universe"}
    for link in root.findall("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
        if link.get("name") in shared:
            link.set("name", link.get("name", "") + LINK_MARK)
    for joint in root.findall("joint"):
        for tag in ("mimic", "safety_controller", "dynamics"):
            for part in joint.findall(tag):
                joint.remove(part)
        for tag in ("parent", "child"):
            end = joint.find(tag)
            if end is not None and end.get("link") in shared:
                end.set("link", end.get("link", "") + LINK_MARK)
        if joint.get("type") in FREE_JOINTS:
            joint.set("type", "fixed")
        if joint.get("type") in MOVING:
            _bound(joint, description.joints[joint.get("name", "")])
    return ET.tostring(root, encoding="unicode")


def _bound(element: ET.Element, joint: UrdfJoint) -> None:
    """Give both ends; the limits that count are merged from the description."""
    low, high = joint.lower, joint.upper
    if joint.type == "prismatic":
        low, high = (
            (-_FAR_M if low is None else low),
            (_FAR_M if high is None else high),
        )
    else:
        element.set("type", "revolute")
        low, high = full_turn(low, high)
    for limit in element.findall("limit"):
        element.remove(limit)
    ET.SubElement(
        element, "limit", effort="0", velocity="0", lower=repr(low), upper=repr(high)
    )
