"""The parts of an SRDF that a cell uses: groups, states and disabled pairs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

from reachmap.cell.files.robot_text import parse_xml
from reachmap.cell.files.urdf import UrdfDescription
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
        Those of joints with several values, as virtual ones have, are left out.
    disabled_pairs : tuple of (str, str)
        Links whose collisions are ignored.
    disabled_links : tuple of str
        Links that are checked against no other link but those of `enabled_pairs`.
    enabled_pairs : tuple of (str, str)
    notes : tuple of str
        What is not used, in words.
    """

    groups: dict[str, tuple[str, ...]]
    states: dict[str, dict[str, float]]
    disabled_pairs: tuple[tuple[str, str], ...] = ()
    disabled_links: tuple[str, ...] = ()
    enabled_pairs: tuple[tuple[str, str], ...] = ()
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
        The text is not an SRDF, a state holds something else than finite numbers, or
        a pair lacks a link.
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
    notes: list[str] = []
    places = _places(root, text, label)
    states = _states(root, robot, places, faults, notes)
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
        notes=tuple(notes),
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
    faults: list[str],
    notes: list[str],
) -> dict[str, dict[str, float]]:
    """Joint positions by name of the state; several groups may have one of a name."""
    states: dict[str, dict[str, float]] = {}
    for element in root.findall("group_state"):
        name = element.get("name", "")
        values = states.setdefault(name, {})
        for joint, value in _state(element, robot, places, faults).items():
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
    faults: list[str],
) -> dict[str, float]:
    values: dict[str, float] = {}
    for joint in element.findall("joint"):
        name, text = joint.get("name", ""), joint.get("value", "")
        try:
            numbers = [float(word) for word in text.split()]
        except ValueError:
            numbers = []
        known = robot.joints.get(name)
        if len(numbers) > 1 and (known is None or not known.moves):
            continue  # a virtual or planar joint, which no arm plans for
        if len(numbers) != 1 or not math.isfinite(numbers[0]):
            faults.append(
                f"{places[joint]}: group_state {element.get('name')!r}: joint "
                f"{name!r}: expected one finite number (got {text[:40]!r})"
            )
            continue
        values[name] = numbers[0]
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
