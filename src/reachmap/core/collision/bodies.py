"""Coal geometry of a cell: links, attached bodies, surroundings and the bin.

Every geometry has the name that users know: a link's name, a body's name from the
cell, or ``bin bottom`` and ``bin wall +x``. Pairs that may touch are left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import coal
import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import BinSpec
from reachmap.cell.model.fields import Shape
from reachmap.core.robot.model import RobotModel
from reachmap.errors import SceneError
from reachmap.geometry import transform_from_parts

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

ROOT = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class BinBox:
    """One of the five boxes a bin is made of, in the bin frame."""

    name: str
    size_m: tuple[float, float, float]
    centre_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyGeometry:
    """Geometry of everything in the cell, and the pairs to be checked.

    Attributes
    ----------
    geometry : pinocchio.GeometryModel
    names : tuple of str
        User's name of each geometry object.
    """

    geometry: Any = field(repr=False)
    names: tuple[str, ...]

    def pair_names(self) -> tuple[str, ...]:
        """``"A | B"`` for each collision pair, in pair order."""
        return tuple(
            f"{self.names[pair.first]} | {self.names[pair.second]}"
            for pair in self.geometry.collisionPairs
        )


def bin_boxes(spec: BinSpec) -> tuple[BinBox, ...]:
    """Bottom and four walls around the inner volume, in the bin frame.

    The frame's origin is the centre of the inner bottom, z up.
    """
    x, y, depth = spec.inner
    wall = spec.wall
    bottom = spec.bottom if spec.bottom is not None else wall
    outer_y = y + 2 * wall
    height, middle = depth + bottom, (depth - bottom) / 2
    walls = [
        (
            f"bin wall {sign}x",
            (wall, outer_y, height),
            (s * (x + wall) / 2, 0.0, middle),
        )
        for sign, s in (("+", 1), ("-", -1))
    ] + [
        (f"bin wall {sign}y", (x, wall, height), (0.0, s * (y + wall) / 2, middle))
        for sign, s in (("+", 1), ("-", -1))
    ]
    floor = ("bin bottom", (x, y, bottom), (0.0, 0.0, -bottom / 2))
    return tuple(BinBox(name=n, size_m=s, centre_m=c) for n, s, c in (floor, *walls))


def bin_placements(robot: RobotModel, spec: BinSpec) -> dict[str, FloatArray]:
    """Poses (4, 4) of the bin's boxes in the model's root frame, by name."""
    T_root_bin = robot.T_root_base @ spec.pose.matrix()
    return {
        box.name: np.asarray(
            T_root_bin @ transform_from_parts(np.eye(3), np.array(box.centre_m))
        )
        for box in bin_boxes(spec)
    }


def build_geometry(
    robot: RobotModel, loaded: LoadedCell, *, with_bin: bool
) -> BodyGeometry:
    """Assemble the geometry of a cell.

    Parameters
    ----------
    robot : RobotModel
    loaded : LoadedCell
    with_bin : bool
        Whether the bin stands in the scene.

    Raises
    ------
    SceneError
        A mesh cannot be read, or a frame or touch name does not exist.
    """
    geometry = _link_geometry(robot)
    _keep_link_pairs(robot.model, geometry, loaded.srdf)
    builder = _Builder(robot, geometry)
    for body in loaded.cell.bodies:
        joint, T_joint_frame = robot.frame_placement(body.attach_to)
        shape = coal_shape(body.shape, loaded, body.name)
        builder.add(body.name, joint, T_joint_frame @ body.pose.matrix(), shape)
    if with_bin:
        placements = bin_placements(robot, loaded.cell.bin)
        for box in bin_boxes(loaded.cell.bin):
            builder.add(box.name, ROOT, placements[box.name], coal.Box(*box.size_m))
    touches = [(body.name, body.touch) for body in loaded.cell.bodies]
    if with_bin:
        touches.append(("bin", loaded.cell.bin.touch))
    builder.allow(touches, with_bin=with_bin)
    return BodyGeometry(geometry=geometry, names=tuple(builder.names))


def coal_shape(shape: Shape, loaded: LoadedCell, body: str) -> Any:
    """Collision geometry of a shape; meshes are loaded as surfaces.

    Raises
    ------
    SceneError
        The mesh file cannot be read.
    """
    kind, value = shape.kind()
    if kind == "box":
        return coal.Box(*value)
    if kind == "sphere":
        return coal.Sphere(value.radius)
    if kind == "cylinder":
        return coal.Cylinder(value.radius, value.length)
    if kind == "capsule":
        return coal.Capsule(value.radius, value.length)
    scale = np.broadcast_to(np.array(value.scale, float), (3,)).copy()
    path = loaded.resolve(value.file)
    try:
        mesh = coal.MeshLoader().load(str(path), scale)
    except Exception as error:
        raise SceneError(
            f"body {body!r}: {path.name} cannot be read as a mesh ({error})"
        ) from error
    if mesh.num_tris == 0:
        raise SceneError(f"body {body!r}: {path.name} holds no triangles")
    return mesh


def link_name(geometry_name: str) -> str:
    """Link of a URDF geometry, which Pinocchio numbers: ``forearm_link_0``."""
    return re.sub(r"_\d+$", "", geometry_name)


def _link_geometry(robot: RobotModel) -> Any:
    try:
        return pin.buildGeomFromUrdfString(
            robot.model,
            robot.urdf,
            pin.GeometryType.COLLISION,
            package_dirs=list(robot.package_dirs),
        )
    except Exception as error:
        raise SceneError(
            f"robot.urdf: collision geometry cannot be built ({error})"
        ) from error


def _keep_link_pairs(model: Any, geometry: Any, srdf: str) -> None:
    """Pairs of links, but for neighbours in the chain and the SRDF's exceptions."""
    geometry.addAllCollisionPairs()
    if srdf:
        pin.removeCollisionPairsFromXML(model, geometry, srdf)
    objects = geometry.geometryObjects
    for pair in list(geometry.collisionPairs):
        a, b = objects[pair.first].parentJoint, objects[pair.second].parentJoint
        if model.parents[a] == b or model.parents[b] == a:
            geometry.removeCollisionPair(pair)


