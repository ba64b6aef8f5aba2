"""Bin scan: every test grasp planned ``repeats`` times, each attempt kept."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.cell.model.cell import Cell
from reachmap.core.kinematics.windings import Windings
from reachmap.core.planning.planner import PlanResult
from reachmap.core.scene import Scene
from reachmap.maps import BinMap, PathStore, RunInfo, Stamp, Status, write_bin_map
from reachmap.maps.parts import ApproachTimes, Effort
from reachmap.maps.records import freeze
from reachmap.runtime.job import Job, Kind, Stages, Work, blocks
from reachmap.runtime.progress import Progress
from reachmap.sampling.frames import FrameGrid, bin_test_frames
from reachmap.scans.document import journal_settings, provenance_from_document
from reachmap.scans.ik_survey import Survey, SurveyContext, survey_in_stages
from reachmap.scans.measured import (
    MEASURED,
    SECONDS_PER_CHECK,
    Meter,
    attempt_seed,
)
from reachmap.scans.workspace_roadmap import connect_survey

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspResults:
    """What became of test grasps and their attempts.

    Attributes
    ----------
    status, n_ik, n_ik_free, connected : uint8 array, shape (grasps,)
    blocking_pair : int array, shape (grasps,)
    path_found, hit_time_limit : uint8 array, shape (grasps, repeats)
    checks : int array, shape (grasps, repeats)
        State checks of the search.
    measured : array, shape (grasps, repeats, 9)
        In the order of :data:`~reachmap.scans.measured.MEASURED`.
    goal_configuration : array, shape (grasps, dof)
        Where the shortest path ends [rad].
    configuration : array, shape (points, dof)
        Way-points of all paths, one path after another.
    row_size, planned_size : int array, shape (paths,)
    place : int array, shape (paths, 2)
        Grasp and repeat of each path.
    """

    status: CodeArray
    n_ik: CodeArray
    n_ik_free: CodeArray
    connected: CodeArray
    blocking_pair: IntArray
    path_found: CodeArray
    hit_time_limit: CodeArray
    checks: IntArray
    measured: FloatArray
    goal_configuration: FloatArray
    configuration: FloatArray
    row_size: IntArray
    planned_size: IntArray
    place: IntArray

    def __post_init__(self) -> None:
        freeze(self)

    @classmethod
    def blank(cls, grasps: int, repeats: int, dof: int, status: Status) -> GraspResults:
        """Results of grasps that nothing is known of."""
        return cls(
            status=np.full(grasps, status, np.uint8),
            n_ik=np.zeros(grasps, np.uint8),
            n_ik_free=np.zeros(grasps, np.uint8),
            connected=np.zeros(grasps, np.uint8),
            blocking_pair=np.full(grasps, -1, np.int64),
            path_found=np.zeros((grasps, repeats), np.uint8),
            hit_time_limit=np.zeros((grasps, repeats), np.uint8),
            checks=np.zeros((grasps, repeats), np.int64),
            measured=np.full((grasps, repeats, len(MEASURED)), np.nan),
            goal_configuration=np.full((grasps, dof), np.nan),
            configuration=np.zeros((0, dof)),
            row_size=np.zeros(0, np.int64),
            planned_size=np.zeros(0, np.int64),
            place=np.zeros((0, 2), np.int64),
        )

    @classmethod
    def join(cls, parts: Sequence[GraspResults]) -> GraspResults:
        """Results of consecutive grasps, put together."""
        joined = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in cls.__slots__
            if name != "place"
        }
        begin = np.cumsum([0, *(len(part.status) for part in parts[:-1])])
        place = [
            part.place + np.array([first, 0])
            for part, first in zip(parts, begin, strict=True)
        ]
        return cls(**joined, place=np.concatenate(place))


def assemble_bin_map(
    document: Mapping[str, Any], results: GraspResults, *, run: RunInfo
) -> BinMap:
    """Make the map of a scan.

    Parameters
    ----------
    document : mapping
        See :func:`reachmap.scans.document.scan_document`.
    results : GraspResults
        Of all test grasps.
    run : RunInfo
    """
    cell = Cell.model_validate_json(document["provenance"]["cell_resolved_json"])
    T_base_bin = cell.T_base_bin()
    grid = bin_test_frames(cell, T_base_bin)
    shape = grid.frames.shape

    def shaped(values: Any) -> Any:
        return values.reshape(*shape, *values.shape[1:])

    found = (results.status == Status.PATH_FOUND).reshape(shape)
    known = (results.status != Status.NOT_ATTEMPTED).reshape(shape)
    with np.errstate(invalid="ignore"):
        percent = 100.0 * found.sum(-1) / known.sum(-1)
    quaternion = np.broadcast_to(grid.frames.quaternion_wxyz, (*shape, 4))
    measured = {
        name: shaped(results.measured[..., k]) for k, name in enumerate(MEASURED)
    }
    times = ApproachTimes(
        approach=measured.pop("approach_time"), retreat=measured.pop("retreat_time")
    )
    return BinMap(
        T_world_base=cell.robot.base_pose.matrix(),
        layer=grid.layer,
        y=grid.y,
        x=grid.x,
        bin_pose=T_base_bin,
        bin_inner=np.array(cell.bin.inner),
        position=grid.frames.points,
        quaternion_wxyz=quaternion.copy(),
        approach_axis=cell.robot.tcp.approach_axis,
        approach_distance=cell.bin_scan.approach_distance_m,
        status=shaped(results.status),
        blocking_pair=shaped(results.blocking_pair),
        n_ik=shaped(results.n_ik),
        n_ik_free=shaped(results.n_ik_free),
        connected=shaped(results.connected),
        path_found=shaped(results.path_found),
        hit_time_limit=shaped(results.hit_time_limit),
        **measured,
        times=times,
        effort=Effort(
            checks=shaped(results.checks), seconds_per_check=SECONDS_PER_CHECK
        ),
        goal_configuration=shaped(results.goal_configuration),
        path_reachability=percent,
        scan_configuration=np.array(document["scan_configuration"], float),
        joint_names=tuple(document["joint_names"]),
        body_pairs=tuple(document["body_pairs"]),
        paths=_path_store(results, shape),
        stamp=Stamp(**document["stamp"]),
        provenance=provenance_from_document(document),
        run=run,
    )


def _path_store(results: GraspResults, shape: tuple[int, ...]) -> PathStore:
    where = np.stack(np.unravel_index(results.place[:, 0], shape), axis=1)
    return PathStore(
        configuration=results.configuration,
        row_size=results.row_size,
        planned_size=results.planned_size,
        index=np.concatenate([where, results.place[:, 1:]], axis=1).astype(np.int64),
    )


GRASPS_PER_UNIT = 45


@dataclass(frozen=True, slots=True, kw_only=True)
class BinContext:
    """What a worker needs: the cell, and what is known of every test grasp."""

    loaded: LoadedCell
    survey: Survey
    connected: BoolArray


def bin_work(scene: Scene, document: Mapping[str, Any]) -> Work:
    """Work of a bin scan.

    Parameters
    ----------
    scene : Scene
        With the bin.
    document : mapping
        See :func:`reachmap.scans.document.scan_document`.
    """
    grasps = grasp_grid(scene).size
    return Work(
        kind=KIND,
        units=blocks(grasps, GRASPS_PER_UNIT),
        job=partial(planning_job, scene),
        settings=journal_settings(document),
        document={**document, "grasps": grasps},
        frames=grasps,
    )


def grasp_grid(scene: Scene) -> FrameGrid:
    """Test grasps of a scan, in robot_base."""
    return bin_test_frames(scene.loaded.cell, scene.T_base_bin).frames


def planning_job(scene: Scene, stages: Stages) -> Job:
    """Survey the test grasps and connect them; what is left is to plan to each."""
    loaded, cell = scene.loaded, scene.loaded.cell
    context = SurveyContext(
        loaded=loaded,
        with_bin=True,
        grids=(grasp_grid(scene),),
        approach_m=cell.bin_scan.approach_distance_m,
    )
    survey = survey_in_stages(context, stages)

    def connect(progress: Progress) -> BoolArray:
        connection = connect_survey(scene, survey, seed=cell.seed, progress=progress)
        connected = np.zeros(len(survey.status), bool)
        connected[connection.roadmap.frames_reached()] = True
        return connected

    connected = stages.once("connect", connect)
    whole = BinContext(loaded=loaded, survey=survey, connected=connected)
    return Job(function=plan_unit, prepare=prepare, context=whole, tally=tally)


def prepare(context: BinContext) -> tuple[BinContext, Scene]:
    """Build the scene, once per worker."""
    return context, Scene.shared(context.loaded, with_bin=True)


def plan_unit(state: tuple[BinContext, Scene], grasps: range) -> dict[str, Any]:
    """Plan all attempts at the test grasps of one unit."""
    context, scene = state
    parts = plan_grasps(scene, context.survey, grasps, context.connected[grasps])
    return dataclasses.asdict(GraspResults.join(parts))


def plan_grasps(
    scene: Scene, survey: Survey, grasps: Sequence[int], connected: BoolArray
) -> list[GraspResults]:
    """Make all attempts at some test grasps.

    They take turns: a machine that is slow for a moment is then slow for one attempt
    at each of many, and not for every attempt at one, which would look dear.

    Parameters
    ----------
    scene : Scene
    survey : Survey
    grasps : sequence of int
        Their numbers in the survey, which with the cell's seed make their own.
    connected : bool array, shape (len(grasps),)
        Whether the roadmap proves a path.
    """
    windings, start = Windings(scene.robot), scene.scan_configuration
    goals = [
        survey.goals_near(survey.goals_of(grasp), start, windings) for grasp in grasps
    ]
    plans: list[list[tuple[PlanResult, int]]] = [[] for _ in grasps]
    cell = scene.loaded.cell
    for repeat in range(cell.bin_scan.repeats):
        for row, grasp in enumerate(grasps):
            Q, goal = goals[row]
            if len(Q):
                seed = attempt_seed(cell.seed, grasp, repeat)
                plan = scene.planner.plan(start, Q, seed)
                plans[row].append((plan, int(goal[plan.goal])))
    return [
        _results(scene, survey, grasp, plans[row], connected=bool(connected[row]))
        for row, grasp in enumerate(grasps)
    ]


def _results(
    scene: Scene,
    survey: Survey,
    grasp: int,
    plans: Sequence[tuple[PlanResult, int]],
    *,
    connected: bool,
) -> GraspResults:
    repeats = scene.loaded.cell.bin_scan.repeats
    measured = np.full((1, repeats, len(MEASURED)), np.nan)
    out_of_time = np.zeros((1, repeats), np.uint8)
    checks = np.zeros((1, repeats), np.int64)
    paths: list[FloatArray] = []
    planned: list[int] = []
    place: list[tuple[int, int]] = []
    meter = Meter(scene)
    for repeat, (plan, goal) in enumerate(plans):
        out_of_time[0, repeat] = plan.hit_time_limit
        checks[0, repeat] = plan.checks
        if plan.path is None:
            continue
        way = survey.way_from(goal, plan.path[-1])
        paths.append(np.vstack([plan.path, way[1:]]))
        planned.append(len(plan.path))
        place.append((0, repeat))
        measured[0, repeat] = meter.measured(plan, way)
    return GraspResults(
        status=np.array([_status(survey, grasp, plans, connected=connected)], np.uint8),
        n_ik=survey.n_ik[[grasp]],
        n_ik_free=survey.n_ik_free[[grasp]],
        connected=np.array([connected], np.uint8),
        blocking_pair=survey.blocking_pair[[grasp]],
        path_found=np.isfinite(measured[..., 0]).astype(np.uint8),
        hit_time_limit=out_of_time,
        checks=checks,
        measured=measured,
        goal_configuration=_shortest_goal(paths, measured, scene.robot.dof),
        configuration=np.vstack([np.zeros((0, scene.robot.dof)), *paths]),
        row_size=np.array([len(path) for path in paths], np.int64),
        planned_size=np.array(planned, np.int64),
        place=np.array(place, np.int64).reshape(-1, 2),
    )


def _status(
    survey: Survey,
    grasp: int,
    plans: Sequence[tuple[PlanResult, int]],
    *,
    connected: bool,
) -> int:
    if not plans:
        return int(survey.status[grasp])
    # A path that the roadmap proves counts, even if every attempt missed it.
    found = connected or any(plan.path is not None for plan, _ in plans)
    return Status.PATH_FOUND if found else Status.NO_PATH_FOUND


def _shortest_goal(
    paths: Sequence[FloatArray], measured: FloatArray, dof: int
) -> FloatArray:
    if not paths:
        return np.full((1, dof), np.nan)
    lengths = measured[0, :, 0]
    return np.array(paths[int(np.argmin(lengths[np.isfinite(lengths)]))][-1:])


def tally(payload: Mapping[str, Any]) -> tuple[int, int]:
    """Path-reachable grasps, and all grasps, of a unit."""
    status = payload["status"]
    return int((status == Status.PATH_FOUND).sum()), len(status)


def blank(document: Mapping[str, Any], unit: int, status: Status) -> dict[str, Any]:
    """Payload of a unit without results."""
    spec = Cell.model_validate_json(
        document["provenance"]["cell_resolved_json"]
    ).bin_scan
    left = document["grasps"] - unit * GRASPS_PER_UNIT
    empty = GraspResults.blank(
        min(GRASPS_PER_UNIT, left), spec.repeats, len(document["joint_names"]), status
    )
    return dataclasses.asdict(empty)


def assemble(
    document: Mapping[str, Any], payloads: Sequence[Any], *, run: RunInfo
) -> BinMap:
    """Make the map from the payloads of all units."""
    results = GraspResults.join([GraspResults(**payload) for payload in payloads])
    return assemble_bin_map(document, results, run=run)


KIND = Kind(name="bin_map", blank=blank, assemble=assemble, write=write_bin_map)
