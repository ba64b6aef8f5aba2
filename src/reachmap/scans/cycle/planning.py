"""The quickest whole cycle over a test grasp: approach, lift, transfer and return."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.core.kinematics.windings import TURN_RAD, Windings
from reachmap.core.planning.timing import path_length_rad
from reachmap.maps.parts import StageStatus
from reachmap.maps.records import NO_PAIR
from reachmap.scans.bin_roadmap import BinRoadmap
from reachmap.scans.cycle.connecting import quickest
from reachmap.scans.cycle.lifts import LiftSurvey
from reachmap.scans.cycle.places import Places
from reachmap.scans.cycle.scenes import (
    LIFT,
    PLACE,
    RETURN,
    TRANSFER,
    CycleScenes,
    stages_of,
)
from reachmap.scans.cycle.transfers import Hub, Transfer, Transfers
from reachmap.scans.ik_survey import TURNS_TRIED, Survey
from reachmap.scans.measured import attempt_seed
from reachmap.scans.rolls import places_among
from reachmap.scans.routes import WayIn

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

# Branches of the kinematics that are compared to the end; the rest is bounded away.
_COMPARED = 3
# Tells the draws of this stage from those of others.
_SEED = 1 << 20
NO_ROW = -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CycleKnowledge:
    """Knowledge shared by all test grasps.

    Attributes
    ----------
    survey : Survey
        Goals of the cycles: those of the ways in, and others behind them.
    lifts : LiftSurvey
    places : Places
    hubs : tuple of Hub
    """

    survey: Survey
    lifts: LiftSurvey
    places: Places
    hubs: tuple[Hub, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CyclePlan:
    """Outcome of the cycle over one test grasp.

    Attributes
    ----------
    status : uint8 array, shape (stages,)
    blocking_pair : int array, shape (stages,)
    time_s, length_rad : array, shape (stages,)
        NaN unless the stage has a path.
    drop_off : int
        -1 for none.
    way_in : WayIn or None
        The path to the grasp that the cycle takes.
    paths : tuple of (array, int)
        Path of each stage and its planned waypoints; none unless all have one.
    cycle_time_s : float
        Waits included; NaN unless every stage has a path.
    above_rim_m : float
        Of the part at the end of the lift; NaN unless every stage has a path.
    roll_rad : float
        Of the tool against the test grasp; NaN unless every stage has a path.
    """

    status: CodeArray
    blocking_pair: IntArray
    time_s: FloatArray
    length_rad: FloatArray
    drop_off: int
    way_in: WayIn | None
    paths: tuple[tuple[FloatArray, int], ...]
    cycle_time_s: float
    above_rim_m: float = float("nan")
    roll_rad: float = float("nan")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Candidate:
    """A whole cycle over one goal."""

    way_in: WayIn
    in_s: float
    lift: FloatArray
    lift_s: float
    transfer: Transfer | None

    @property
    def motion_s(self) -> float:
        """Time of all motion."""
        after = 0.0 if self.transfer is None else self.transfer.total_s
        return self.in_s + self.lift_s + after


class CyclePlanner:
    """Plans cycles over test grasps.

    Parameters
    ----------
    scenes : CycleScenes
    known : BinRoadmap
    shared : CycleKnowledge
    """

    def __init__(
        self, scenes: CycleScenes, known: BinRoadmap, shared: CycleKnowledge
    ) -> None:
        self._scenes, self._known = scenes, known
        self._survey, self._lifts = shared.survey, shared.lifts
        # Goals of the ways in among those of the cycles, and the other way round.
        self._place = places_among(known.survey.frame, shared.survey.frame)
        self._row = np.full(len(shared.survey.frame), NO_ROW, np.int64)
        self._row[self._place] = np.arange(len(self._place))
        self._places = shared.places
        self._transfers = Transfers(scenes, shared.places, shared.hubs)
        self._windings = Windings(scenes.empty.robot)
        self._cell, self._law = scenes.empty.loaded.cell, scenes.empty.time_law
        self._known_s: dict[bytes, float] = {}
        self.stages = len(stages_of(scenes.empty.loaded))
        self._goes_somewhere = self.stages > 1

    @classmethod
    def of(
        cls, loaded: LoadedCell, known: BinRoadmap, shared: CycleKnowledge | None
    ) -> CyclePlanner | None:
        """Planner of a cell; None where it has no part."""
        scenes = CycleScenes.of(loaded)
        if scenes is None or shared is None:
            return None
        return cls(scenes, known, shared)

    def plan(self, grasp: int, found: Sequence[WayIn]) -> CyclePlan:
        """Plan the cycle over one test grasp.

        Parameters
        ----------
        grasp : int
        found : sequence of WayIn
            Paths to it that are known; none where it is not reached.
        """
        if not found:
            return self._failure()
        goals = self._survey.goals_of(grasp)
        good = goals[self._lifts.status[goals] == StageStatus.PATH_FOUND]
        if not len(good):
            return self._failure(LIFT, *self._lifts.verdict(goals))
        if self._goes_somewhere and not len(self._places.drop_off):
            return self._without_place(good)
        ways = [way._replace(goal=int(self._place[way.goal])) for way in found]
        best = self._best(grasp, good, ways)
        if best is None:
            return self._failure(
                TRANSFER, StageStatus.TRANSFER_NOT_FOUND, NO_PAIR, self._lift_of(good)
            )
        return self._success(grasp, best)

    def _best(
        self, grasp: int, goals: IntArray, found: Sequence[WayIn]
    ) -> _Candidate | None:
        """The quickest cycle over any of some goals."""
        bounds = [(self._least_s(int(goal)), int(goal)) for goal in goals]
        best: _Candidate | None = None
        compared = 0
        for bound_s, goal in sorted(bounds):
            if best is not None and (bound_s >= best.motion_s or compared == _COMPARED):
                break
            made = self._over(grasp, goal, found)
            compared += made is not None
            if made is not None and (best is None or made.motion_s < best.motion_s):
                best = made
        return best

    def _least_s(self, goal: int) -> float:
        """Lower bound of the time of a cycle over a goal."""
        scenes, way = self._scenes, self._survey.way_of(goal)
        lift = self._lifts.ways[goal]
        start = scenes.empty.scan_configuration
        ends = scenes.least_times_s(start, way[:1])[0]
        after = self._transfers.least_s(lift[-1]) if self._goes_somewhere else 0.0
        return float(ends) + after

    def _over(self, grasp: int, goal: int, found: Sequence[WayIn]) -> _Candidate | None:
        """The cycle over one goal: its quickest way in, and what follows."""
        timed = [
            (self._in_s(way), k)
            for k, way in enumerate(found)
            if way.goal == goal and self._lift_at(goal, way.path[-1]) is not None
        ]
        way_in = found[min(timed)[1]] if timed else self._way_in(grasp, goal)
        if way_in is None:
            return None
        lift = self._lift_at(goal, way_in.path[-1])
        assert lift is not None
        transfer = None
        if self._goes_somewhere:
            seed = attempt_seed(self._cell.seed, _SEED, grasp, goal)
            transfer = self._transfers.of(goal, lift[-1], seed)
            if transfer is None:
                return None
        return _Candidate(
            way_in=way_in,
            in_s=self._in_s(way_in),
            lift=lift,
            lift_s=self._way_s(lift),
            transfer=transfer,
        )

    def _in_s(self, way: WayIn) -> float:
        begin = max(way.planned - 1, 0)
        return self._law.path_time_s(way.path[: way.planned]) + (
            self._way_s(way.path[begin:])
        )

    def _way_s(self, way: FloatArray) -> float:
        """Time of a straight way, which many paths share."""
        key = way.tobytes()
        if key not in self._known_s:
            self._known_s[key] = self._law.way_time_s(way)
        return self._known_s[key]

    def _lift_at(self, goal: int, q: FloatArray) -> FloatArray | None:
        """Lift of a goal from its grasp at whatever turns; None outside the limits."""
        lift, robot = self._lifts.ways[goal], self._scenes.empty.robot
        turned = lift + TURN_RAD * np.round((q - lift[0]) / TURN_RAD)
        inside = (turned >= robot.lower_rad) & (turned <= robot.upper_rad)
        return turned if inside.all() else None

    def _way_in(self, grasp: int, goal: int) -> WayIn | None:
        """A way to a goal that no known path ends at."""
        scene, survey, routes = self._scenes.empty, self._survey, self._known.routes
        spec, start = self._cell.roadmap, scene.scan_configuration
        way = survey.way_of(goal)
        whole = np.vstack([way, self._lifts.ways[goal]])
        _, turns = self._windings.spread(
            way[:1], start, whole.min(axis=0)[None], whole.max(axis=0)[None],
            each=TURNS_TRIED,
        )  # fmt: skip
        goals = way[0] + TURN_RAD * turns
        network, row = routes.network, int(self._row[goal])
        ways = [] if network is None else network.ways_to(goals, scene.motions, spec)
        seed = attempt_seed(self._cell.seed, _SEED, grasp, goal, 1)
        if not ways and row == NO_ROW:
            plan = scene.planner.plan(start, goals, seed)
            ways = [] if plan.path is None else [plan.path]
        elif not ways and np.isfinite(routes.length_rad[row]):
            own = routes.paths.path_to(int(routes.node[row]))
            if np.abs(goals - own[-1]).max(axis=1).min() < 1e-9:
                ways = [own]
        path = quickest(scene, ways, seed)
        if path is None:
            return None
        return WayIn.of(path, survey.way_from(goal, path[-1]), -1, goal)

    def _success(self, grasp: int, best: _Candidate) -> CyclePlan:
        spec, places = self._cell.cycle, self._places
        paths: list[tuple[FloatArray, int]] = [(best.lift, 1)]
        times = [best.lift_s]
        image_s, drop_off = spec.image_s, -1
        if best.transfer is not None:
            place = best.transfer.place
            drop_off = int(places.drop_off[place])
            back = places.back[place]
            paths += [
                (best.transfer.path, len(best.transfer.path)),
                (places.place[place], 1),
                (places.retreat[place], 1),
                (back, len(back)),
            ]
            times += [best.transfer.time_s, *places.time_s[place].tolist()]
            if spec.capture_overlaps_place:
                image_s = max(0.0, image_s - sum(times[PLACE:]) - spec.release_s)
        status = np.full(self.stages, StageStatus.PATH_FOUND, np.uint8)
        return CyclePlan(
            status=status,
            blocking_pair=np.full(self.stages, NO_PAIR, np.int64),
            time_s=np.array(times),
            length_rad=np.array([path_length_rad(path) for path, _ in paths]),
            drop_off=drop_off,
            way_in=best.way_in,
            paths=tuple(paths),
            cycle_time_s=best.in_s + sum(times) + spec.waits_s + image_s,
            above_rim_m=float(self._lifts.above_rim_m[best.way_in.goal]),
            roll_rad=self._survey.roll_of(grasp, best.way_in.goal),
        )

    def _lift_of(self, goals: IntArray) -> tuple[float, float]:
        """Time and length of the shortest lift of some goals."""
        lifts = [self._lifts.ways[int(goal)] for goal in goals]
        lift = min(lifts, key=path_length_rad)
        return self._way_s(lift), path_length_rad(lift)

    def _without_place(self, goals: IntArray) -> CyclePlan:
        """Failure where no drop-off is usable: the stage, and the bodies in the way."""
        places = self._places
        row = int(np.argmax(places.status))
        status = int(places.status[row])
        stage = RETURN if status == StageStatus.RETURN_NOT_FOUND else PLACE
        pair = int(places.blocking_pair[row])
        return self._failure(stage, status, pair, self._lift_of(goals))

    def _failure(
        self,
        stage: int = LIFT,
        status: int = StageStatus.NOT_ATTEMPTED,
        pair: int = NO_PAIR,
        lift: tuple[float, float] | None = None,
    ) -> CyclePlan:
        """A cycle that ends at a stage; with the time and length of its lift."""
        row = _blank_row(self.stages)
        row["status"][stage], row["blocking_pair"][stage] = status, pair
        if lift is not None:
            row["status"][LIFT] = StageStatus.PATH_FOUND
            row["time_s"][LIFT], row["length_rad"][LIFT] = lift
        return CyclePlan(
            **row, drop_off=-1, way_in=None, paths=(), cycle_time_s=float("nan")
        )


def _blank_row(stages: int) -> dict[str, Any]:
    return {
        "status": np.zeros(stages, np.uint8),
        "blocking_pair": np.full(stages, NO_PAIR, np.int64),
        "time_s": np.full(stages, np.nan),
        "length_rad": np.full(stages, np.nan),
    }