class _Builder:
    """Adds bodies one by one, each paired with all that it moves against."""

    def __init__(self, robot: RobotModel, geometry: Any) -> None:
        self.robot = robot
        self.geometry = geometry
        self.names = [link_name(g.name) for g in geometry.geometryObjects]

    def add(self, name: str, joint: int, T_joint_body: FloatArray, shape: Any) -> None:
        """Add one body and pair it with everything on other joints."""
        placement = pin.SE3(np.ascontiguousarray(T_joint_body))
        # Parent frame 0: an SRDF must not reach bodies that stand on the base link.
        frame = (
            0
            if joint == ROOT
            else self.robot.model.getFrameId(
                self.robot.model.names[joint], pin.FrameType.JOINT
            )
        )
        index = self.geometry.addGeometryObject(
            pin.GeometryObject(name, joint, frame, placement, shape)
        )
        for other in range(index):
            if self.geometry.geometryObjects[other].parentJoint != joint:
                self.geometry.addCollisionPair(pin.CollisionPair(other, index))
        self.names.append(name)

    def allow(
        self, touches: Iterable[tuple[str, tuple[str, ...]]], *, with_bin: bool
    ) -> None:
        """Take out the pairs that may touch; ``bin`` stands for its five boxes."""
        links = {f.name for f in self.robot.model.frames} | {"world", "robot_base"}
        known = set(self.names) | links | {"bin"}
        problems = [
            f"body {body!r}: touch names {other!r}, which is neither a link nor a body"
            for body, others in touches
            for other in others
            if other not in known
        ]
        if problems:
            raise SceneError(problems)
        allowed = {
            frozenset(pair)
            for body, others in touches
            for other in others
            for pair in self._expand(body, other, with_bin=with_bin)
        }
        for pair in list(self.geometry.collisionPairs):
            if frozenset((self.names[pair.first], self.names[pair.second])) in allowed:
                self.geometry.removeCollisionPair(pair)

    def _expand(self, a: str, b: str, *, with_bin: bool) -> Iterable[tuple[str, str]]:
        boxes = [n for n in self.names if with_bin and n.startswith("bin ")]
        for first in boxes if a == "bin" else [a]:
            for second in boxes if b == "bin" else [b]:
                yield first, second
