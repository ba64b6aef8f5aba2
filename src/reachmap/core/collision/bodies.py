"""Coal geometry of a cell: links, attached bodies, surroundings and the bin.

Every geometry has the name that users know: a link's name, a body's name from the
cell, or ``bin bottom`` and ``bin wall +x``. Every two of them that can move against
each other are a pair, but for links that a joint joins and for pairs that may touch.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray
from reachmap.cell.files.collisions import LinkShape
from reachmap.cell.files.files import body_key
from reachmap.cell.files.srdf import parse_srdf
from reachmap.cell.files.urdf import UrdfDescription
from reachmap.cell.meshes.reading import MeshError, read_mesh
from reachmap.cell.model.bin_parts import BinPart, bin_parts
from reachmap.cell.model.bodies import BinSpec
from reachmap.cell.model.fields import Shape
from reachmap.cell.model.shapes import Solid
from reachmap.cell.pick_cycle import PART
from reachmap.core.collision.held_part import HeldPart
from reachmap.core.collision.shapes import coal_shape
from reachmap.core.robot.model import RobotModel
from reachmap.errors import SceneError
from reachmap.geometry import transform_from_parts

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

ROOT = 0
BOTTOM, HEAP, SHELL = "bin bottom", "bin heap", "bin shell"
LAIN_ON = (BOTTOM, HEAP)
"""Parts of a bin that a part may lie on."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyGeometry:
    """Geometry of everything in the cell, and the pairs to be checked.

    Attributes
    ----------
    geometry : pinocchio.GeometryModel
    names : tuple of str
        User's name of each geometry object.
    shapes : tuple of Shape, TriangleMesh or ConvexBody
        What each is made of.
    """

    geometry: Any = field(repr=False)
    names: tuple[str, ...]
    shapes: tuple[Solid, ...] = field(repr=False)

    def pair_names(self) -> tuple[str, ...]:
        """``"A | B"`` for each collision pair, in pair order."""
        return tuple(
            f"{self.names[pair.first]} | {self.names[pair.second]}"
            for pair in self.geometry.collisionPairs
        )


def parts_of_bin(loaded: LoadedCell, name: str | None = None) -> tuple[BinPart, ...]:
    """Parts of a cell's bin, or of another by name, its mesh read where it has one.

    Raises
    ------
    SceneError
        The mesh cannot be read.
    """
    if name is not None:
        return _parts_of(loaded, loaded.cell.bins[name], f"bin {name}")
    return _parts_of(loaded, loaded.cell.bin, "bin")


def _parts_of(loaded: LoadedCell, spec: BinSpec, label: str) -> tuple[BinPart, ...]:
    shell = None
    if spec.mesh is not None:
        key = body_key(label, spec.mesh.file)
        shell = _read_mesh(loaded, key, label, spec.mesh.scale)
    return bin_parts(spec, shell)


def bin_placements(robot: RobotModel, loaded: LoadedCell) -> dict[str, FloatArray]:
    """Poses (4, 4) of the bin's parts in the model's root frame, by name."""
    spec = loaded.cell.bin
    return {part.name: T for part, T in _placed_parts(robot, loaded, spec, "bin")}


Load = Literal["empty", "lifted", "carried"]
"""What the tool carries: nothing, the part still on its support, or the part."""


def world_placements(robot: RobotModel, loaded: LoadedCell) -> dict[str, FloatArray]:
    """Poses (4, 4) of the bodies on the world in the model's root frame, by name."""
    return {
        body.name: np.asarray(robot.T_root_world @ body.pose.matrix())
        for body in loaded.cell.bodies
        if body.attach_to == "world"
    } | {
        f"{name} {part.name}": T
        for name, spec in loaded.cell.bins.items()
        if spec.frame == "world"
        for part, T in _placed_parts(robot, loaded, spec, f"bin {name}")
    }


def _placed_parts(
    robot: RobotModel, loaded: LoadedCell, spec: BinSpec, label: str
) -> Iterator[tuple[BinPart, FloatArray]]:
    """Parts of one of the bins with their poses (4, 4) in the root frame."""
    T_root_bin = robot.T_root_base @ loaded.cell.T_base_of(spec)
    for part in _parts_of(loaded, spec, label):
        T_bin_part = transform_from_parts(np.eye(3), part.centre_m)
        yield part, np.asarray(T_root_bin @ T_bin_part)


