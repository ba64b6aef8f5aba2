"""Measurements of an attempt that found a path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.planning.timing import path_length_rad, polyline_length_m

if TYPE_CHECKING:
    from reachmap.core.planning.planner import PlanResult
    from reachmap.core.scene import Scene

MEASURED = (
    "path_length",
    "path_length_planned",
    "tcp_path_length",
    "planning_time",
    "planning_cpu_time",
    "simplification_time",
    "execution_time",
    "approach_time",
    "retreat_time",
)
"""One number per attempt, NaN without a path."""

SECONDS_PER_CHECK = 1e-5
"""Nominal cost of a state check [s]: planning takes 8.5 µs of CPU time for one on the
shipped UR5 cell, all else included. A constant, so that the planning effort of a map is
the same in every run."""


class Meter:
    """Measures attempts; a path that several of them take is measured once.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._known: dict[bytes, _MotionNumbers] = {}
        self._approaches: dict[bytes, float] = {}

    def measured(self, plan: PlanResult, way: FloatArray) -> list[float]:
        """Numbers of one successful attempt, in the order of ``MEASURED``.

        Parameters
        ----------
        plan : PlanResult
            With a path.
        way : array, shape (n, dof)
            Straight approach from the end of the path to the grasp.
        """
        assert plan.path is not None
        key = plan.path.tobytes() + way.tobytes()
        if key not in self._known:
            self._known[key] = self._numbers(plan.path, way)
        motion = self._known[key]
        return [
            motion.path_length_rad,
            motion.planned_length_rad,
            motion.tcp_length_m,
            plan.planning_time_s,
            plan.planning_cpu_time_s,
            plan.simplification_time_s,
            motion.execution_time_s,
            motion.approach_time_s,
            # The way back, with the same limits in both directions.
            motion.approach_time_s,
        ]

    def _numbers(self, path: FloatArray, way: FloatArray) -> _MotionNumbers:
        whole = np.vstack([path, way[1:]])
        approach_s = self._approach_time_s(way)
        return _MotionNumbers(
            path_length_rad=path_length_rad(whole),
            planned_length_rad=path_length_rad(path),
            tcp_length_m=polyline_length_m(self._scene.tcp_path_points(whole)),
            execution_time_s=self._scene.time_law.path_time_s(path) + approach_s,
            approach_time_s=approach_s,
        )

    def _approach_time_s(self, way: FloatArray) -> float:
        """Time of an approach, which many paths share."""
        key = way.tobytes()
        if key not in self._approaches:
            self._approaches[key] = self._scene.time_law.way_time_s(way)
        return self._approaches[key]


@dataclass(frozen=True, slots=True, kw_only=True)
class _MotionNumbers:
    """What a path takes, whoever planned it.

    Attributes
    ----------
    path_length_rad, tcp_length_m : float
        Of the planned path and the straight approach, in the joints and of the TCP.
    planned_length_rad : float
        Of the planned path alone.
    execution_time_s : float
        Of the planned path and the approach, at rest between them.
    approach_time_s : float
        Of the approach alone.
    """

    path_length_rad: float
    planned_length_rad: float
    tcp_length_m: float
    execution_time_s: float
    approach_time_s: float


def attempt_seed(seed: int, *key: int) -> int:
    """Seed of one attempt.

    Parameters
    ----------
    seed : int
        Of the scan.
    *key : int
        What tells the attempt from all others: frame, repeat.

    Returns
    -------
    int
        From 0 to 2³² − 1.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=key)
    return int(sequence.generate_state(1)[0])
