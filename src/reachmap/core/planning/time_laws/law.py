"""The time law of a cell: how long its motions take."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.planner import TimeLawName
from reachmap.core.planning import timing
from reachmap.core.planning.time_laws import double_s
from reachmap.core.planning.time_laws.corners import (
    BlendedPath,
    blended,
    blended_time_s,
)
from reachmap.errors import SceneError

if TYPE_CHECKING:
    from reachmap.core.planning.motion import MotionChecker
    from reachmap.core.robot.model import RobotModel

BLENDING_LAWS = ("blend", "toppra")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimeLaw:
    """Times motions by one law, at rest at their ends.

    Attributes
    ----------
    name : {"trapezoid", "jerk", "blend", "toppra"}
        trapezoid: the exact polyline, at rest at every corner. jerk: the same with
        limited jerk. blend: corners blended as far as they are verified. toppra: the
        optimum along those blends.
    robot : RobotModel
        Its limits.
    motions : MotionChecker
        Verifies blends.
    """

    name: TimeLawName
    robot: RobotModel
    motions: MotionChecker

    def __post_init__(self) -> None:
        unlimited = ~np.isfinite(self.robot.jerk_rad_s3)
        if self.name == "jerk" and unlimited.any():
            names = zip(self.robot.joint_names, unlimited, strict=True)
            raise SceneError(
                "planner.time_law: jerk needs robot.limits.jerk_rad_s3 for "
                f"{', '.join(name for name, without in names if without)}; give one "
                "number for all joints or one per joint"
            )

    def path_time_s(self, path: FloatArray) -> float:
        """Time of a planned path (n, dof), a verified polyline [s]."""
        v, a, j = self._limits()
        if self.name == "jerk":
            return double_s.polyline_time_s(path, v, a, j)
        if self.name == "trapezoid":
            return timing.execution_time_s(path, v, a)
        blends = self.blends(path)
        if self.name == "blend":
            return blended_time_s(blends, v, a)
        from reachmap.core.planning.time_laws.optimal import optimal_time_s

        return optimal_time_s(blends, v, a)

    def blends(self, path: FloatArray) -> BlendedPath:
        """Blend the corners of a planned path (n, dof) as far as that is verified."""
        v, a, _ = self._limits()
        return blended(path, self.motions, v, a)

    def way_time_s(self, way: FloatArray) -> float:
        """Time of a straight way of the tool (n, dof), a smooth curve [s]."""
        v, a, j = self._limits()
        if self.name == "jerk":
            return double_s.smooth_way_time_s(way, v, a, j)
        if self.name != "toppra":
            return timing.smooth_way_time_s(way, v, a)
        from reachmap.core.planning.time_laws.optimal import optimal_way_time_s

        return optimal_way_time_s(way, v, a)

    def _limits(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        robot = self.robot
        return robot.velocity_rad_s, robot.acceleration_rad_s2, robot.jerk_rad_s3
