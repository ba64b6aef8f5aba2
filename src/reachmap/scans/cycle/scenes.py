"""The scenes of a cycle: the tool empty, with the part leaving, with the part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.collision.bodies import BOTTOM, HEAP, SHELL
from reachmap.core.collision.held_part import HeldPart
from reachmap.core.scene import Scene
from reachmap.errors import SceneError

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

STAGES = ("lift", "transfer", "place", "retreat", "return")
LIFT, TRANSFER, PLACE, _, RETURN = range(len(STAGES))


def stages_of(loaded: LoadedCell) -> tuple[str, ...]:
    """Stages after the grasp; none without a part, a lift if it goes nowhere."""
    if loaded.cell.held() is None:
        return ()
    return STAGES if loaded.cell.drop_offs else STAGES[:1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CycleScenes:
    """The same cell with different loads.

    Attributes
    ----------
    empty, lifted, carried : Scene
    part : HeldPart
    """

    empty: Scene
    lifted: Scene
    carried: Scene
    part: HeldPart

    @classmethod
    def of(cls, loaded: LoadedCell) -> CycleScenes | None:
        """Scenes of a cell; None where it has no part."""
        part = HeldPart.of(loaded)
        if part is None:
            return None
        return cls(
            empty=Scene.shared(loaded),
            lifted=Scene.shared(loaded, load="lifted"),
            carried=Scene.shared(loaded, load="carried"),
            part=part,
        )

    @property
    def body_pairs(self) -> tuple[str, ...]:
        """Pairs of bodies of all scenes, those of the empty tool first."""
        scenes = (self.empty, self.lifted, self.carried)
        names = [name for scene in scenes for name in scene.checker.body_pairs]
        lain_on = (f"part | {name}" for name in (BOTTOM, HEAP, SHELL))
        return tuple(dict.fromkeys([*names, *lain_on]))

    def least_times_s(self, q: FloatArray, Q: FloatArray) -> FloatArray:
        """Lower bounds on times of paths between configurations [s], (n, dof) to (n,).

        Whatever the time law: each joint has to make its motion, from rest to rest.
        """
        robot = self.empty.robot
        v, a = robot.velocity_rad_s, robot.acceleration_rad_s2
        change = np.abs(Q - q)
        ramps = 2.0 * np.sqrt(change / a)
        cruise = change / v + v / a
        return np.asarray(np.where(change < v * v / a, ramps, cruise).max(axis=1))

    def home(self) -> FloatArray | None:
        """Configuration that the arm returns to first; None: straight to the scan.

        Raises
        ------
        SceneError
            It cannot be taken.
        """
        given = self.empty.loaded.cell.cycle.return_to
        if given is None:
            return None
        where, robot = "cycle.return_to", self.empty.robot
        q = robot.configuration(self.empty.loaded.joint_values_rad(given), where)
        outside = robot.outside_limits(q)
        if outside:
            raise SceneError(f"{where}: {', '.join(outside)} is outside its limits")
        pair = self.empty.checker.blocking_pair(q)
        if pair >= 0:
            first, second = self.empty.checker.body_pairs[pair].split(" | ")
            raise SceneError(f"{where}: {first} touches {second}")
        return q
