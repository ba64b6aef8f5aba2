"""What stands in the cell, as outlines seen from above, to scale, in robot_base."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias
from xml.etree import ElementTree

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull, QhullError

from reachmap._typing import FloatArray
from reachmap.cell.files.resources import SCHEME, NotFoundError, Resolver
from reachmap.cell.files.xml_text import parse_xml
from reachmap.cell.model.cell import BinSpec, Cell
from reachmap.cell.model.fields import CylinderShape, Shape
from reachmap.geometry import (
    inverse_transform,
    rotation_from_rpy_deg,
    transform_from_parts,
)
from reachmap.plots.parts.style import BIN_COLOUR, INK

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


NAME = "robot base"
# Stands for a base whose shape cannot be read on this machine [m].
NOMINAL_RADIUS = 0.05
STAR_SECTORS = 120


def base_outline(cell: Cell, urdf: str) -> Outline:
    """Outline of the links fixed to the base, in robot_base, from above.

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
    if points is not None:
        return _star_outline(points)
    spec = Shape(cylinder=CylinderShape(radius=NOMINAL_RADIUS, length=0.001))
    circle = shape_points(spec)
    assert circle is not None
    return hull_outline(f"{NAME} (origin)", "base", circle)


def _star_outline(points: FloatArray) -> Outline:
    """Outline of points as the farthest in each direction from the origin.

    A convex hull would close the gap between a round base and its connector.
    """
    angle = np.arctan2(points[:, 1], points[:, 0])
    sector = np.floor((angle + np.pi) / (2.0 * np.pi) * STAR_SECTORS).astype(int)
    radius = np.linalg.norm(points[:, :2], axis=1)
    farthest = [
        members[int(radius[members].argmax())]
        for index in range(STAR_SECTORS)
        if (members := np.flatnonzero(sector % STAR_SECTORS == index)).size
    ]
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    polygon = points[farthest, :2]
    return Outline(name=NAME, kind="base", polygon=polygon, z_low=low, z_high=high)


def _base_points(cell: Cell, urdf: str) -> FloatArray | None:
    try:
        root = parse_xml(urdf, "urdf")
        find = partial(_mesh_path, cell)
        points = [
            part @ T[:3, :3].T + T[:3, 3]
            for link, T in _fixed_links(root, cell.robot.base_frame).items()
            for part in _link_points(root, link, find)
        ]
    except (NotFoundError, OSError, ValueError):
        return None
    return np.concatenate(points) if points else None


def _mesh_path(cell: Cell, reference: str) -> Path:
    """Path of a mesh that the URDF names; NotFoundError if it is not here."""
    resolver = Resolver(directory=Path(), packages=cell.resources.packages)
    if reference.startswith(SCHEME):
        return resolver.around(cell.robot.urdf).resolve(reference)
    urdf, root = resolver.resolve_robot(cell.robot.urdf)
    return resolver.resolve_from_urdf(reference, urdf.parent, root)


def _fixed_links(root: ElementTree.Element, base: str | None) -> dict[str, FloatArray]:
    """Pose in robot_base of each link that fixed joints tie to it."""
    joints = root.findall("joint")
    children = {_end(joint, "child") for joint in joints}
    links = [link.get("name", "") for link in root.findall("link")]
    start = base or next((link for link in links if link not in children), "")
    poses = {start: np.eye(4)}
    fixed = [joint for joint in joints if joint.get("type") == "fixed"]
    # A link may be reached from either side; each pass adds at least one or ends it.
    for _ in fixed:
        for joint in fixed:
            parent, child = _end(joint, "parent"), _end(joint, "child")
            T = _origin(joint)
            if parent in poses and child not in poses:
                poses[child] = poses[parent] @ T
            elif child in poses and parent not in poses:
                poses[parent] = poses[child] @ inverse_transform(T)
    return poses


def _end(joint: ElementTree.Element, role: str) -> str:
    element = joint.find(role)
    return "" if element is None else element.get("link", "")


def _origin(element: ElementTree.Element) -> FloatArray:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    xyz = np.array(origin.get("xyz", "0 0 0").split(), float)
    rpy = np.rad2deg(np.array(origin.get("rpy", "0 0 0").split(), float))
    return transform_from_parts(rotation_from_rpy_deg(rpy), xyz)


def _link_points(
    root: ElementTree.Element, name: str, find: Callable[[str], Path]
) -> list[FloatArray]:
    found = []
    for link in root.findall("link"):
        if link.get("name") != name:
            continue
        for collision in link.findall("collision"):
            T = _origin(collision)
            points = _geometry_points(collision.find("geometry"), find)
            found.append(points @ T[:3, :3].T + T[:3, 3])
    return found


def _geometry_points(
    geometry: ElementTree.Element | None, find: Callable[[str], Path]
) -> FloatArray:
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None:
        return np.zeros((0, 3))
    if shape.tag == "mesh":
        scale = np.array(shape.get("scale", "1 1 1").split(), float)
        path = find(shape.get("filename", ""))
        return _edge_points(read_stl_points(path).reshape(-1, 3, 3) * scale)
    numbers = {key: float(v) for key, v in shape.attrib.items() if key != "size"}
    if shape.tag == "box":
        spec = Shape.model_validate({"box": shape.get("size", "").split()})
    else:
        value = numbers if shape.tag == "cylinder" else {"radius": numbers["radius"]}
        spec = Shape.model_validate({shape.tag: value})
    points = shape_points(spec)
    assert points is not None
    # Every pair of points is joined: of a convex shape no line leaves it.
    first, second = np.triu_indices(len(points), 1)
    if len(points) > 200:
        return points
    return _edge_points(np.stack([points[first], points[second]], axis=1))


def _edge_points(polygons: FloatArray) -> FloatArray:
    """Points close together on the sides of polygons, (n, k, 3) to (m, 3)."""
    along = np.linspace(0.0, 1.0, 25)[:, None, None, None]
    start, end = polygons, np.roll(polygons, -1, axis=1)
    return np.asarray((start + along * (end - start)).reshape(-1, 3))


def read_stl_points(path: Path) -> FloatArray:
    """Corners of the triangles of an STL file, binary or text, shape (n, 3).

    Raises
    ------
    ValueError
        The file is no STL file.
    """
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    # Some binary files begin with "solid" as text files do; the size tells.
    if len(data) == 84 + 50 * count:
        layout = np.dtype([("points", "<f4", (4, 3)), ("attribute", "<u2")])
        triangles = np.frombuffer(data, layout, count, 84)["points"]
        return np.asarray(triangles[:, 1:].reshape(-1, 3), float)
    words = data.decode("ascii").split()
    places = [i for i, word in enumerate(words) if word == "vertex"]
    if not places:
        raise ValueError(f"{path.name}: not an STL file")
    return np.array([words[i + 1 : i + 4] for i in places], float)
