"""What a URDF says of links, joints, limits and collision shapes.

The joints of the same text later go to Pinocchio; faults are found here because this
reader can say what is wrong in a sentence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.files.collisions import (
    LinkShape,
    links_without_collision,
    read_collisions,
)
from reachmap.cell.files.origins import (
    NO_ORIGIN,
    Origin,
    angles_in_degrees,
    number_faults,
    write_quaternions_as_rpy,
)
from reachmap.cell.files.robot_text import parse_xml
from reachmap.errors import CellError
from reachmap.geometry import inverse_transform

# A choice against hostile input: the largest robot of example-robot-data has 130 links.
MAX_LINKS = 2_000
MOVING = ("revolute", "continuous", "prismatic")
# Of several degrees of freedom: held at zero beside the arm, refused in it.
FREE_JOINTS = ("floating", "planar")
JOINT_TYPES = (*MOVING, "fixed", *FREE_JOINTS)
GROUND = "universe"
# More than any wrist turns (900 degrees) [rad], or joint of an arm moves [rad/s], and
# less than what some write for no limit: degrees, as it seems.
_FAR, _FAST, _NO_LIMIT = 30.0, 50.0, 1e4
# Root elements of other formats that come as XML.
OTHER_ROOTS = {
    "mujoco": "this is MJCF (MuJoCo)",
    "mujocoinclude": "this is MJCF (MuJoCo)",
    "sdf": "this is SDF (Gazebo)",
    "gazebo": "this is SDF (Gazebo)",
    "COLLADA": "this is a mesh (COLLADA)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfJoint:
    """One joint. Limits are in rad or m, None where the URDF gives none.

    Accelerations and jerks are in URDFs from version 1.2 on; the lower one of
    acceleration and deceleration counts. Soft limits count, as they do for MoveIt;
    infinite ones are none. A joint that mimics another stands at
    ``multiplier * position(mimics) + offset``.
    """

    name: str
    type: str
    parent: str
    child: str
    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    acceleration: float | None = None
    jerk: float | None = None
    mimics: str | None = None
    multiplier: float = 1.0
    offset: float = 0.0
    origin: Origin = NO_ORIGIN

    @property
    def moves(self) -> bool:
        """Whether the joint has one independent degree of freedom."""
        return self.type in MOVING and self.mimics is None


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfDescription:
    """Links, joints and collision shapes of a URDF, in the order of the file.

    Attributes
    ----------
    links : tuple of str
    joints : dict
        Joint name to :class:`UrdfJoint`.
    root : str
        The link that is nobody's child.
    collisions : tuple of LinkShape
    visual_meshes : tuple of str
        Mesh references of visual elements, each once.
    links_without_collision : tuple of str
        Links that can be seen, but have no collision element.
    notes : tuple of str
        What is not used, in words.
    """

    name: str
    links: tuple[str, ...]
    joints: dict[str, UrdfJoint]
    root: str
    collisions: tuple[LinkShape, ...] = ()
    visual_meshes: tuple[str, ...] = ()
    links_without_collision: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def chain(self, base: str, tip: str) -> tuple[str, ...]:
        """List the moving joints on the way from one frame to another, base first.

        Frames are links, or joints, which stand for their child link. The way ends
        at the last ancestor that ``base`` and ``tip`` share.
        """
        return tuple(joint.name for joint in self.way(base, tip) if joint.moves)

    def way(self, base: str, tip: str) -> tuple[UrdfJoint, ...]:
        """List all joints between two frames, fixed ones included."""
        shared = {link for link, _ in self._way_up(base)}
        joints = []
        for link, joint in self._way_up(tip):
            if link in shared:
                break
            if joint is not None:
                joints.append(joint)
        return tuple(reversed(joints))

    def _way_up(self, frame: str) -> Iterator[tuple[str, UrdfJoint | None]]:
        """Yield each link from a frame to the root, with the joint above it."""
        above = {joint.child: joint for joint in self.joints.values()}
        is_joint = frame in self.joints and frame not in self.links
        link = self.joints[frame].child if is_joint else frame
        while (joint := above.get(link)) is not None:
            yield link, joint
            link = joint.parent
        yield link, None

    def fixed_to(self, link: str) -> dict[str, FloatArray]:
        """Poses (4, 4) in a link of all links that never move relative to it."""
        poses = {link: np.eye(4)}
        fixed = [joint for joint in self.joints.values() if joint.type not in MOVING]
        # A link may be reached from either side; each pass adds one or ends it.
        for _ in fixed:
            for joint in fixed:
                T = joint.origin.matrix()
                if joint.parent in poses and joint.child not in poses:
                    poses[joint.child] = poses[joint.parent] @ T
                elif joint.child in poses and joint.parent not in poses:
                    poses[joint.parent] = poses[joint.child] @ inverse_transform(T)
        return poses

    def leaves(self) -> tuple[str, ...]:
        """Links without children, in the order of the file."""
        parents = {joint.parent for joint in self.joints.values()}
        return tuple(link for link in self.links if link not in parents)


def parse_urdf(text: str, label: str) -> UrdfDescription:
    """Read the structure of a URDF.

    Raises
    ------
    CellError
        With one line for every fault: names given twice, unknown links, a cycle,
        limits that are not finite or not ordered.
    """
    root = parse_xml(text, label)
    if root.tag != "robot":
        hint = OTHER_ROOTS.get(root.tag.rpartition(":")[2])
        what = f"; {hint}, which is not read: export a URDF instead" if hint else ""
        raise CellError(
            f"{label}: expected the root element <robot> (got <{root.tag}>){what}"
        )
    if root.find("link") is None:
        hint = (
            "; an SRDF goes with --moveit-config"
            if root.find("group") is not None
            else ""
        )
        raise CellError(f"{label}: expected <link> elements (got none){hint}")
    faults, notes = list[str](), list[str]()
    write_quaternions_as_rpy(root, faults, notes)
    faults += number_faults(root)
    notes += angles_in_degrees(root) if not faults else []
    links = [element.get("name", "") for element in root.findall("link")]
    if faults:  # joints and collision elements need numbers
        raise CellError([f"{label}: {fault}" for fault in faults[:50]])
    joints = [_joint(element, faults, notes) for element in root.findall("joint")]
    joints = _with_leaders(joints, notes)
    faults += _repeated("link", links) + _repeated("joint", [j.name for j in joints])
    if max(len(links), len(joints)) > MAX_LINKS:
        raise CellError(f"{label}: more than {MAX_LINKS:,} links or joints")
    faults += _structure_faults(set(links), joints)
    collisions = read_collisions(root, faults)
    if faults:
        raise CellError([f"{label}: {fault}" for fault in faults[:50]])
    children = {joint.child for joint in joints}
    return UrdfDescription(
        name=root.get("name", ""),
        links=tuple(links),
        joints={joint.name: joint for joint in joints},
        root=next(link for link in links if link not in children),
        collisions=collisions,
        visual_meshes=tuple(
            dict.fromkeys(
                mesh.get("filename", "")
                for mesh in root.iterfind("link/visual/geometry/mesh")
            )
        ),
        links_without_collision=links_without_collision(root),
        notes=tuple(f"{label}: {note}" for note in notes),
    )


def _joint(
    element: ElementTree.Element, faults: list[str], notes: list[str]
) -> UrdfJoint:
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in JOINT_TYPES:
        faults.append(f"joint {name!r}: unknown type {kind!r}")
    parent, child = element.find("parent"), element.find("child")
    limit, mimic = element.find("limit"), element.find("mimic")
    bounded = kind in ("revolute", "prismatic")
    if bounded and limit is None and element.find("safety_controller") is None:
        faults.append(f"joint {name!r}: a {kind} joint needs <limit>")
    lower, upper = _bounds(element, name, faults, notes) if bounded else (None, None)
    velocity = _number(limit, "velocity", name, faults)
    if kind in ("revolute", "continuous") and _FAST < (velocity or 0.0) < _NO_LIMIT:
        notes.append(f"joint {name!r}: velocity is in rad/s (got {velocity:g})")
    rates = [
        _number(limit, key, name, faults)
        for key in ("acceleration", "deceleration", "jerk")
    ]
    factors = [
        default
        if (given := _number(mimic, key, name, faults, may_be_infinite=False)) is None
        else given
        for key, default in (("multiplier", 1.0), ("offset", 0.0))
    ]
    if kind in FREE_JOINTS:
        notes.append(f"joint {name!r} is {kind}; it is held at zero")
    if kind in MOVING:
        faults += _axis_faults(element, name)
        if name == GROUND:
            faults.append(
                f"joint {name!r}: Pinocchio keeps this name for the ground; rename "
                "the joint in a copy of the URDF"
            )
    return UrdfJoint(
        name=name,
        type=kind,
        parent="" if parent is None else parent.get("link", ""),
        child="" if child is None else child.get("link", ""),
        lower=lower,
        upper=upper,
        velocity=velocity,
        acceleration=min((a for a in rates[:2] if a and a > 0), default=None),
        jerk=rates[2],
        mimics=None if mimic is None else mimic.get("joint", ""),
        multiplier=factors[0],
        offset=factors[1],
        origin=Origin.of(element),
    )


def _with_leaders(joints: list[UrdfJoint], notes: list[str]) -> list[UrdfJoint]:
    """Make joints that mimic a fixed joint independent, as MoveIt does."""
    leaders = {joint.name for joint in joints if joint.type in MOVING}
    stray = {j.name for j in joints if j.mimics is not None and j.mimics not in leaders}
    notes += [
        f"joint {joint.name!r} mimics {joint.mimics!r}, which is not a moving joint; "
        "it is treated as an independent joint"
        for joint in joints
        if joint.name in stray
    ]
    return [replace(j, mimics=None) if j.name in stray else j for j in joints]


def _bounds(
    element: ElementTree.Element, name: str, faults: list[str], notes: list[str]
) -> tuple[float | None, float | None]:
    """Hard limits, narrowed by the soft limits as MoveIt does."""
    limit, soft = element.find("limit"), element.find("safety_controller")
    low, high = (
        # A limit that is left out is 0, one that is infinite is none.
        0.0 if limit is not None and key not in limit.attrib
        else _number(limit, key, name, faults)
        for key in ("lower", "upper")
    )  # fmt: skip
    if low is not None and high is not None and low > high:
        if element.find("mimic") is not None:
            # It moves as far as its leader, and many files are careless there.
            notes.append(f"joint {name!r}: limit {low:g} is above {high:g}; not used")
            return None, None
        faults.append(f"joint {name!r}: limit {low:g} is above {high:g}")
    widest = max(abs(low or 0.0), abs(high or 0.0))
    if element.get("type") == "revolute" and _FAR < widest < _NO_LIMIT:
        notes.append(f"joint {name!r}: limits are in radians (got {widest:g})")
    soft_low = _number(soft, "soft_lower_limit", name, faults)
    soft_high = _number(soft, "soft_upper_limit", name, faults)
    if (soft_low is None) != (soft_high is None):
        end = "soft_lower_limit" if soft_low is None else "soft_upper_limit"
        notes.append(f"joint {name!r}: no {end}, which MoveIt takes for 0")
    lows = [value for value in (low, soft_low) if value is not None]
    highs = [value for value in (high, soft_high) if value is not None]
    tight = max(lows, default=None), min(highs, default=None)
    if (
        (soft_low is not None or soft_high is not None)
        and tight[0] is not None
        and tight[1] is not None
        and tight[0] >= tight[1]
    ):
        notes.append(f"joint {name!r}: the soft limits leave no range and are not used")
        return low, high
    return tight


def full_turn(low: float | None, high: float | None) -> tuple[float, float]:
    """Range of a turning joint that lacks an end: one turn, about zero if it can be."""
    if low is None:
        low = -math.pi if high is None or high > -math.pi else high - 2 * math.pi
    if high is None:
        high = math.pi if low < math.pi else low + 2 * math.pi
    return low, high


def _axis_faults(element: ElementTree.Element, name: str) -> list[str]:
    axis = element.find("axis")
    # Without the element it is x; without numbers the element has no direction.
    text = "1 0 0" if axis is None else axis.get("xyz", "0 0 0")
    length = math.hypot(*map(float, text.split()))
    # Far from 1 its square is no longer a number that an engine can divide by.
    if 1e-9 < length < 1e9:
        return []
    return [f"joint {name!r}: <axis xyz>: expected a direction (got {text[:40]!r})"]


def _number(
    element: ElementTree.Element | None,
    key: str,
    joint: str,
    faults: list[str],
    *,
    may_be_infinite: bool = True,
) -> float | None:
    """Value of an attribute; None where it is not given or infinite."""
    text = None if element is None else element.get(key)
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isfinite(value):
        return value
    if math.isinf(value) and may_be_infinite:
        return None
    given = repr(text[:40])
    faults.append(f"joint {joint!r}: {key}: expected a finite number (got {given})")
    return None


def _repeated(kind: str, names: list[str]) -> list[str]:
    seen: set[str] = set()
    faults = []
    for name in names:
        if not name:
            faults.append(f"a {kind} has no name")
        elif name in seen:
            faults.append(f"{kind} {name!r} is given twice")
        seen.add(name)
    return faults


def _structure_faults(links: set[str], joints: list[UrdfJoint]) -> list[str]:
    """Faults of the tree: unknown links, two parents, no root, a cycle."""
    faults = []
    above: dict[str, str] = {}
    for joint in joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                faults.append(f"joint {joint.name!r}: unknown {role} link {link!r}")
        if joint.child in above:
            faults.append(f"link {joint.child!r} is the child of two joints")
        above[joint.child] = joint.parent
    roots = sorted(links - set(above))
    if len(roots) != 1:
        shown = ", ".join(roots[:5]) or "none"
        faults.append(f"expected one root link (got {len(roots)}: {shown})")
    for link in sorted(above):
        steps = 0
        while link in above and steps <= len(above):
            link, steps = above[link], steps + 1
        if steps > len(above):
            faults.append("the links form a cycle")
            break
    return faults
