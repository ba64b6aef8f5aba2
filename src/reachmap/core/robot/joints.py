"""The joints of an arm: as Pinocchio is given them, what they follow, their limits.

The text for the engine has no geometry (which is read elsewhere), a bound at each
end of each joint, so that every joint is one number (of a continuous joint Pinocchio
would make a cosine and a sine), and names of links that no joint shares. Of the limits
of URDF and cell the tightest wins; those of a MoveIt file are part of a loaded cell.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.files.origins import write_quaternions_as_rpy
from reachmap.cell.files.robot_text import parse_xml
from reachmap.cell.files.urdf import (
    FREE_JOINTS,
    MOVING,
    UrdfDescription,
    UrdfJoint,
    full_turn,
    parse_urdf,
)
from reachmap.cell.model.cell import JointLimits
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
    # Older engines know no other version than the first.
    write_quaternions_as_rpy(root, [], [])
    root.attrib.pop("version", None)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitTable:
    """Limits of the joints that move; radians, or metres for a prismatic joint.

    Attributes
    ----------
    lower, upper : array, shape (dof,)
        Positions [rad].
    velocity : array, shape (dof,)
        Speeds [rad/s], times the cell's scaling.
    acceleration : array, shape (dof,)
        Accelerations [rad/s²], times the square of the cell's scaling.
    jerk : array, shape (dof,)
        Jerks [rad/s³], times the cube of the scaling; infinite where none is given.
    """

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray


def merge_limits(joints: Sequence[UrdfJoint], cell: JointLimits) -> LimitTable:
    """Intersect the limits of URDF and cell.

    Parameters
    ----------
    joints : sequence of UrdfJoint
        In chain order.
    cell : JointLimits
        Limits of the cell; ``position_deg`` is in metres for prismatic joints.

    Raises
    ------
    SceneError
        A limit is missing or empty, or names a joint that does not move.
    """
    problems = _unknown_names(joints, cell)
    rows = [_position(j, cell, problems) for j in joints]
    velocity = _rates(joints, cell.velocity_rad_s, "velocity", problems)
    acceleration = _rates(joints, cell.acceleration_rad_s2, "acceleration", problems)
    if problems:
        raise SceneError(problems)
    lower, upper = np.array(rows, float).reshape(-1, 2).T
    return LimitTable(
        lower=lower.copy(),
        upper=upper.copy(),
        velocity=velocity * cell.scaling,
        # A motion takes 1/scaling times as long, whichever of the two limits it,
        # if accelerations go with the square; so do the speed sliders of controllers.
        acceleration=acceleration * cell.scaling**2,
        jerk=_jerks(joints, cell.jerk_rad_s3) * cell.scaling**3,
    )


def _unknown_names(joints: Sequence[UrdfJoint], cell: JointLimits) -> list[str]:
    names = [j.name for j in joints]
    problems = []
    for field in (
        "position_deg",
        "velocity_rad_s",
        "acceleration_rad_s2",
        "jerk_rad_s3",
    ):
        given = getattr(cell, field)
        unknown = sorted(set(given) - set(names)) if isinstance(given, dict) else []
        problems += [
            f"robot.limits.{field}: {name!r} is not a joint that moves "
            f"(joints: {', '.join(names)})"
            for name in unknown
        ]
    return problems


def _position(
    joint: UrdfJoint, cell: JointLimits, problems: list[str]
) -> tuple[float, float]:
    turns = joint.type != "prismatic"
    bounds: list[tuple[float | None, float | None]] = []
    if joint.type != "continuous":
        bounds.append((joint.lower, joint.upper))
    if joint.name in cell.position_deg:
        factor = math.pi / 180 if turns else 1.0
        low_given, high_given = cell.position_deg[joint.name]
        bounds.append((factor * low_given, factor * high_given))
    low = max((b[0] for b in bounds if b[0] is not None), default=None)
    high = min((b[1] for b in bounds if b[1] is not None), default=None)
    if turns and low is None and high is None:
        low, high = full_turn(low, high)
    if low is None or high is None:
        problems.append(
            f"robot.limits.position_deg: joint {joint.name!r} has no limit in the URDF "
            "on one side at least; give it [low, high] here"
        )
        return math.nan, math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        unit = "rad" if turns else "m"
        problems.append(
            f"robot.limits: joint {joint.name!r} has no range left "
            f"(lower {low:.6g}, upper {high:.6g} {unit}){_left_out(joint)}"
        )
    return low, high


def _left_out(joint: UrdfJoint) -> str:
    if joint.lower == joint.upper == 0:
        return "; ends that the URDF's <limit> leaves out are 0"
    return ""


def _jerks(
    joints: Sequence[UrdfJoint], given: float | Mapping[str, float] | None
) -> FloatArray:
    rows = []
    for joint in joints:
        own = given.get(joint.name) if isinstance(given, Mapping) else given
        rows.append(min(_known([own, joint.jerk]), default=math.inf))
    return np.array(rows, float)


def _known(limits: Sequence[float | None]) -> list[float]:
    """Limits that are given: many files have a 0 where nothing is known."""
    return [c for c in limits if c is not None and math.isfinite(c) and c > 0]


def _rates(
    joints: Sequence[UrdfJoint],
    given: float | Mapping[str, float] | None,
    what: str,
    problems: list[str],
) -> FloatArray:
    values, missing = [], []
    for joint in joints:
        own = given.get(joint.name) if isinstance(given, Mapping) else given
        known = _known([getattr(joint, what), own])
        if not known:
            missing.append(joint.name)
        values.append(min(known, default=math.nan))
    if missing:
        field = "velocity_rad_s" if what == "velocity" else "acceleration_rad_s2"
        problems.append(
            f"robot.limits.{field}: no {what} limit for {', '.join(missing)}; "
            f"give one number for all joints or one per joint"
        )
    return np.array(values, float)
