"""The parts of an SRDF that a cell uses: groups and group states."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree

from reachmap.cell.files.urdf import UrdfDescription
from reachmap.cell.files.xml_text import parse_xml
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
    disabled_pairs : tuple of (str, str)
        Links whose collisions are ignored.
    """

    groups: dict[str, tuple[str, ...]]
    states: dict[str, dict[str, float]]
    disabled_pairs: tuple[tuple[str, str], ...]


def parse_srdf(text: str, label: str, robot: UrdfDescription) -> SrdfDescription:
    """Read groups, group states and disabled pairs of an SRDF text.

    Raises
    ------
    CellError
        The text is not an SRDF, or a state holds something else than finite numbers.
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
    states = {
        element.get("name", ""): _state(element, label)
        for element in root.findall("group_state")
    }
    pairs = tuple(
        (element.get("link1", ""), element.get("link2", ""))
        for element in root.findall("disable_collisions")
    )
    return SrdfDescription(groups=groups, states=states, disabled_pairs=pairs)


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


def _state(element: ElementTree.Element, label: str) -> dict[str, float]:
    values: dict[str, float] = {}
    for joint in element.findall("joint"):
        name, text = joint.get("name", ""), joint.get("value", "")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise CellError(
                f"{label}: group_state {element.get('name')!r}: joint {name!r}: "
                f"expected a finite number (got {text[:40]!r})"
            )
        values[name] = value
    return values
