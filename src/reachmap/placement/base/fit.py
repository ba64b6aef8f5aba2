"""Whether a robot base and its mounting fit at a pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reachmap.cell.base_pose import WORLD
from reachmap.core.collision.bodies import ROOT, build_geometry, world_shapes
from reachmap.core.collision.static_bodies import PlacedBodies, PlacedBody, bodies_at
from reachmap.core.robot.model import RobotModel
from reachmap.errors import CellError
from reachmap.placement.base.mounting import Mounting
from reachmap.placement.mapped.exact import Pose

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


class BaseFit:
    """Checks poses of a base against the bin and the bodies that stay in the world.

    Pairs that may touch, or that do as the cell is, are left out.

    Parameters
    ----------
    loaded : LoadedCell
        With its bin; its world is the level frame.
    mounting : Mounting
    """

    def __init__(self, loaded: LoadedCell, mounting: Mounting) -> None:
        self._loaded, self._mounting = loaded, mounting
        robot = RobotModel.from_cell(loaded)
        geometry = build_geometry(robot, loaded, with_bin=True)
        T_world_base = robot.T_world_base
        placed = [
            PlacedBody(
                name=body.name, joint=ROOT, shape=body.shape, T=T_world_base @ body.T
            )
            for body in bodies_at(robot, geometry, np.zeros(robot.dof))
            if body.joint == ROOT
        ]
        on_world = {b.name for b in loaded.cell.bodies if b.attach_to == WORLD}
        carried = set(mounting.stands)
        self._still = PlacedBodies(
            body
            for body in placed
            if body.name.startswith("bin ") or body.name in on_world - carried
        )
        self._base = [
            PlacedBody(
                name=body.name,
                joint=ROOT,
                shape=body.shape,
                T=np.linalg.inv(T_world_base) @ body.T,
            )
            for body in placed
            if not body.name.startswith("bin ") and body.name not in on_world
        ]
        self._touches = {b.name: set(b.touch) for b in loaded.cell.bodies}
        self._touches["bin"] = set(loaded.cell.bin.touch)
        self._as_it_is = self._pairs(loaded, first=False)

    def reason_against(self, pose: Pose) -> str:
        """What the base or a stand collides with at a pose, or ""."""
        try:
            changed = self._mounting.cell_at(self._loaded, pose)
        except CellError as error:
            return str(error)
        pairs = self._pairs(changed, first=True)
        if not pairs:
            return ""
        first, second = sorted(pairs)[0]
        return f"{first} collides with {second}"

    def _pairs(self, loaded: LoadedCell, *, first: bool) -> set[tuple[str, str]]:
        """Forbidden contacts, at most one for each moving body."""
        T_world_base = loaded.cell.robot.base_pose.matrix()
        moving = [(b.name, b.shape, T_world_base @ b.T) for b in self._base]
        shapes = world_shapes(loaded)
        moving += [
            (body.name, shapes[body.name], body.pose.matrix())
            for body in loaded.cell.bodies
            if body.name in self._mounting.stands and body.name in shapes
        ]
        found: set[tuple[str, str]] = set()
        known = set() if not first else self._as_it_is
        for name, shape, T in moving:
            among = [
                k
                for k in range(len(self._still.bodies))
                if not self._may_touch(name, self._still.bodies[k].name)
                and (name, self._still.bodies[k].name) not in known
            ]
            while among:
                hit = self._still.touching(shape, T, among)
                if hit < 0:
                    break
                found.add((name, self._still.bodies[hit].name))
                if first:
                    return found
                among = among[among.index(hit) + 1 :]
        return found

    def _may_touch(self, first: str, second: str) -> bool:
        other = "bin" if second.startswith("bin ") else second
        return (
            other in self._touches.get(first, ())
            or second in self._touches.get(first, ())
            or first in self._touches.get(other, ())
        )
