"""What is measured of an attempt that found a path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.timing import (
    execution_time_s,
    path_length_rad,
    polyline_length_m,
    straight_way_time_s,
)

if TYPE_CHECKING:
    from reachmap.core.planning import PlanResult
    from reachmap.core.scene import Scene

MEASURED = (
    "path_length",
    "path_length_planned",
    "tcp_path_length",
    "planning_time",
    "planning_cpu_time",
    "simplification_time",
    "execution_time",
)
"""One number per attempt, NaN without a path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionNumbers:
    """What a path takes, whoever planned it.

    Attributes
    ----------
    path_length_rad, tcp_length_m : float
        Of the planned path and the straight approach, in the joints and of the TCP.
    planned_length_rad : float
        Of the planned path alone.
    execution_time_s : float
        Of the planned path, the approach, and the retreat, which is the approach
        backwards and takes as long.
    """

    path_length_rad: float
    planned_length_rad: float
    tcp_length_m: float
    execution_time_s: float


def motion_numbers(scene: Scene, path: FloatArray, way: FloatArray) -> MotionNumbers:
    """Lengths of a planned path and the approach that follows it, and their time.

    Parameters
    ----------
    scene : Scene
    path : array, shape (m, dof)
        Ends where ``way`` begins.
    way : array, shape (n, dof)
        Straight approach to the grasp.
    """
    limits = (scene.robot.velocity_rad_s, scene.robot.acceleration_rad_s2)
    whole = np.vstack([path, way[1:]])
    return MotionNumbers(
        path_length_rad=path_length_rad(whole),
        planned_length_rad=path_length_rad(path),
        tcp_length_m=polyline_length_m(scene.tcp_path_points(whole)),
        execution_time_s=execution_time_s(path, *limits)
        + 2 * straight_way_time_s(way, *limits),
    )


def measured_of(plan: PlanResult, motion: MotionNumbers) -> list[float]:
    """Numbers of one successful attempt, in the order of ``MEASURED``."""
    return [
        motion.path_length_rad,
        motion.planned_length_rad,
        motion.tcp_length_m,
        plan.planning_time_s,
        plan.planning_cpu_time_s,
        plan.simplification_time_s,
        motion.execution_time_s,
    ]
