"""Approach directions and rolls that are reached in the bin, and why others are not.

Each point carries a sunburst: rings are tilts, straight down in the middle; sectors
are the directions the tool comes from; each sector is divided into the rolls about
the approach axis; the colour is the state of the test grasp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.cell.bins.support import STEADY_DEG
from reachmap.cell.model.cell import Cell
from reachmap.geometry import (
    approach_directions,
    inverse_transform,
    rotation_from_quaternion_wxyz,
    tilt_rad,
    upright_rotation,
)
from reachmap.maps.records import BinMap, Status
from reachmap.maps.summary.statistics import STATUS_NAMES
from reachmap.plots.parts.bin_view import frame_bin, view_of
from reachmap.plots.parts.context import context_of
from reachmap.plots.parts.squares import axis_titles, cell_edges
from reachmap.plots.parts.style import (
    MUTED,
    axes_at,
    drawing,
    fit_scale,
    new_figure,
    put_text,
    put_title,
    subtitle_of,
)

# Pale blue for what works, so that what does not stands out; blue against yellow to
# dark red differs in every kind of colour vision, and the causes run light to dark.
STATUS_COLOURS: dict[Status, str] = {
    Status.PATH_FOUND: "#9ac7e2",
    Status.NO_PATH_FOUND: "#f5c518",
    Status.APPROACH_BLOCKED: "#f28e1c",
    Status.IK_IN_COLLISION: "#d1380e",
    Status.NO_IK: "#4a1030",
    Status.ERROR: "#000000",
    Status.NOT_ATTEMPTED: "#d3d3d3",
}
LEFT, TOP, BOTTOM, RIGHT = 0.80, 0.95, 0.62, 3.0
WIDEST, TALLEST = 12.5, 9.5
# Directions closer than this are one direction at several rolls.
SAME_DIRECTION = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Sector:
    """Place of one orientation in the sunburst.

    Attributes
    ----------
    inner, outer : float
        Radii, as parts of the radius of the whole.
    start_rad, end_rad : float
        Angles from the bin's x axis [rad].
    border : bool
        Whether another direction begins at ``start_rad``.
    """

    inner: float
    outer: float
    start_rad: float
    end_rad: float
    border: bool = False

    def polygon(self) -> FloatArray:
        """Corners for a sunburst of radius 1 at the origin, shape (n, 2)."""
        steps = max(2, int(np.ceil((self.end_rad - self.start_rad) / 0.2)) + 1)
        angle = np.linspace(self.start_rad, self.end_rad, steps)
        arc = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        if self.inner == 0.0:
            return np.concatenate([self.outer * arc, np.zeros((1, 2))])
        return np.concatenate([self.outer * arc, self.inner * arc[::-1]])

    def border_line(self) -> FloatArray:
        """Return the ends of the line where the direction begins, shape (2, 2)."""
        ray = np.array([np.cos(self.start_rad), np.sin(self.start_rad)])
        return np.stack([self.inner * ray, self.outer * ray])


def sunburst_sectors(directions: FloatArray) -> tuple[Sector, ...]:
    """Sector of each orientation, from where its tool points.

    Parameters
    ----------
    directions : array, shape (no, 3)
        Approach directions in the bin frame, unit vectors.

    Returns
    -------
    tuple of Sector
        In the order of the orientations. Orientations that share a direction, which
        differ in roll, share its sector evenly, in their own order.
    """
    tilt = np.arccos(np.clip(-directions[:, 2], -1.0, 1.0))
    group, rolls = _group_directions(directions)
    firsts = np.array(
        [int(np.flatnonzero(group == g)[0]) for g in range(group.max() + 1)]
    )
    rings, ring = np.unique(np.round(np.degrees(tilt[firsts])), return_inverse=True)
    edges = _ring_edges(rings)
    # The tool comes from the side opposite to where it points.
    azimuth = np.arctan2(-directions[firsts, 1], -directions[firsts, 0])
    starts, ends = np.zeros(len(firsts)), np.zeros(len(firsts))
    for index in range(len(rings)):
        members = np.flatnonzero(ring == index)
        starts[members], ends[members] = _ring_angles(azimuth[members])
    sectors = []
    for orientation, g in enumerate(group):
        share = (ends[g] - starts[g]) / rolls[g]
        place = int(np.sum(group[:orientation] == g))
        sectors.append(
            Sector(
                inner=float(edges[ring[g]]),
                outer=float(edges[ring[g] + 1]),
                start_rad=float(starts[g] + place * share),
                end_rad=float(starts[g] + (place + 1) * share),
                border=place == 0 and bool(np.sum(ring == ring[g]) > 1),
            )
        )
    return tuple(sectors)


def _group_directions(directions: FloatArray) -> tuple[IntArray, IntArray]:
    """Group index of each orientation by direction, and the rolls of each group."""
    found: list[FloatArray] = []
    group = np.zeros(len(directions), dtype=np.int64)
    for index, direction in enumerate(directions):
        near = [bool(np.linalg.norm(direction - f) < SAME_DIRECTION) for f in found]
        if not any(near):
            found.append(direction)
            near.append(True)
        group[index] = near.index(True)
    return group, np.bincount(group)


def _ring_edges(tilts_deg: FloatArray) -> FloatArray:
    """Radii between the rings; the disc of straight down takes a smaller share."""
    width = np.ones(len(tilts_deg))
    if len(tilts_deg) > 1 and tilts_deg[0] == 0.0:
        width[0] = 0.75
    return np.concatenate([[0.0], np.cumsum(width) / width.sum()])


def _ring_angles(azimuth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and last angle of sectors whose borders lie midway between azimuths."""
    count = len(azimuth)
    if count == 1:
        return azimuth - np.pi, azimuth + np.pi
    order = np.argsort(azimuth, kind="stable")
    sorted_azimuth = azimuth[order]
    gap = np.diff(np.append(sorted_azimuth, sorted_azimuth[0] + 2.0 * np.pi)) / 2.0
    start, end = np.zeros(count), np.zeros(count)
    start[order] = sorted_azimuth - np.roll(gap, 1)
    end[order] = sorted_azimuth + gap
    return start, end


