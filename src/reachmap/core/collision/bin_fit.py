"""Whether a bin fits at a pose, and which grasps its walls block for the tool alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.cell.model.bin_parts import BinPart
from reachmap.cell.model.fields import Shape
from reachmap.cell.model.shapes import corner_points, shrunk
from reachmap.core.collision.bodies import (
    ROOT,
    Load,
    build_geometry,
    parts_of_bin,
)
from reachmap.core.collision.shapes import coal_shape
from reachmap.core.collision.static_bodies import (
    PlacedBodies,
    PlacedBody,
    bodies_at,
    box_around,
)
from reachmap.geometry import inverse_transform, transform_from_parts

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.core.robot.model import RobotModel

# Less than any placement is accurate to, more than the rounding of a pose that stands
# on a surface.
CONTACT_M = 2e-4
WHOLE = "bin"


@dataclass(frozen=True, slots=True, kw_only=True)
class BinContact:
    """A collision of the bin.

    Attributes
    ----------
    part : str
        Part of the bin, ``bin wall +x`` for example, or ``bin`` for its inside.
    other : str
        Body or link.
    at_scan : bool
        Whether the arm carries the other, and is at the scan configuration.
    """

    part: str
    other: str
    at_scan: bool

    @property
    def reason(self) -> str:
        """Why the bin cannot stand there; the same text for all its parts."""
        where = " at the scan configuration" if self.at_scan else ""
        return f"the bin collides with {self.other}{where}"

    @property
    def pair(self) -> str:
        """Both bodies, in words."""
        where = " at the scan configuration" if self.at_scan else ""
        return f"{self.part} touches {self.other}{where}"


class BinFit:
    """Checks poses of the bin against static bodies and against the arm.

    A body may touch the bin from outside, as a table does that carries it, but not
    penetrate it. The arm keeps the cell's safety margin, as in every plan.

    Parameters
    ----------
    robot : RobotModel
    loaded : LoadedCell
        Its own bin pose is not used.
    q : array, shape (dof,), or None
        Scan configuration [rad]; None where it is not known yet, and the arm is left
        out.
    empty : bool
        Whether what stands still may not be inside the bin either; a divider may,
        as long as it does not penetrate walls or bottom.
    name : str, optional
        Which of the other bins to check, in place of the one to pick from.
    """

    def __init__(
        self,
        robot: RobotModel,
        loaded: LoadedCell,
        q: FloatArray | None,
        *,
        empty: bool = True,
        name: str | None = None,
    ) -> None:
        others = {n: spec for n, spec in loaded.cell.bins.items() if n != name}
        beside = loaded.with_other_bins(others)
        geometry = build_geometry(robot, beside, with_bin=False)
        bodies = bodies_at(robot, geometry, np.zeros(robot.dof) if q is None else q)
        parts = parts_of_bin(loaded, name)
        allowed = _Touches(loaded, name)
        # A little smaller, so that standing on a table is not a collision.
        still_parts = [_part(part, CONTACT_M) for part in parts]
        if empty:
            still_parts.append(_part(_around(parts), CONTACT_M))
        still = PlacedBodies(b for b in bodies if b.joint == ROOT)
        self._groups = [_Group(still, still_parts, allowed)]
        if q is not None:
            margin_m = loaded.cell.collision.safety_margin_m
            arm = PlacedBodies((b for b in bodies if b.joint != ROOT), margin_m)
            self._groups.append(
                _Group(arm, [_part(part, 0.0) for part in parts], allowed)
            )

    def contact(self, T_base_bin: FloatArray) -> BinContact | None:
        """First thing that the bin collides with at a pose (4, 4), or None."""
        for group in self._groups:
            pair = group.first_pair(T_base_bin)
            if pair is not None:
                part, body = pair
                return BinContact(
                    part=part, other=body.name, at_scan=body.joint != ROOT
                )
        return None


def misplaced_bins(
    robot: RobotModel, loaded: LoadedCell
) -> Iterator[tuple[str, BinContact]]:
    """Key of each bin that penetrates what stands still, and what it meets first.

    Two bins that penetrate each other are reported once.
    """
    cell = loaded.cell
    contact = BinFit(robot, loaded, None, empty=False).contact(cell.T_base_bin())
    if contact is not None:
        yield cell.bin_key, contact
    rest = dict(cell.bins)
    for name, spec in cell.bins.items():
        beside = loaded.with_other_bins(rest)
        fit = BinFit(robot, beside, None, empty=False, name=name)
        contact = fit.contact(cell.T_base_of(spec))
        if contact is not None:
            yield f"bins.{name}", contact
        del rest[name]


class ToolFit:
    """Checks what the arm's last joint carries against the bin, without the arm.

    Parameters
    ----------
    robot : RobotModel
    loaded : LoadedCell
    load : Load
        Whether the tool holds the cell's part.
    whole : bool
        Whether the tool must also keep out of the bin's inside.

    Attributes
    ----------
    bodies : tuple of PlacedBody
        The tool's, in the TCP's frame.
    """

    def __init__(
        self,
        robot: RobotModel,
        loaded: LoadedCell,
        *,
        load: Load = "empty",
        whole: bool = False,
    ) -> None:
        q = np.zeros(robot.dof)
        geometry = build_geometry(robot, loaded, with_bin=False, load=load)
        bodies = bodies_at(robot, geometry, q)
        T_tcp_base = inverse_transform(_tcp_pose(robot, q))
        self.bodies = tuple(
            PlacedBody(name=b.name, joint=b.joint, shape=b.shape, T=T_tcp_base @ b.T)
            for b in bodies
            if b.joint == robot.tcp_joint
        )
        parts = parts_of_bin(loaded)
        self._walls = PlacedBodies(
            (
                PlacedBody(name=name, joint=ROOT, shape=shape, T=T_bin_part)
                for name, shape, T_bin_part in (
                    _part(part, 0.0) for part in ([_around(parts)] if whole else parts)
                )
            ),
            loaded.cell.collision.safety_margin_m,
        )
        self._allowed = _Touches(loaded)

    def blocked(self, T_bin_tcp: FloatArray) -> BoolArray:
        """Whether the tool touches the bin, shape (n, 4, 4) to (n,)."""
        return self.first_hit(T_bin_tcp, self.bodies) >= 0

    def first_hit(
        self, T_bin_tcp: FloatArray, bodies: Sequence[PlacedBody]
    ) -> IntArray:
        """Which of some bodies touches the bin first, (n, 4, 4) to (n,); -1: none.

        Parameters
        ----------
        T_bin_tcp : array, shape (n, 4, 4)
        bodies : sequence of PlacedBody
            In the TCP's frame: the tool's own, or others in their place.
        """
        first = np.full(len(T_bin_tcp), -1)
        for index, body in enumerate(bodies):
            T_bin_body = T_bin_tcp @ body.T
            forbidden = np.array(
                [not self._allowed(w.name, body.name) for w in self._walls.bodies]
            )
            near = self._walls.near_many(*box_around(body.shape, T_bin_body))
            near &= forbidden
            for row in np.flatnonzero(near.any(axis=1) & (first < 0)):
                among = np.flatnonzero(near[row]).tolist()
                hit = self._walls.touching(body.shape, T_bin_body[row], among)
                if hit >= 0:
                    first[row] = index
        return first


class _Touches:
    """Which contacts with the bin the cell allows."""

    def __init__(self, loaded: LoadedCell, name: str | None = None) -> None:
        cell = loaded.cell
        spec = cell.bin if name is None else cell.bins[name]
        self._of_bin = set(spec.touch)
        self._names = {WHOLE, name or spec.name or WHOLE}
        self._others = {n: set(s.touch) for n, s in cell.bins.items()}
        self._of_body = {b.name: set(b.touch) for b in cell.bodies}

    def __call__(self, part: str, other: str) -> bool:
        # A part of another bin: what the cell says of that bin, or of all, counts.
        owner = next((n for n in self._others if other.startswith(f"{n} bin ")), "")
        theirs = self._others.get(owner) or self._of_body.get(other, set())
        named = {owner, WHOLE} if owner else {other}
        return bool(self._of_bin & named or theirs & (self._names | {part}))


Part = tuple[str, Any, FloatArray]


class _Group:
    """Bodies with the shapes of the bin that must not touch them."""

    def __init__(
        self, placed: PlacedBodies, parts: list[Part], allowed: _Touches
    ) -> None:
        self._placed, self._parts, self._allowed = placed, parts, allowed
        boxes = [box_around(shape, T_bin_part) for _, shape, T_bin_part in parts]
        self._low = np.min([low for low, _ in boxes], axis=0)
        self._high = np.max([high for _, high in boxes], axis=0)

    def first_pair(self, T_base_bin: FloatArray) -> tuple[str, PlacedBody] | None:
        """Part of the bin and the body it touches first, or None."""
        R = T_base_bin[:3, :3]
        centre = R @ ((self._low + self._high) / 2) + T_base_bin[:3, 3]
        half = np.abs(R) @ ((self._high - self._low) / 2)
        near = self._placed.near(centre - half, centre + half)
        if not len(near):
            return None
        for name, shape, T_bin_part in self._parts:
            among = [
                k for k in near if not self._allowed(name, self._placed.bodies[k].name)
            ]
            hit = self._placed.touching(shape, T_base_bin @ T_bin_part, among)
            if hit >= 0:
                return name, self._placed.bodies[hit]
        return None


def _part(part: BinPart, shrink_m: float) -> Part:
    """Name, shape and pose of a part, smaller by this much along each axis."""
    T_bin_part = transform_from_parts(np.eye(3), part.centre_m)
    return part.name, coal_shape(shrunk(part.shape, shrink_m)), T_bin_part


def _around(parts: Sequence[BinPart]) -> BinPart:
    """The box around all parts of a bin, its inside included."""
    points = np.vstack([corner_points(part.shape) + part.centre_m for part in parts])
    low, high = points.min(axis=0), points.max(axis=0)
    x, y, z = (high - low).tolist()
    return BinPart(name=WHOLE, shape=Shape(box=(x, y, z)), centre_m=(low + high) / 2.0)


def _tcp_pose(robot: RobotModel, q: FloatArray) -> FloatArray:
    """T_base_tcp at q; the last joint carries the TCP."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    T_root_joint = data.oMi[robot.tcp_joint].homogeneous
    return np.asarray(robot.T_base_root @ T_root_joint @ robot.T_joint_tcp)
