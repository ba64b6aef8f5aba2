"""Can a bin stand at a pose: does it meet what stands there, or the arm above it.

The surroundings and the arm at one configuration stay where they are, and the bin is
moved from pose to pose, which takes microseconds where a new scene takes a tenth of a
second.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import coal
import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray
from reachmap.core.bodies import ROOT, bin_boxes, build_geometry
from reachmap.geometry import transform_from_parts

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.core.robot import RobotModel

CONTACT_M = 2e-4
WHOLE = "bin"


@dataclass(frozen=True, slots=True, kw_only=True)
class BinContact:
    """What a bin meets.

    Attributes
    ----------
    part : str
        Part of the bin, ``bin wall +x`` for example, or ``bin`` for its inside.
    other : str
        Body or link.
    at_scan : bool
        Whether the other is carried by the arm, which is at the scan configuration.
    """

    part: str
    other: str
    at_scan: bool

    @property
    def reason(self) -> str:
        """Why the bin cannot stand there, without the part: few different texts."""
        where = " at the scan configuration" if self.at_scan else ""
        return f"the bin meets {self.other}{where}"

    @property
    def pair(self) -> str:
        """Both bodies, in words."""
        where = " at the scan configuration" if self.at_scan else ""
        return f"{self.part} touches {self.other}{where}"


class BinFit:
    """Checks poses of the bin against bodies that stand still and against the arm.

    A body may touch the bin from outside, as a table does that carries it, but not
    reach into it or its inner volume. The arm keeps the cell's safety margin, as in
    every plan.

    Parameters
    ----------
    robot : RobotModel
    loaded : LoadedCell
        Its own bin pose is not used.
    q : array, shape (dof,)
        Scan configuration [rad].
    """

    def __init__(self, robot: RobotModel, loaded: LoadedCell, q: FloatArray) -> None:
        self._robot, self._q = robot, np.asarray(q, float)
        self._data = robot.model.createData()
        spec = loaded.cell.bin
        parts = bin_boxes(spec)
        bodies = build_geometry(robot, loaded, with_bin=True)
        names = list(bodies.names)
        first = len(names) - len(parts)
        allowed = _touches(loaded)
        still = [
            k
            for k in range(first)
            if bodies.geometry.geometryObjects[k].parentJoint == ROOT
            and names[k] not in allowed
        ]
        margin = loaded.cell.collision.safety_margin_m
        self._arm = _Movable(
            bodies.geometry.copy(),
            names,
            [
                (k, np.array(parts[k - first].centre_m))
                for k in range(first, len(names))
            ],
            lambda pair: pair.first >= first or pair.second >= first,
            margin,
        )
        solid = _solid_of(parts)
        geometry = bodies.geometry.copy()
        for pair in list(geometry.collisionPairs):
            geometry.removeCollisionPair(pair)
        moved: list[tuple[int, FloatArray]] = []
        for name, size, centre in [
            *((p.name, p.size_m, p.centre_m) for p in parts),
            (WHOLE, *solid),
        ]:
            # A little smaller, so that standing on a table is not a collision.
            shape = coal.Box(*(np.array(size) - CONTACT_M))
            index = geometry.addGeometryObject(
                pin.GeometryObject(f"still {name}", ROOT, 0, pin.SE3.Identity(), shape)
            )
            names.append(name)
            moved.append((index, np.array(centre)))
            for other in still:
                geometry.addCollisionPair(pin.CollisionPair(other, index))
        self._still = _Movable(geometry, names, moved, lambda pair: True, 0.0)

    def contact(self, T_base_bin: FloatArray) -> BinContact | None:
        """First thing that the bin meets at a pose (4, 4), or None."""
        T_root_bin = self._robot.T_root_base @ T_base_bin
        for movable, at_scan in ((self._still, False), (self._arm, True)):
            pair = movable.first_pair(
                self._robot.model, self._data, self._q, T_root_bin
            )
            if pair is not None:
                a, b = pair
                part, other = (a, b) if a.startswith(WHOLE) else (b, a)
                return BinContact(part=part, other=other, at_scan=at_scan)
        return None


def _touches(loaded: LoadedCell) -> set[str]:
    """Bodies that the cell lets the bin touch."""
    cell = loaded.cell
    with_bin = {body.name for body in cell.bodies if WHOLE in body.touch}
    return {*cell.bin.touch, *with_bin}


def _solid_of(parts: Iterable[Any]) -> tuple[FloatArray, FloatArray]:
    """Size and centre of the box around all parts of a bin, bin frame [m]."""
    low = np.min([np.array(p.centre_m) - np.array(p.size_m) / 2 for p in parts], axis=0)
    high = np.max(
        [np.array(p.centre_m) + np.array(p.size_m) / 2 for p in parts], axis=0
    )
    return high - low, (low + high) / 2


class _Movable:
    """A geometry model of which some objects are moved together."""

    def __init__(
        self,
        geometry: Any,
        names: list[str],
        moved: list[tuple[int, FloatArray]],
        keep: Any,
        margin_m: float,
    ) -> None:
        for pair in [p for p in geometry.collisionPairs if not keep(p)]:
            geometry.removeCollisionPair(pair)
        self._geometry, self._names, self._moved = geometry, list(names), moved
        self._data = geometry.createData()
        for request in self._data.collisionRequests:
            request.security_margin = margin_m

    def first_pair(
        self, model: Any, data: Any, q: FloatArray, T_root_bin: FloatArray
    ) -> tuple[str, str] | None:
        """Names of the first pair that touches, or None."""
        objects = self._geometry.geometryObjects
        for index, centre in self._moved:
            T = T_root_bin @ transform_from_parts(np.eye(3), centre)
            objects[index].placement = pin.SE3(np.ascontiguousarray(T))
        if not pin.computeCollisions(model, data, self._geometry, self._data, q, True):
            return None
        for pair, result in zip(
            self._geometry.collisionPairs, self._data.collisionResults, strict=True
        ):
            if result.isCollision():
                return self._names[pair.first], self._names[pair.second]
        return None