@drawing()
def draw_approach(bin_map: BinMap, layer: int = 0) -> Figure:
    """Draw a sunburst of the states of all orientations at each point of a layer."""
    view = view_of(bin_map)
    low, high = view.view()
    scale_in = fit_scale(low, high, WIDEST, TALLEST)
    width, height = (high - low) * scale_in
    figure = new_figure(LEFT + width + RIGHT, BOTTOM + height + TOP)
    axes = axes_at(figure, LEFT, BOTTOM, width, height)
    cell = context_of(bin_map.provenance).cell
    follows_bin, R_bin_rings = ring_axis(cell, bin_map.bin_pose)
    sectors = sunburst_sectors(_directions(bin_map, layer) @ R_bin_rings)
    radius = 0.485 * min(
        float(np.diff(cell_edges(c)).min()) for c in (bin_map.x, bin_map.y)
    )
    for row, y in enumerate(bin_map.y):
        for column, x in enumerate(bin_map.x):
            centre = np.array([x, y])
            _draw_sunburst(
                axes, sectors, bin_map.status[layer, row, column], centre, radius
            )
    frame_bin(axes, view)
    axis_titles(axes, "the bin")
    middle = "square to the bottom" if follows_bin else "upright"
    _draw_key(figure, sectors, LEFT + width + 0.25, BOTTOM + height, middle)
    figure.legend(
        handles=_status_handles(bin_map.status[layer]),
        loc="upper left",
        bbox_to_anchor=(
            (LEFT + width + 0.12) / figure.get_figwidth(),
            (BOTTOM + height - 3.1) / figure.get_figheight(),
        ),
        title="State of the test grasp",
        title_fontproperties={"size": 9.5, "weight": "bold"},
        alignment="left",
        handlelength=1.4,
    )
    said = ("seen from above", view.layer_text(layer), view.cell_name)
    put_title(
        figure,
        LEFT,
        "Which approach directions and rolls work where",
        subtitle_of(said),
    )
    return figure


