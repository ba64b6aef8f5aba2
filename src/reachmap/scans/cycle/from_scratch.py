"""A cycle planned from scratch, without a map."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.kinematics.windings import Windings
from reachmap.core.planning.lift import Lifts
from reachmap.maps.parts import StageStatus
from reachmap.sampling.frames import approach_distance_m
from reachmap.scans.cycle.lifts import NEAREST_TO_SUCCESS
from reachmap.scans.cycle.places import ways_to_place
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.ik_survey import survey_frames
from reachmap.scans.measured import attempt_seed

# Goals whose lifts are transferred before a grasp is given up.
_MOST_TRIES = 8


class FreshCycle(NamedTuple):
    """Outcome of a cycle planned from scratch.

    Attributes
    ----------
    status : StageStatus
        PATH_FOUND, or why not.
    seconds : float
        Time of the whole cycle, waits included [s]; NaN unless there is one.
    """

    status: StageStatus
    seconds: float = float("nan")


class FreshCycles:
    """Plans cycles one by one with the cell's planner, without a roadmap.

    Parameters
    ----------
    scenes : CycleScenes
    """

    def __init__(self, scenes: CycleScenes) -> None:
        self._scenes = scenes
        self._lifts = Lifts(scenes.lifted, scenes.carried, scenes.part)
        self._windings = Windings(scenes.empty.robot)
        drop_offs = scenes.empty.loaded.cell.drop_offs
        self._goes_somewhere = bool(drop_offs)
        self._places = [
            way for spec in drop_offs for way in ways_to_place(scenes, spec)[0]
        ]
        self._before = np.array([way[0] for way, _ in self._places])
        self._home = scenes.home()

    def plan(self, T_base_tcp: FloatArray, seed: int) -> FreshCycle:
        """Plan the cycle over one grasp.

        Parameters
        ----------
        T_base_tcp : array, shape (m, 4, 4)
            Tool poses that will do, the preferred one first.
        seed : int

        """
        scene = self._scenes.empty
        survey = survey_frames(
            scene, T_base_tcp, approach_distance_m(scene.loaded.cell)
        )
        if not len(survey.frame):
            return FreshCycle(StageStatus.NOT_ATTEMPTED)
        lifts = [self._lifts.of(q) for q in survey.grasps]
        good = [k for k, lift in enumerate(lifts) if len(lift.way)]
        if not good:
            states = (lift.status for lift in lifts)
            return FreshCycle(min(states, key=NEAREST_TO_SUCCESS.index))
        verdict = StageStatus.NO_PATH_FOUND
        for number in range(_MOST_TRIES):
            if not good:
                break
            rows = np.array(good)
            goals, row = survey.goals_near(
                rows, scene.scan_configuration, self._windings
            )
            way_in = scene.planner.plan(
                scene.scan_configuration, goals, attempt_seed(seed, number, 0)
            )
            if way_in.path is None:
                break
            goal = int(row[way_in.goal])
            way = survey.way_from(goal, way_in.path[-1])
            lift = lifts[goal].way + (way[-1] - lifts[goal].way[0])
            verdict, after = self._carry(lift[-1], attempt_seed(seed, number, 1))
            if verdict == StageStatus.PATH_FOUND:
                law = scene.time_law
                before_s = law.path_time_s(way_in.path) + law.way_time_s(way)
                lift_s = self._scenes.lifted.time_law.way_time_s(lift)
                return FreshCycle(verdict, before_s + lift_s + self._rest_s(after))
            good.remove(goal)
        return FreshCycle(verdict)

    def _rest_s(self, after: tuple[float, ...]) -> float:
        """Time after the lift: motion, and waits as the cell has them."""
        spec = self._scenes.empty.loaded.cell.cycle
        image_s = spec.image_s
        if spec.capture_overlaps_place and after:
            image_s = max(0.0, image_s - sum(after[1:]) - spec.release_s)
        return sum(after) + spec.waits_s + image_s

    def _carry(self, q: FloatArray, seed: int) -> tuple[StageStatus, tuple[float, ...]]:
        """Plan from the end of a lift to a drop-off, and back; with stages' times."""
        if not self._goes_somewhere:
            return StageStatus.PATH_FOUND, ()
        if not len(self._before):
            return StageStatus.DROP_OFF_UNREACHABLE, ()
        carried, scene = self._scenes.carried, self._scenes.empty
        transfer = carried.planner.plan(q, self._before, seed)
        if transfer.path is None:
            return StageStatus.TRANSFER_NOT_FOUND, ()
        place, retreat = self._places[transfer.goal]
        back = self._back(retreat[-1], seed)
        if back is None:
            return StageStatus.RETURN_NOT_FOUND, ()
        return StageStatus.PATH_FOUND, (
            carried.time_law.path_time_s(transfer.path),
            carried.time_law.way_time_s(place),
            scene.time_law.way_time_s(retreat),
            scene.time_law.path_time_s(back),
        )

    def _back(self, q: FloatArray, seed: int) -> FloatArray | None:
        """Path to the scan configuration, by way of where the arm is to return to."""
        scene, path = self._scenes.empty, q[None]
        stops = [scene.scan_configuration]
        if self._home is not None:
            stops.insert(0, self._home)
        for stop in stops:
            plan = scene.planner.plan(path[-1], stop[None], seed)
            if plan.path is None:
                return None
            path = np.vstack([path, plan.path[1:]])
        return path
