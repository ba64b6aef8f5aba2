"""Names that the pick cycle uses: parts, frames of drop-offs, joint values."""

from __future__ import annotations

from typing import Any

from reachmap.cell.files.urdf import UrdfDescription
from reachmap.cell.text.data import at, entries, text_at
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_reader import Document, Location

STILL = ("world", "robot_base")
PART = "part"
"""Name of the part in pairs of bodies."""


def check_part_choice(document: Document) -> None:
    """Add a mistake where ``part`` names none of ``parts``."""
    name = text_at(document.data, "part")
    if name is None:
        return
    parts = at(document.data, "parts")
    known = list(parts) if isinstance(parts, dict) else []
    if name not in known:
        hint = did_you_mean(name, known) or "parts has none"
        document.add(("part",), f"no part {name!r}; {hint}")
        # What is missing because there is no part is not a mistake of its own.
        document.data["part"] = None


def joint_value_places(data: Any) -> list[Location]:
    """Where a cell gives positions of all joints, or the name of a group state."""
    places: list[Location] = [("scan_configuration",), ("cycle", "return_to")]
    places += drop_off_places(data)
    return [place for place in places if isinstance(at(data, *place), dict)]


def drop_off_places(data: Any) -> list[Location]:
    """Where the drop-offs are described."""
    if isinstance(at(data, "drop_off"), list):
        return [("drop_off", k) for k in range(len(entries(data, "drop_off")))]
    return [("drop_off",)]


def part_places(data: Any) -> list[tuple[str, Location]]:
    """Key and place of every part that is described."""
    parts = at(data, "parts")
    named = list(parts) if isinstance(parts, dict) else []
    return [(PART, (PART,)), *((f"part {n}", ("parts", n)) for n in named)]


def check_cycle_names(document: Document, robot: UrdfDescription) -> None:
    """Add a mistake for every frame or body of the cycle that does not exist."""
    data = document.data
    bodies = {
        name: text_at(body, "attach_to") or "world"
        for body in entries(data, "bodies")
        if (name := text_at(body, "name"))
    }
    others = at(data, "bins")
    still = [*STILL, "bin", *(n for n, parent in bodies.items() if parent in STILL)]
    still += [n for n in [text_at(data, "bin", "name")] if n]
    still += list(others) if isinstance(others, dict) else []
    for place in drop_off_places(data):
        frame = text_at(data, *place, "frame")
        if frame is not None and frame not in still:
            hint = did_you_mean(frame, still)
            document.add(
                (*place, "frame"),
                f"{frame!r} is neither world, robot_base, a bin nor a body that stands "
                f"still; {hint}",
            )
    known = [*robot.links, *bodies, "bin", *(at(data, "bins") or {})]
    has_part = False
    for _, place in part_places(data):
        has_part |= isinstance(at(data, *place), dict)
        for index, name in enumerate(entries(data, *place, "touch")):
            if isinstance(name, str) and name not in known:
                message = f"no link or body {name!r}; {did_you_mean(name, known)}"
                document.add((*place, "touch", index), message)
    if has_part and (PART in bodies or PART in robot.links):
        kind = "body" if PART in bodies else "link"
        document.add((PART,), f"a {kind} is called {PART!r}, too; give it another name")