def ring_axis(cell: Cell | None, bin_pose: FloatArray) -> tuple[bool, FloatArray]:
    """What the rings of a bin's orientations are drawn about.

    Parameters
    ----------
    cell : Cell or None
    bin_pose : array, shape (4, 4)
        T_base_bin.

    Returns
    -------
    follows_bin : bool
        Whether it is the z axis of a bin that leans, not the vertical.
    R_bin_rings : array, shape (3, 3)
    """
    if cell is None:
        return False, np.eye(3)
    R_world_bin = (inverse_transform(cell.T_base_world()) @ bin_pose)[:3, :3]
    if tilt_rad(R_world_bin) <= np.radians(STEADY_DEG):
        return False, np.eye(3)
    if cell.bin_scan.orientations.reference in ("bin", None):
        return True, np.eye(3)
    return False, upright_rotation(R_world_bin)


def _directions(bin_map: BinMap, layer: int) -> FloatArray:
    """Approach directions in the bin frame, shape (no, 3); the same at every point."""
    R_base_tcp = rotation_from_quaternion_wxyz(bin_map.quaternion_wxyz[layer, 0, 0])
    in_base = approach_directions(R_base_tcp, bin_map.approach_axis)
    return np.asarray(in_base @ bin_map.bin_pose[:3, :3])


def _draw_sunburst(
    axes: Axes,
    sectors: tuple[Sector, ...],
    status: CodeArray,
    centre: FloatArray,
    radius: float,
    line: float = 0.25,
) -> None:
    slices = PolyCollection(
        [centre + radius * sector.polygon() for sector in sectors],
        facecolors=[STATUS_COLOURS[Status(int(code))] for code in status],
        edgecolors="white",
        linewidths=line,
        zorder=3,
    )
    borders = LineCollection(
        [centre + radius * s.border_line() for s in sectors if s.border],
        colors="white",
        linewidths=4.0 * line,
        zorder=3,
    )
    for collection in (slices, borders):
        axes.add_collection(collection, autolim=False)


def _status_handles(status: CodeArray) -> list[Artist]:
    total = status.size
    handles: list[Artist] = []
    for code, name in STATUS_NAMES.items():
        count = int((status == code).sum())
        if count:
            label = f"{name}, {100.0 * count / total:.1f} %"
            handles.append(Patch(color=STATUS_COLOURS[code], label=label))
    return handles


def _draw_key(
    figure: Figure,
    sectors: tuple[Sector, ...],
    left: float,
    top: float,
    middle: str,
) -> None:
    """One large sunburst with words, to read the small ones by."""
    put_text(figure, left, top - 0.12, "At each point", fontsize=9.5, fontweight="bold")
    lean = "ring: the tool is tilted to that side"
    lines = [f"middle: the tool is {middle}", lean]
    if len({sector.inner for sector in sectors}) == 1:
        lines = [lean]
    for index, line in enumerate([*lines, "slices of a sector: its rolls, in order"]):
        height = top - 0.34 - 0.17 * index
        put_text(figure, left, height, line, fontsize=8.5, color=MUTED)
    size = 1.75
    axes = axes_at(figure, left + 0.25, top - size - 0.98, size, size)
    axes.set_xlim(-1.25, 1.25)
    axes.set_ylim(-1.25, 1.25)
    axes.set_axis_off()
    blank = np.full(len(sectors), int(Status.NOT_ATTEMPTED), dtype=np.uint8)
    _draw_sunburst(axes, sectors, blank, np.zeros(2), 1.0, line=0.8)
    for place, name in (((1.14, 0.0), "+x"), ((0.0, 1.12), "+y")):
        axes.text(*place, name, fontsize=8.5, color=MUTED, ha="center", va="center")
