"""The cell as it stands, drawn to scale: in space, from the side and from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from reachmap._typing import FloatArray
from reachmap.core.collision.solids import Solid, SolidCell
from reachmap.plots.cell.cell_colours import legend_colours, solid_colours
from reachmap.plots.cell.raster import (
    Facets,
    Window,
    facets_of,
    join,
    render,
    view_axes,
    visible_area,
)
from reachmap.plots.parts.style import (
    MUTED,
    RULE,
    axes_at,
    drawing,
    new_figure,
)

# Bodies larger than this are cut at the edge of a picture instead of widening it [m].
LARGE_BODY = 0.5
MARGIN = 0.14
PIXELS_PER_IN = 190.0
ELEVATION_DEG = 24.0
AZIMUTHS_DEG = (-40.0, 40.0, -65.0, 65.0)
LEFT, GAP, TOP, RIGHT = 0.25, 0.62, 0.35, 0.20
BIG_WIDEST, BIG_TALLEST = 5.6, 5.2
SMALL_WIDEST = 3.6
LEGEND_COLUMN = 1.45


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Placed:
    """The facets of a cell at a configuration, solid by solid, in robot_base."""

    solids: tuple[Solid, ...]
    parts: tuple[Facets, ...]

    def all(self, without: frozenset[int] = frozenset()) -> Facets:
        return join([p for k, p in enumerate(self.parts) if k not in without])

    def focus(self) -> FloatArray:
        """Points that a picture must hold, shape (n, 3): all but large bodies."""
        return np.concatenate(
            [
                part.corners.reshape(-1, 3)
                for solid, part in zip(self.solids, self.parts, strict=True)
                if solid.kind != "body" or _extent(part) <= LARGE_BODY
            ]
        )


def _extent(part: Facets) -> float:
    points = part.corners.reshape(-1, 3)
    return float(np.ptp(points, axis=0).max())


@drawing()
def draw_cell(cell: SolidCell) -> Figure:
    """Draw a cell at its scan configuration."""
    placed = _placed(cell)
    points = placed.focus()
    big = _window(view_axes(_best_azimuth(placed, points), ELEVATION_DEG), points)
    top = _window(view_axes(-90.0, 90.0), points)
    side = _window(view_axes(-90.0, 0.0), points)
    big_in = _fit(big, BIG_WIDEST, BIG_TALLEST)
    width, big_height = (big_in * length for length in _sides(big))
    # The two small views share one scale; together they are as tall as the large one.
    tall = _sides(top)[1] + _sides(side)[1]
    wide = max(_sides(top)[0], _sides(side)[0])
    small_in = min((max(big_height, 4.4) - GAP) / tall, SMALL_WIDEST / wide)
    height = max(big_height, small_in * tall + GAP)
    whole = LEFT + width + GAP + 0.15 + small_in * wide + RIGHT
    handles = _handles(cell)
    columns = max(2, int((whole - 2 * LEFT) / LEGEND_COLUMN))
    floor = 0.62 + 0.21 * -(-len(handles) // columns)
    figure = new_figure(whole, floor + height + TOP)
    axes = axes_at(figure, LEFT, floor + height - big_height, width, big_height)
    _show(axes, placed, big, big_in)
    axes.set_axis_off()
    left, bottom = LEFT + width + GAP + 0.15, floor
    panels = (
        (side, "from the side", "z", _in_front(placed)),
        (top, "from above", "y", frozenset[int]()),
    )
    for window, name, vertical, hidden in panels:
        panel_width, panel_height = (small_in * length for length in _sides(window))
        panel = axes_at(figure, left, bottom, panel_width, panel_height)
        _show(panel, placed, window, small_in, hidden)
        _dimension(panel, name, vertical)
        bottom += height - small_in * _sides(top)[1]
    _put_legend(figure, handles, columns)
    return figure


def _placed(cell: SolidCell) -> _Placed:
    colours = solid_colours(cell.solids)
    poses = cell.solid_poses(cell.scan_configuration)
    parts = []
    for owner, (solid, T) in enumerate(zip(cell.solids, poses, strict=True)):
        rgb = colours[solid.name]
        parts.append(
            facets_of(solid.vertices, solid.triangles, T, np.array(rgb) / 255.0, owner)
        )
    return _Placed(solids=cell.solids, parts=tuple(parts))


def _window(axes: FloatArray, points: FloatArray) -> Window:
    across = points @ axes[:2].T
    return Window(
        axes=axes, low=across.min(axis=0) - MARGIN, high=across.max(axis=0) + MARGIN
    )


def _sides(window: Window) -> tuple[float, float]:
    width, height = window.high - window.low
    return float(width), float(height)


def _fit(window: Window, widest: float, tallest: float) -> float:
    width, height = _sides(window)
    return min(widest / width, tallest / height)


def _best_azimuth(placed: _Placed, points: FloatArray) -> float:
    """Direction from which most of the arm, the tool and the bin is seen."""
    wanted = [k for k, solid in enumerate(placed.solids) if solid.kind != "body"]
    facets = placed.all()

    def seen(azimuth: float) -> float:
        window = _window(view_axes(azimuth, ELEVATION_DEG), points)
        area = visible_area(facets, window, 40.0)
        bins = [k for k in wanted if placed.solids[k].kind == "bin"]
        # A bin is small; that it is seen matters as much as the arm.
        return float(area[wanted].sum() + 6.0 * area[bins].sum())

    return max(AZIMUTHS_DEG, key=seen)


def _in_front(placed: _Placed) -> frozenset[int]:
    """Large bodies between the viewer of the side view and the arm."""
    arm = np.concatenate(
        [
            part.corners.reshape(-1, 3)
            for solid, part in zip(placed.solids, placed.parts, strict=True)
            if solid.kind in ("link", "tool", "bin")
        ]
    )
    return frozenset(
        k
        for k, (solid, part) in enumerate(zip(placed.solids, placed.parts, strict=True))
        if solid.kind == "body" and part.corners[..., 1].max() < arm[:, 1].min()
    )


def _show(
    axes: Axes,
    placed: _Placed,
    window: Window,
    scale_in: float,
    without: frozenset[int] = frozenset(),
) -> None:
    image = render(placed.all(without), window, scale_in * PIXELS_PER_IN)
    (left, bottom), (right, top) = window.low, window.high
    axes.imshow(
        image,
        extent=(float(left), float(right), float(bottom), float(top)),
        interpolation="antialiased",
        aspect="equal",
    )


def _dimension(axes: Axes, name: str, vertical: str) -> None:
    axes.set_title(name, loc="left", pad=4)
    axes.set_xlabel("x [m]", labelpad=1)
    axes.set_ylabel(f"{vertical} [m]", labelpad=1)
    axes.tick_params(length=2.5, labelsize=7.5)
    axes.set_facecolor("#fbfbfa")
    for spine in axes.spines.values():
        spine.set_color(RULE)


def _handles(cell: SolidCell) -> list[Patch]:
    named = legend_colours(cell.solids)
    return [
        Patch(
            facecolor=tuple(np.array(rgb) / 255.0),
            edgecolor="#3a3a3a",
            linewidth=0.5,
            label=name,
        )
        for name, rgb in named.items()
    ]


def _put_legend(figure: Figure, handles: list[Patch], columns: int) -> None:
    figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=((LEFT - 0.08) / figure.get_figwidth(), 0.005),
        ncols=columns,
        columnspacing=1.4,
        handlelength=1.2,
        handleheight=1.0,
        labelcolor=MUTED,
    )