def world_shapes(loaded: LoadedCell) -> dict[str, Any]:
    """Coal shapes of the primitives on the world, by name."""
    return {
        body.name: coal_shape(body.shape)
        for body in loaded.cell.bodies
        if body.attach_to == "world" and body.shape.mesh is None
    }


def build_geometry(
    robot: RobotModel, loaded: LoadedCell, *, with_bin: bool, load: Load = "empty"
) -> BodyGeometry:
    """Assemble the geometry of a cell.

    Parameters
    ----------
    robot : RobotModel
    loaded : LoadedCell
    with_bin : bool
        Whether the bin stands in the scene; other bins beside it always do.
    load : Load
        Whether the cell's part is a body, called ``part``. While it is lifted, what it
        lay on is left to :mod:`reachmap.core.planning.lift`.

    Raises
    ------
    SceneError
        A mesh cannot be read, or a frame or touch name does not exist.
    """
    builder = _Builder(robot)
    _add_links(builder, loaded)
    for body in loaded.cell.bodies:
        joint, T_joint_frame = robot.frame_placement(body.attach_to)
        shape = _body_shape(loaded, body.name, body.shape)
        builder.add(body.name, joint, T_joint_frame @ body.pose.matrix(), shape)
    held = None if load == "empty" else HeldPart.of(loaded)
    if held is not None:
        T = robot.T_joint_tcp @ held.T_tcp_part
        builder.add(PART, robot.tcp_joint, T, held.solid)
    if with_bin:
        placements = bin_placements(robot, loaded)
        for part in parts_of_bin(loaded):
            builder.add(part.name, ROOT, placements[part.name], part.shape)
    for name, spec in loaded.cell.bins.items():
        for part, T in _placed_parts(robot, loaded, spec, f"bin {name}"):
            builder.add(f"{name} {part.name}", ROOT, T, part.shape)
    touches = [(body.name, body.touch) for body in loaded.cell.bodies]
    touches += [(name, spec.touch) for name, spec in loaded.cell.bins.items()]
    builder.own, builder.others = loaded.cell.bin.name, tuple(loaded.cell.bins)
    if with_bin:
        touches.append(("bin", loaded.cell.bin.touch))
    if held is not None:
        touches.append((PART, held.touch))
    builder.allow(touches, with_bin=with_bin)
    if held is not None and with_bin and load == "lifted":
        _let_part_leave(builder, loaded)
    return BodyGeometry(
        geometry=builder.geometry,
        names=tuple(builder.names),
        shapes=tuple(builder.shapes),
    )


def _let_part_leave(builder: _Builder, loaded: LoadedCell) -> None:
    """Take out the pairs of a part and what it lies on.

    The bottom of a bin that is a mesh is part of its shell, which is lowered for the
    part by what the part may be inside it: its walls stay where they are.
    """
    names = [part.name for part in parts_of_bin(loaded)]
    builder.remove((PART, name) for name in LAIN_ON if name in names)
    if SHELL not in names:
        return
    cell = loaded.cell
    lowered = bin_placements(builder.robot, loaded)[SHELL].copy()
    down_m = cell.lift.contact_allowance_m + cell.collision.safety_margin_m
    lowered[:3, 3] -= down_m * lowered[:3, 2]
    shell = builder.shapes[builder.names.index(SHELL)]
    builder.remove([(PART, SHELL)])
    builder.add(SHELL, ROOT, lowered, shell, PART)


def _add_links(builder: _Builder, loaded: LoadedCell) -> None:
    """Add the links in the order of the file, without pairs that need no check."""
    description = loaded.robot
    names = []
    for item in description.collisions:
        joint, T_joint_link = builder.robot.link_placement(item.link)
        shape = _link_shape(loaded, item)
        builder.add(item.link, joint, T_joint_link @ item.origin.matrix(), shape)
        names.append(item.link)
    srdf = parse_srdf(loaded.srdf, "SRDF", description) if loaded.srdf else None
    joined = _joined_links(description)
    builder.remove(
        (first, second)
        for first in names
        for second in names
        if frozenset((first, second)) in joined
        or (srdf is not None and srdf.ignores(first, second))
    )


