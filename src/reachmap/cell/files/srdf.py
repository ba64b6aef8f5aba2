"""The parts of an SRDF that a cell uses: groups, states and disabled pairs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

from reachmap.cell.files.robot_text import parse_xml
from reachmap.cell.files.urdf import UrdfDescription
from reachmap.cell.text.messages import did_you_mean
from reachmap.errors import CellError


@dataclass(frozen=True, slots=True, kw_only=True)
class SrdfDescription:
    """Joint groups and named configurations of an SRDF.

    Attributes
    ----------
    groups : dict
        Group name to joint names.
    states : dict
        State name to joint positions [rad or m].
        What is not one finite number is left out.
    disabled_pairs : tuple of (str, str)
        Links whose collisions are ignored.
    disabled_links : tuple of str
        Links that are checked against no other link but those of `enabled_pairs`.
    enabled_pairs : tuple of (str, str)
    broken : dict
        State name to joints of the robot that have no value there, and why, in words.
    notes : tuple of str
        What is not used, in words.
    """

    groups: dict[str, tuple[str, ...]]
    states: dict[str, dict[str, float]]
    disabled_pairs: tuple[tuple[str, str], ...] = ()
    disabled_links: tuple[str, ...] = ()
    enabled_pairs: tuple[tuple[str, str], ...] = ()
    broken: dict[str, dict[str, str]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def ignores(self, first: str, second: str) -> bool:
        """Whether two links are not to be checked against each other."""
        ways = {(first, second), (second, first)}
        if ways & set(self.enabled_pairs):
            return False
        by_default = first in self.disabled_links or second in self.disabled_links
        return by_default or bool(ways & set(self.disabled_pairs))


def parse_srdf(text: str, label: str, robot: UrdfDescription) -> SrdfDescription:
    """Read groups, group states and disabled pairs of an SRDF text.

    Raises
    ------
    CellError
        The text is not an SRDF, or a pair lacks a link.
    """
    root = parse_xml(text, label)
    if root.tag != "robot":
        raise CellError(
            f"{label}: expected the root element <robot> (got <{root.tag}>)"
        )
    elements = {e.get("name", ""): e for e in root.findall("group")}
    groups = {
        name: tuple(dict.fromkeys(_group_joints(element, elements, robot, 0)))
        for name, element in elements.items()
    }
    faults: list[str] = []
    unread = dict.fromkeys(e.tag for e in root if e.tag not in _ELEMENTS)
    notes = [
        f"{label}: <{tag}> is not read; {did_you_mean(tag, _ELEMENTS)}"
        for tag in unread
    ]
    places = _places(root, text, label)
    broken: dict[str, dict[str, str]] = {}
    states = _states(root, robot, places, broken, notes)
    notes += [
        f"{why}; not used" for joints in broken.values() for why in joints.values()
    ]
    found = {
        tag: [
            tuple(_attribute(element, key, places[element], faults) for key in keys)
            for element in root.findall(tag)
        ]
        for tag, keys in _PAIR_ELEMENTS.items()
    }
    if faults:
        raise CellError(faults)
    named = {link for rows in found.values() for row in rows for link in row}
    unknown = sorted(named - set(robot.links))
    shown = ", ".join(unknown[:10]) + (", …" if len(unknown) > 10 else "")
    if unknown:
        notes.append(f"{label}: ignored, collisions of links not in the URDF: {shown}")
    return SrdfDescription(
        groups=groups,
        states=states,
        disabled_pairs=tuple((a, b) for a, b in found["disable_collisions"]),
        disabled_links=tuple(a for (a,) in found["disable_default_collisions"]),
        enabled_pairs=tuple((a, b) for a, b in found["enable_collisions"]),
        broken=broken,
        notes=tuple(notes),
    )


# All elements of the format, read or not.
_ELEMENTS = (
    *("group", "group_state", "end_effector", "virtual_joint", "passive_joint"),
    *("disable_collisions", "enable_collisions", "disable_default_collisions"),
    *("link_sphere_approximation", "joint_property"),
)
_PAIR_ELEMENTS = {
    "disable_collisions": ("link1", "link2"),
    "enable_collisions": ("link1", "link2"),
    "disable_default_collisions": ("link",),
}


def _places(
    root: ElementTree.Element, text: str, label: str
) -> dict[ElementTree.Element, str]:
    """File and line of the elements that faults are found in."""
    places = {}
    for tag in (*_PAIR_ELEMENTS, "group_state", "joint"):
        # ElementTree forgets lines; the n-th start tag outside comments is its own.
        starts = [
            match.start(1)
            for match in re.finditer(rf"<!--.*?-->|<({tag})(?=[\s/>])", text, re.DOTALL)
            if match[1]
        ]
        elements = list(root.iter(tag))
        exact = len(starts) == len(elements)
        for number, element in enumerate(elements):
            line = text.count("\n", 0, starts[number]) + 1 if exact else 0
            places[element] = f"{label}:{line}" if exact else label
    return places


def _attribute(
    element: ElementTree.Element, key: str, where: str, faults: list[str]
) -> str:
    value = element.get(key, "")
    if not value:
        faults.append(f"{where}: <{element.tag}> needs {key}")
    return value


def _group_joints(
    element: ElementTree.Element,
    groups: dict[str, ElementTree.Element],
    robot: UrdfDescription,
    depth: int,
) -> list[str]:
    """List the moving joints of a group: its joints, chains, links and groups."""
    names: list[str] = []
    for child in element:
        name = child.get("name", "")
        if child.tag == "joint":
            names.append(name)
        elif child.tag == "chain":
            base, tip = child.get("base_link", ""), child.get("tip_link", "")
            if base in robot.links and tip in robot.links:
                names.extend(robot.chain(base, tip))
        elif child.tag == "link":
            names.extend(j.name for j in robot.joints.values() if j.child == name)
        elif child.tag == "group" and name in groups and depth < 8:
            names.extend(_group_joints(groups[name], groups, robot, depth + 1))
    return [n for n in names if n in robot.joints and robot.joints[n].moves]


def _states(
    root: ElementTree.Element,
    robot: UrdfDescription,
    places: dict[ElementTree.Element, str],
    broken: dict[str, dict[str, str]],
    notes: list[str],
) -> dict[str, dict[str, float]]:
    """Joint positions by name of the state; several groups may have one of a name."""
    states: dict[str, dict[str, float]] = {}
    for element in root.findall("group_state"):
        name = element.get("name", "")
        values = states.setdefault(name, {})
        for joint, value in _state(element, robot, places, broken).items():
            if values.setdefault(joint, value) != value:
                notes.append(
                    f"{places[element]}: group_state {name!r} is given again with "
                    f"another value of {joint!r}; the first one counts"
                )
    return states


def _state(
    element: ElementTree.Element,
    robot: UrdfDescription,
    places: dict[ElementTree.Element, str],
    broken: dict[str, dict[str, str]],
) -> dict[str, float]:
    values: dict[str, float] = {}
    for joint in element.findall("joint"):
        name, text = joint.get("name", ""), joint.get("value", "")
        try:
            numbers = [float(word) for word in text.split()]
        except ValueError:
            numbers = []
        if len(numbers) == 1 and math.isfinite(numbers[0]):
            values[name] = numbers[0]
        elif name in robot.joints and robot.joints[name].moves:
            state = element.get("name", "")
            broken.setdefault(state, {})[name] = (
                f"{places[joint]}: group_state {state!r}: joint {name!r}: expected one "
                f"finite number (got {text[:40]!r})"
            )
        # Others are virtual or planar joints, which no arm plans for.
    return values


def srdf_text(name: str, pairs: Iterable[tuple[str, str]]) -> str:
    """SRDF that disables collisions of pairs of links."""
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(name)}>"]
    lines += [
        f"  <disable_collisions link1={quoteattr(first)} link2={quoteattr(second)} "
        'reason="Default"/>'
        for first, second in pairs
    ]
    return "\n".join([*lines, "</robot>", ""])
