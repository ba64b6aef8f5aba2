"""The straight lift of a part out of the bin, and its allowed initial contacts.

A part lies on the bottom or among other parts, so it starts in contact. While it is
moved without turning, its lowest point says all about the bottom, and how far it has
shifted sideways all about its neighbours: it leaves the place that they leave it
upwards without touching them. So these contacts need no engine, and the engine checks
all others, the walls among them, from the first millimetre with the full margin.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.collision.bodies import BOTTOM, HEAP, SHELL
from reachmap.core.collision.held_part import HeldPart
from reachmap.core.planning.approach import StraightApproach
from reachmap.geometry import axis_vector, inverse_transform
from reachmap.maps.parts import ABOVE_RIM_M, StageStatus
from reachmap.maps.records import NO_PAIR

if TYPE_CHECKING:
    from reachmap.core.scene import Scene

# Where a lift that is to clear the rim is blocked or out of reach, it ends lower [m],
# at the first of these that is free.
_LOWER_M = (0.0075, 0.005, 0.0025)
# A direction flatter than this never clears the rim.
_LEAST_RISE = math.cos(math.radians(75.0))
_ROUNDING_M = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lift:
    """Outcome of the lift from one configuration.

    Attributes
    ----------
    status : StageStatus
    blocking_pair : str
        The two bodies in the way, "" where there are none.
    way : array, shape (n, dof)
        From the grasp to the end of the lift, verified; no rows without one.
    above_rim_m : float
        Height of the part's lowest point above the rim at the end [m]; NaN without one.
    """

    status: StageStatus
    blocking_pair: str
    way: FloatArray
    above_rim_m: float = math.nan


class Lifts:
    """Finds and verifies lifts of a cell's part.

    Parameters
    ----------
    lifted, carried : Scene
        With the part that may touch what it lay on, and with the part.
    part : HeldPart
    """

    def __init__(self, lifted: Scene, carried: Scene, part: HeldPart) -> None:
        self._lifted, self._carried, self._part = lifted, carried, part
        cell = lifted.loaded.cell
        self._spec, self._margin_m = cell.lift, cell.collision.safety_margin_m
        self._heap_m, self._depth_m = cell.bin.heap, cell.bin.inner[2]
        self._bottom = f"part | {BOTTOM if cell.bin.mesh is None else SHELL}"
        self._T_bin_base = inverse_transform(lifted.T_base_bin)
        self._up = cell.T_base_world()[:3, 2]
        self._axis = axis_vector(cell.robot.tcp.approach_axis)

    def of(self, q_grasp: FloatArray) -> Lift:
        """Lift the part from a grasp (dof,)."""
        T = self._lifted.kinematics.forward(q_grasp)
        direction = self._direction(T)
        lowest_m = self._lowest_m(T)
        rise = float((self._T_bin_base[:3, :3] @ direction)[2])
        contact = self._contact(lowest_m, rise)
        if contact is not None:
            return contact
        checker = self._lifted.checker
        if not checker.is_free(q_grasp):
            return self._failed(StageStatus.PART_IN_COLLISION, q_grasp, self._lifted)
        highest = _without_way(StageStatus.LIFT_OUT_OF_REACH)
        for number, distance_m in enumerate(self.distances_m(lowest_m, rise)):
            lift = self._way(T, q_grasp, direction, distance_m)
            if lift.status == StageStatus.PATH_FOUND:
                above_m = lowest_m + distance_m * rise - self._depth_m
                return dataclasses.replace(lift, above_rim_m=above_m)
            highest = highest if number else lift
        return highest

    def distances_m(self, lowest_m: float, rise: float) -> tuple[float, ...]:
        """Lengths that a lift may have [m], longest first; none clears the rim.

        Parameters
        ----------
        lowest_m : float
            Height of the part's lowest point above the bottom [m].
        rise : float
            How much of the lift is along the bin's z.
        """
        if not isinstance(self._spec.height, str):
            return (self._spec.height,)
        if rise < _LEAST_RISE:
            return ()
        # Nearer to the rim than the safety margin no lift may end.
        lower_m = (above_m for above_m in _LOWER_M if above_m > self._margin_m)
        missing_m = self._depth_m - lowest_m
        lengths = (max(0.0, (missing_m + a) / rise) for a in (ABOVE_RIM_M, *lower_m))
        return tuple(dict.fromkeys(lengths))

    def _direction(self, T_base_tcp: FloatArray) -> FloatArray:
        if self._spec.direction == "vertical":
            return self._up
        if self._spec.direction == "bin":
            return self._lifted.T_base_bin[:3, 2]
        return np.asarray(-(T_base_tcp[:3, :3] @ self._axis))

    def _lowest_m(self, T_base_tcp: FloatArray) -> float:
        T_bin_tcp = self._T_bin_base @ T_base_tcp
        return float((self._part.points @ T_bin_tcp[2, :3]).min() + T_bin_tcp[2, 3])

    def _contact(self, lowest_m: float, rise: float) -> Lift | None:
        """Forbidden contact of the part with bottom, walls or heap, or None."""
        spec = self._spec
        bottom, heap = self._bottom, f"part | {HEAP}"
        if lowest_m < -spec.contact_allowance_m - _ROUNDING_M:
            return _without_way(StageStatus.PART_IN_COLLISION, bottom)
        # A part that floats above the bottom from the first must not come nearer.
        left_m = lowest_m + spec.contact_distance_m * rise
        if lowest_m < self._margin_m and left_m < self._margin_m - _ROUNDING_M:
            return _without_way(StageStatus.LIFT_BLOCKED, bottom)
        within_m = self._heap_m - lowest_m
        if within_m > 0 and self._heap_m > 0:
            aside = math.sqrt(max(0.0, 1.0 - rise * rise))
            if rise <= 0 or within_m * aside / rise > spec.contact_allowance_m:
                return _without_way(StageStatus.LIFT_BLOCKED, heap)
        return None

    def _way(
        self,
        T: FloatArray,
        q_grasp: FloatArray,
        direction: FloatArray,
        distance_m: float,
    ) -> Lift:
        scene = self._lifted
        straight = StraightApproach(
            scene.kinematics, scene.motions, -(T[:3, :3].T @ direction), distance_m
        )
        way = straight.of(T, q_grasp)
        if way is None:
            return _without_way(StageStatus.LIFT_OUT_OF_REACH)
        verified = straight.free_and_straight(way)
        if verified is None:
            pair = straight.blocking_pair(way)
            name = scene.checker.body_pairs[pair] if pair != NO_PAIR else ""
            return _without_way(StageStatus.LIFT_BLOCKED, name)
        if not self._carried.checker.is_free(verified[0]):
            return self._failed(StageStatus.LIFT_BLOCKED, verified[0], self._carried)
        return Lift(status=StageStatus.PATH_FOUND, blocking_pair="", way=verified[::-1])

    def _failed(self, status: StageStatus, q: FloatArray, scene: Scene) -> Lift:
        pair = scene.checker.blocking_pair(q)
        return _without_way(
            status, scene.checker.body_pairs[pair] if pair != NO_PAIR else ""
        )


def _without_way(status: StageStatus, pair: str = "") -> Lift:
    return Lift(status=status, blocking_pair=pair, way=np.zeros((0, 0)))
