"""The section on the cell: its description and its picture."""

from __future__ import annotations

from pathlib import PurePosixPath

from reachmap.cell.loaded import LoadedCell
from reachmap.cell.model.shapes import shape_text
from reachmap.core.collision.solids import SolidCell
from reachmap.errors import ReachmapError
from reachmap.maps.format.registry import Artefact, Result
from reachmap.plots.cell.cell_view import draw_cell
from reachmap.report.blocks import (
    Block,
    Heading,
    Section,
    Table,
    drawn,
    facts,
    paragraph,
    section,
    table,
)
from reachmap.text import count, number, signed

TITLE = "The cell"


def cell_section(loaded: LoadedCell | str, record: Artefact | Result) -> Section:
    """Describe and draw a cell.

    Parameters
    ----------
    loaded : LoadedCell or str
        The cell, or why it cannot be loaded on this machine.
    record : WorkspaceMap, BinMap or BinPlacement
        That it comes from.
    """
    if isinstance(loaded, str):
        return section(
            "cell", TITLE, paragraph(f"The cell cannot be drawn here: {loaded}")
        )
    return section(
        "cell",
        TITLE,
        _picture(loaded, record),
        _facts(loaded),
        Heading("Bodies"),
        _bodies(loaded),
    )


def _picture(loaded: LoadedCell, record: Artefact | Result) -> Block:
    try:
        cell = SolidCell.build(loaded)
    except ReachmapError as error:
        return paragraph(f"The cell cannot be drawn here: {error.lines[0]}")
    return drawn(
        draw_cell(cell),
        "The cell at the scan configuration, drawn to scale from the shapes that "
        "collisions are checked on.",
        record,
    )


def _facts(loaded: LoadedCell) -> Table | None:
    cell = loaded.cell
    robot, camera, tray = cell.robot, cell.camera, cell.bin
    joints = loaded.scan_configuration_rad
    x, y, z = tray.inner
    seen = ""
    if camera is not None:
        near, far = camera.range_m
        across, down = camera.field_of_view_deg
        seen = (
            f"on {camera.parent}, working distance {number(near, 2)} to "
            f"{number(far, 2, 'm')}, field of view {number(across, 0)}° × "
            f"{number(down, 0)}°"
        )
    return facts(
        [
            ("robot", PurePosixPath(robot.urdf).name.removesuffix(".urdf")),
            ("moving joints", count(len(joints), "joint")),
            (
                "tool centre point",
                f"{_position(robot.tcp.xyz)} in {robot.tcp.parent}, approaches along "
                f"{robot.tcp.approach_axis}",
            ),
            ("camera", seen),
            (
                "bin",
                f"{number(x, 3)} × {number(y, 3)} × {number(z, 3, 'm')} inside, walls "
                + " and ".join(
                    number(1000 * wall, 0, "mm") for wall in dict.fromkeys(tray.walls)
                )
                + (f" ({tray.carrier})" if tray.carrier else ""),
            ),
            ("bin stands at", _position(tuple(tray.pose.matrix()[:3, 3].tolist()))),
            (
                "scan configuration",
                ", ".join(
                    f"{name} {_angle(loaded, name, value)}"
                    for name, value in joints.items()
                ),
            ),
            (
                "safety margin",
                f"{number(1000 * cell.collision.safety_margin_m, 1, 'mm')} between "
                "all pairs of bodies",
            ),
        ]
    )


def _angle(loaded: LoadedCell, name: str, value: float) -> str:
    if loaded.robot.joints[name].type == "prismatic":
        return number(value, 3, "m")
    return f"{number(value * 57.29577951308232, 1)}°"


def _position(xyz: tuple[float, ...]) -> str:
    x, y, z = (signed(float(value), 3) for value in xyz)
    return f"x {x}, y {y}, z {z} m"


def _bodies(loaded: LoadedCell) -> Block:
    rows = [
        (body.name, body.attach_to, shape_text(body.shape), _position(body.pose.xyz))
        for body in loaded.cell.bodies
    ]
    if not rows:
        return paragraph("None besides the robot and the bin.")
    return table(("body", "fixed to", "shape", "centre there"), rows, "<<<<")
