"""Outlines of the bodies in a cell, seen from above, to scale.

They are in the level frame of the cell, which is robot_base where that is upright.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull, QhullError

from reachmap._typing import FloatArray
from reachmap.cell.files.collisions import LinkShape
from reachmap.cell.files.resources import SCHEME, NotFoundError, Resolver
from reachmap.cell.files.urdf import parse_urdf
from reachmap.cell.meshes.reading import read_mesh
from reachmap.cell.model.cell import BinSpec, Cell
from reachmap.cell.model.fields import CylinderShape, Shape
from reachmap.cell.model.shapes import box_corners, triangles_of
from reachmap.geometry import inverse_transform, transform_points, yaw_transform
from reachmap.plots.parts.style import BIN_COLOUR, INK

Kind: TypeAlias = Literal[
    "base", "body", "bin", "envelope", "runner-up", "paper", "camera"
]

LOOKS: dict[str, dict[str, Any]] = {
    "base": {"edgecolor": INK, "linewidth": 1.5},
    "body": {"edgecolor": INK, "linewidth": 1.1, "linestyle": (0, (5, 2))},
    "bin": {"edgecolor": BIN_COLOUR, "linewidth": 1.8},
    "envelope": {
        "edgecolor": BIN_COLOUR,
        "linewidth": 0.9,
        "linestyle": (0, (1, 1.5)),
    },
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
        Corners in the level frame [m], not closed.
    z_low_m, z_high_m : float
        Heights that the thing spans [m].
    """

    name: str
    kind: Kind
    polygon: FloatArray
    z_low_m: float
    z_high_m: float

    def near(self, z_m: float, distance_m: float) -> bool:
        """Whether it crosses the height or comes near to it [m]."""
        return self.z_low_m - distance_m <= z_m <= self.z_high_m + distance_m


def hull_outline(name: str, kind: Kind, points: FloatArray) -> Outline:
    """Outline of the convex hull of points, shape (n, 3) [m]."""
    xy = points[:, :2]
    try:
        xy = xy[ConvexHull(xy).vertices]
    except QhullError:  # flat or too few points: the points are their own outline
        xy = np.unique(xy, axis=0)
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    return Outline(name=name, kind=kind, polygon=xy, z_low_m=low, z_high_m=high)


def body_outlines(cell: Cell) -> tuple[Outline, ...]:
    """Outlines of what stands still: bodies, and bins beside the cell's own."""
    T_level_base = inverse_transform(cell.T_base_level())
    frames = {"world": T_level_base @ cell.T_base_world(), "robot_base": T_level_base}
    found = []
    for body in cell.bodies:
        # The file of a mesh may not be on this machine.
        if body.shape.mesh is not None or body.attach_to not in frames:
            continue
        points = triangles_of(body.shape).vertices
        T = frames[body.attach_to] @ body.pose.matrix()
        found.append(hull_outline(body.name, "body", transform_points(T, points)))
    for name, spec in cell.bins.items():
        T = T_level_base @ cell.T_base_of(spec)
        found += bin_outlines(spec, T, name=f"bin {name}", kind="body")
    return tuple(found)


def bin_outlines(
    spec: BinSpec, T_level_bin: FloatArray, *, name: str = "bin", kind: Kind = "bin"
) -> tuple[Outline, ...]:
    """Opening and outer rectangle of a bin in a pose; only the outer has the name.

    The heights are those of the bin from under its bottom to its rim.
    """
    outlines = []
    for label, ledge in ((name, True), ("", False)):
        x, y = spec.outer[:2] if ledge else spec.top
        height = spec.inner[2] + spec.bottom_m
        points = box_corners(np.array([x, y, height]))
        points += np.array([0.0, 0.0, (spec.inner[2] - spec.bottom_m) / 2.0])
        outlines.append(
            hull_outline(label, kind, transform_points(T_level_bin, points))
        )
    return tuple(outlines)