def _joined_links(description: UrdfDescription) -> set[frozenset[str]]:
    """Pairs of links that one joint joins, and that touch there by design.

    A tool that is fixed to the last link is not joined to the link before it, whatever
    the number of links between: it can swing into it.
    """
    return {frozenset((j.parent, j.child)) for j in description.joints.values()}


def _link_shape(loaded: LoadedCell, item: LinkShape) -> Solid:
    if item.shape is not None:
        return item.shape
    return _read_mesh(loaded, item.mesh, f"link {item.link!r}", item.scale)


def _body_shape(loaded: LoadedCell, name: str, shape: Shape) -> Solid:
    if shape.mesh is None:
        return shape
    key = body_key(name, shape.mesh.file)
    return _read_mesh(loaded, key, f"body {name!r}", shape.mesh.scale)


def _read_mesh(loaded: LoadedCell, key: str, owner: str, scale: Any) -> Solid:
    path = loaded.mesh_paths[key]
    try:
        return read_mesh(path.read_bytes(), path.suffix, scale)
    except (OSError, MeshError) as error:
        raise SceneError(
            f"{owner}: {path.name} cannot be read as a mesh ({error})"
        ) from error


class _Builder:
    """Adds bodies one by one, each paired with all that moves relative to it."""

    def __init__(self, robot: RobotModel) -> None:
        self.robot = robot
        self.geometry = pin.GeometryModel()
        self.names: list[str] = []
        self.shapes: list[Solid] = []
        # Names of the bin to pick from and of the other bins.
        self.own: str | None = None
        self.others: tuple[str, ...] = ()

    def add(
        self,
        name: str,
        joint: int,
        T_joint_body: FloatArray,
        shape: Solid,
        only: str | None = None,
    ) -> None:
        """Add one body and pair it with all on other joints, or with one body only."""
        placement = pin.SE3(np.ascontiguousarray(T_joint_body))
        # The engine wants names that differ; a link may have several shapes.
        index = self.geometry.addGeometryObject(
            pin.GeometryObject(
                f"{len(self.names)} {name}", joint, ROOT, placement, coal_shape(shape)
            )
        )
        for other in range(index):
            if only not in (None, self.names[other]):
                continue
            if self.geometry.geometryObjects[other].parentJoint != joint:
                self.geometry.addCollisionPair(pin.CollisionPair(other, index))
        self.names.append(name)
        self.shapes.append(shape)

    def allow(
        self, touches: Iterable[tuple[str, tuple[str, ...]]], *, with_bin: bool
    ) -> None:
        """Take out the pairs that may touch.

        ``bin`` stands for the parts of all bins, a bin's name for its own. What is
        not in this scene, such as a bin that was left out, allows nothing.
        """
        self.remove(
            pair
            for body, others in touches
            for other in others
            for pair in self._expand(body, other, with_bin=with_bin)
        )

    def remove(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Take out pairs of names."""
        allowed = {frozenset(pair) for pair in pairs}
        # Copied first: a pair is a view that shifts when one before it is removed.
        numbers = [(pair.first, pair.second) for pair in self.geometry.collisionPairs]
        for first, second in numbers:
            if frozenset((self.names[first], self.names[second])) in allowed:
                self.geometry.removeCollisionPair(pin.CollisionPair(first, second))

    def _expand(self, a: str, b: str, *, with_bin: bool) -> Iterable[tuple[str, str]]:
        def parts(name: str) -> list[str]:
            if name in self.others:
                return [n for n in self.names if n.startswith(f"{name} bin ")]
            if name not in ("bin", self.own):
                return [name]
            own = [n for n in self.names if with_bin and n.startswith("bin ")]
            others = self.others if name == "bin" else ()
            return own + [n for other in others for n in parts(other)]

        for first in parts(a):
            for second in parts(b):
                yield first, second


def disable_cached_guesses(requests: Any) -> None:
    """Make checks independent of guesses cached by earlier ones.

    Its guess would change answers in the last digits, and saves no time that could be
    measured.
    """
    with warnings.catch_warnings():
        # The setting that coal has in its place acts beside this one, not instead.
        warnings.simplefilter("ignore", DeprecationWarning)
        for request in requests:
            request.enable_cached_gjk_guess = False
