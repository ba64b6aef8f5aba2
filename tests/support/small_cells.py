"""A small cell with a URDF of one's own, loaded from a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reachmap.cell.loading import LoadedCell, read_cell

LIMIT = '<limit lower="-3" upper="3" velocity="2" effort="1"/>'
CELL = """\
format: reachmap.cell
format_version: "1.0"
name: small
robot:
  urdf: arm.urdf
  tcp: {{parent: {tip}}}
  limits: {{acceleration_rad_s2: 5}}
bin: {{inner: [0.3, 0.2, 0.1], pose: {{xyz: [9, 0, 0]}}}}
scan_configuration: {{q_deg: {{{q}}}}}
workspace_scan:
  cubes: [{{name: a, min: [0, 0, 0], max: [1, 1, 1], grid: [2, 2]}}]
  z_step: 1
  orientations: {{family: cone, tilts_deg: [0], azimuths: [1], rolls: 1}}
  repeats: 1
bin_scan:
  grid: [2, 2]
  layers: [0.05]
  orientations: {{family: cone, tilts_deg: [0], azimuths: [1], rolls: 1}}
  repeats: 1
"""


def link(name: str, *shapes: str, tag: str = "collision") -> str:
    """A link with geometries, each ``origin attributes|element``."""
    parts = []
    for shape in shapes:
        origin, _, element = shape.rpartition("|")
        place = f"<origin {origin}/>" if origin else ""
        parts.append(f"<{tag}>{place}<geometry>{element}</geometry></{tag}>")
    return f'<link name="{name}">{"".join(parts)}</link>'


def joint(
    name: str, parent: str, child: str, *, kind: str = "revolute", more: str = ""
) -> str:
    """A joint; ``more`` holds origin, axis and mimic."""
    limit = LIMIT if kind in ("revolute", "prismatic") and "<limit" not in more else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/>{limit}{more}</joint>'
    )


def robot(*elements: str) -> str:
    """URDF of links and joints."""
    return f'<robot name="r">{"".join(elements)}</robot>'


def load(
    folder: Path,
    urdf: str,
    tip: str,
    joints: Sequence[str],
    overrides: Sequence[str] = (),
) -> LoadedCell:
    """Write the URDF and its cell into a folder, and load the cell."""
    (folder / "arm.urdf").write_text(urdf)
    q = ", ".join(f"{name}: 0" for name in joints)
    (folder / "cell.yaml").write_text(CELL.format(tip=tip, q=q))
    return read_cell(str(folder / "cell.yaml"), overrides)