def margin_envelope(
    spec: BinSpec, pose: FloatArray, margin: Mapping[str, float]
) -> tuple[Outline, ...]:
    """Outline of all that a bin covers while it is off by its margins, if it has any.

    Parameters
    ----------
    spec : BinSpec
    pose : array, shape (4,)
        x, y, z [m], yaw [rad] in the level frame.
    margin : mapping
        Direction, such as ``+x`` or ``-yaw``, to how far [m or rad].
    """
    axes = {"x": 0, "y": 1, "yaw": 3}
    corners = []
    for name, value in margin.items():
        if name[1:] in axes:
            moved = np.array(pose)
            moved[axes[name[1:]]] += float(f"{name[0]}1") * value
            outer = bin_outlines(spec, yaw_transform(*moved.tolist()))[0]
            corners.append(np.insert(outer.polygon, 2, pose[2], axis=1))
    if not corners:
        return ()
    points = np.concatenate(corners)
    return (hull_outline("margin", "envelope", points),)


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


NAME = "robot base"
# Stands for a base whose shape cannot be read on this machine [m].
NOMINAL_RADIUS = 0.05
STAR_SECTORS = 120


def base_outline(cell: Cell, urdf: str) -> Outline:
    """Outline of the links fixed to the base, from above.

    Parameters
    ----------
    cell : Cell
        Tells which frame is robot_base and where packages are.
    urdf : str
        URDF text.

    Returns
    -------
    Outline
        A circle of 0.05 m round the origin, named "robot base (origin)", when the
        meshes are not on this machine: a picture is not worth failing for that.
    """
    points = _base_points(cell, urdf)
    T_level_base = inverse_transform(cell.T_base_level())
    if points is not None:
        return _star_outline(
            transform_points(T_level_base, points), T_level_base[:2, 3]
        )
    spec = Shape(cylinder=CylinderShape(radius=NOMINAL_RADIUS, length=0.001))
    circle = triangles_of(spec).vertices
    return hull_outline(
        f"{NAME} (origin)", "base", transform_points(T_level_base, circle)
    )


def _star_outline(points: FloatArray, centre: FloatArray) -> Outline:
    """Outline of points as the farthest in each direction from a centre (2,).

    A convex hull would close the gap between a round base and its connector.
    """
    x, y = (points[:, :2] - centre).T
    angle = np.arctan2(y, x)
    sector = np.floor((angle + np.pi) / (2.0 * np.pi) * STAR_SECTORS).astype(int)
    radius = np.hypot(x, y)
    farthest = [
        members[int(radius[members].argmax())]
        for index in range(STAR_SECTORS)
        if (members := np.flatnonzero(sector % STAR_SECTORS == index)).size
    ]
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    polygon = points[farthest, :2]
    return Outline(name=NAME, kind="base", polygon=polygon, z_low_m=low, z_high_m=high)


def _base_points(cell: Cell, urdf: str) -> FloatArray | None:
    try:
        robot = parse_urdf(urdf, "urdf")
        poses = robot.fixed_to(cell.robot.base_frame or robot.root)
        points = [
            transform_points(
                poses[item.link] @ item.origin.matrix(), _points_of(cell, item)
            )
            for item in robot.collisions
            if item.link in poses
        ]
    except (NotFoundError, OSError, ValueError):
        return None
    return np.concatenate(points) if points else None


def _points_of(cell: Cell, item: LinkShape) -> FloatArray:
    """Points close together on the triangles of a link, in the shape's frame."""
    if item.shape is not None:
        surface = triangles_of(item.shape)
    else:
        path = _mesh_path(cell, item.mesh)
        surface = read_mesh(path.read_bytes(), path.suffix, item.scale)
    return _edge_points(surface.vertices[surface.triangles])


def _mesh_path(cell: Cell, reference: str) -> Path:
    """Path of a mesh that the URDF names; NotFoundError if it is not here."""
    resolver = Resolver(directory=Path(), packages=cell.resources.packages)
    if reference.startswith(SCHEME):
        return resolver.around(cell.robot.urdf).resolve(reference)
    urdf, root = resolver.resolve_robot(cell.robot.urdf)
    return resolver.resolve_from_urdf(reference, urdf.parent, root)


def _edge_points(polygons: FloatArray) -> FloatArray:
    """Points close together on the sides of polygons, (n, k, 3) to (m, 3)."""
    along = np.linspace(0.0, 1.0, 25)[:, None, None, None]
    start, end = polygons, np.roll(polygons, -1, axis=1)
    return np.asarray((start + along * (end - start)).reshape(-1, 3))
