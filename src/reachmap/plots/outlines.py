"""What stands in the cell, as outlines seen from above, to scale, in robot_base."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull, QhullError

from reachmap._typing import FloatArray
from reachmap.cell.fields import Shape
from reachmap.cell.model import BinSpec, Cell
from reachmap.geometry import inverse_transform
from reachmap.plots.style import BIN_COLOUR, INK

Kind: TypeAlias = Literal["base", "body", "bin", "runner-up", "paper", "camera"]
ROUND_STEPS = 48

LOOKS: dict[str, dict[str, Any]] = {
    "base": {"edgecolor": INK, "linewidth": 1.5},
    "body": {"edgecolor": INK, "linewidth": 1.1, "linestyle": (0, (5, 2))},
    "bin": {"edgecolor": BIN_COLOUR, "linewidth": 1.8},
    "runner-up": {
        "edgecolor": BIN_COLOUR,
        "linewidth": 1.5,
        "linestyle": (0, (4, 1.5)),
    },
    "camera": {
        "edgecolor": "#5f5f5f",
        "linewidth": 1.4,
        "linestyle": (0, (6, 2, 1, 2)),
    },
    "paper": {
        "edgecolor": "#7b1fa2",
        "linewidth": 1.5,
        "linestyle": (0, (1.2, 1.4)),
    },
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Outline:
    """A closed polygon seen from above.

    Attributes
    ----------
    name : str
        What the legend calls it.
    kind : str
        How it is drawn, a key of :data:`LOOKS`.
    polygon : array, shape (n, 2)
        Corners in robot_base [m], not closed.
    z_low, z_high : float
        Heights that the thing spans [m].
    """

    name: str
    kind: Kind
    polygon: FloatArray
    z_low: float
    z_high: float

    def near(self, z: float, distance: float) -> bool:
        """Whether it crosses the height ``z`` or comes within ``distance`` [m]."""
        return self.z_low - distance <= z <= self.z_high + distance


def hull_outline(name: str, kind: Kind, points: FloatArray) -> Outline:
    """Outline of the convex hull of points in robot_base, shape (n, 3) [m]."""
    xy = points[:, :2]
    try:
        xy = xy[ConvexHull(xy).vertices]
    except QhullError:  # flat or too few points: the points are their own outline
        xy = np.unique(xy, axis=0)
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    return Outline(name=name, kind=kind, polygon=xy, z_low=low, z_high=high)


def shape_points(shape: Shape) -> FloatArray | None:
    """Points whose convex hull is the shape, (n, 3) in its own frame [m].

    Round shapes get a polygon of 48 corners. None for a mesh, whose file may not be
    on this machine.
    """
    kind, value = shape.kind()
    if kind == "mesh":
        return None
    if kind == "box":
        return box_corners(np.array(value))
    ring = _ring(value.radius)
    if kind == "cylinder":
        half = np.array([0.0, 0.0, value.length / 2.0])
        return np.concatenate([ring - half, ring + half])
    ball = _ball(value.radius)
    if kind == "sphere":
        return ball
    half = np.array([0.0, 0.0, value.length / 2.0])
    return np.concatenate([ball - half, ball + half])


def box_corners(sides: FloatArray) -> FloatArray:
    """Corners of a centred box with the full sides (3,) [m], shape (8, 3)."""
    signs = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij"), axis=-1)
    return np.asarray(signs.reshape(-1, 3) * sides)


def _ring(radius: float) -> FloatArray:
    angle = np.linspace(0.0, 2.0 * np.pi, ROUND_STEPS, endpoint=False)
    zero = np.zeros_like(angle)
    return radius * np.stack([np.cos(angle), np.sin(angle), zero], axis=-1)


def _ball(radius: float) -> FloatArray:
    height = np.linspace(-1.0, 1.0, ROUND_STEPS // 2 + 1)
    rings = [
        _ring(radius * np.sqrt(1.0 - h * h)) + np.array([0.0, 0.0, radius * h])
        for h in height
    ]
    return np.concatenate(rings)


def body_outlines(cell: Cell) -> tuple[Outline, ...]:
    """Outlines of the bodies that stand still (attached to world or robot_base)."""
    T_base_world = inverse_transform(cell.robot.base_pose.matrix())
    frames = {"world": T_base_world, "robot_base": np.eye(4)}
    found = []
    for body in cell.bodies:
        points = shape_points(body.shape)
        if points is None or body.attach_to not in frames:
            continue
        T = frames[body.attach_to] @ body.pose.matrix()
        found.append(hull_outline(body.name, "body", _moved(T, points)))
    return tuple(found)


def bin_outlines(
    spec: BinSpec, T_base_bin: FloatArray, *, name: str = "bin", kind: Kind = "bin"
) -> tuple[Outline, ...]:
    """Inner and outer rectangle of a bin in a pose; only the outer has the name.

    The heights are those of the bin from under its bottom to its rim.
    """
    x, y, depth = spec.inner
    bottom = spec.wall if spec.bottom is None else spec.bottom
    outlines = []
    for label, margin in ((name, spec.wall), ("", 0.0)):
        sides = np.array([x + 2 * margin, y + 2 * margin, depth + bottom])
        points = box_corners(sides) + np.array([0.0, 0.0, (depth - bottom) / 2.0])
        outlines.append(hull_outline(label, kind, _moved(T_base_bin, points)))
    return tuple(outlines)


def _moved(T: FloatArray, points: FloatArray) -> FloatArray:
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def draw_outline(axes: Axes, outline: Outline, *, weight: float = 1.0) -> None:
    """Draw an outline on a white line, so that it shows on every colour.

    ``weight`` scales the width of the lines.
    """
    look = LOOKS[outline.kind]
    width = weight * look["linewidth"] * (1.0 if outline.name else 0.5)
    white = {"edgecolor": "white", "linewidth": width + 1.8 * weight, "alpha": 0.75}
    for style in (white, {**look, "linewidth": width}):
        axes.add_patch(
            Polygon(
                outline.polygon.tolist(),
                closed=True,
                fill=False,
                joinstyle="miter",
                zorder=4,
                **style,
            )
        )


def legend_lines(outlines: Iterable[Outline]) -> list[Line2D]:
    """Make handles for a legend, one for each outline that has a name."""
    return [
        Line2D(
            [],
            [],
            color=LOOKS[outline.kind]["edgecolor"],
            linewidth=LOOKS[outline.kind]["linewidth"],
            linestyle=LOOKS[outline.kind].get("linestyle", "-"),
            label=outline.name,
        )
        for outline in outlines
        if outline.name
    ]
