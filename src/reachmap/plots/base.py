"""Outline of the robot's base, from the collision shapes of links that stand still."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.fields import CylinderShape, Shape
from reachmap.cell.model import Cell
from reachmap.cell.resources import SCHEME, NotFoundError, Resolver
from reachmap.cell.urdf import parse_xml
from reachmap.geometry import (
    inverse_transform,
    rotation_from_rpy_deg,
    transform_from_parts,
)
from reachmap.plots.outlines import Outline, hull_outline, shape_points

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
        return resolver.resolve(reference)
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
