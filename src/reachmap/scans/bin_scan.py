"""Bin scan: every test grasp planned ``repeats`` times, each attempt kept."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.collision.held_part import HeldPart
from reachmap.core.planning.planner import PlanResult
from reachmap.core.planning.timing import path_length_rad
from reachmap.core.scene import Scene
from reachmap.maps import BinMap, RunInfo, Status, write_bin_map
from reachmap.maps.parts import Components, Refinement
from reachmap.runtime.job import Job, Kind, Stages, Work, blocks, one_frame
from reachmap.runtime.progress import Progress
from reachmap.scans.bin_results import NO_PATH, GraspResults, assemble_bin_map
from reachmap.scans.bin_roadmap import (
    BinRoadmap,
    components_from_payload,
    connected_grasps,
    grasp_grid,
    join_components,
)
from reachmap.scans.cycle.planning import CycleKnowledge, CyclePlan, CyclePlanner
from reachmap.scans.cycle.results import CycleResults
from reachmap.scans.cycle.scenes import CycleScenes, stages_of
from reachmap.scans.cycle.stages import whole_cycles
from reachmap.scans.document import cell_of_document, journal_settings, tally
from reachmap.scans.ik_survey import Survey
from reachmap.scans.margins import MarginMeter
from reachmap.scans.measured import MEASURED, Meter
from reachmap.scans.refinement import refine
from reachmap.scans.routes import RouteAttempts, WayIn, plan_from_scratch, ways_in

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

# About a second of planning: little is lost with a unit, little spent on keeping it.
GRASPS_PER_UNIT = 45


@dataclass(frozen=True, slots=True, kw_only=True)
class BinContext:
    """Context of a worker: the cell and the survey of every test grasp.

    Attributes
    ----------
    fillings : tuple of LoadedCell
        The cell for each level of the parts in the bin, in the order of the layers.
    known : tuple of BinRoadmap
        Of the test grasps of each.
    body_pairs : tuple of str
        As the map numbers them.
    cycles : tuple of CycleKnowledge or None
        Of each filling, where the cell has a part.
    refinement : Refinement or None
        What is known between the test grasps.
    """

    fillings: tuple[LoadedCell, ...]
    known: tuple[BinRoadmap, ...]
    body_pairs: tuple[str, ...]
    cycles: tuple[CycleKnowledge | None, ...]
    refinement: Refinement | None


@dataclass(frozen=True, slots=True)
class _OneFilling:
    """Stages of one filling among others, under distinct names."""

    stages: Stages
    suffix: str

    def run(
        self, phase: str, job: Job, units: Sequence[Any], *, most: int | None = None
    ) -> list[Any]:
        return self.stages.run(phase + self.suffix, job, units, most=most)

    def once(
        self,
        phase: str,
        function: Callable[[Progress], Any],
        tally: Callable[[Any], tuple[int, int]] = one_frame,
    ) -> Any:
        return self.stages.once(phase + self.suffix, function, tally)


def bin_work(scene: Scene, document: Mapping[str, Any]) -> Work:
    """Work of a bin scan.

    Parameters
    ----------
    scene : Scene
        With the bin.
    document : mapping
        See :func:`reachmap.scans.document.scan_document`.
    """
    grasps, fillings = grasp_grid(scene).size, len(scene.loaded.fillings())
    each = grasps // fillings
    units = [
        range(first + part.start, first + part.stop)
        for first in range(0, grasps, each)
        for part in blocks(each, GRASPS_PER_UNIT)
    ]
    return Work(
        kind=KIND,
        units=units,
        job=partial(planning_job, scene, tuple(document["body_pairs"])),
        settings=journal_settings(document),
        document={
            **document,
            "grasps": grasps,
            "fillings": fillings,
            "stages": list(stages_of(scene.loaded)),
            "part_corners": _part_corners(scene.loaded),
        },
        frames=grasps,
    )


def _part_corners(loaded: LoadedCell) -> list[list[float]] | None:
    part = HeldPart.of(loaded)
    return None if part is None else part.points.tolist()


def pairs_of_fillings(loaded: LoadedCell) -> list[str]:
    """Pairs of bodies that are checked at one level of the parts or another.

    Raises
    ------
    SceneError
        The scan configuration cannot be taken at one of them.
    """
    found: dict[str, None] = {}
    for filling in loaded.fillings():
        scene = Scene.shared(filling, with_bin=True)
        scene.require_free_scan_configuration()
        found |= dict.fromkeys(scene.checker.body_pairs)
    for filling in loaded.fillings():
        scenes = CycleScenes.of(filling)
        found |= dict.fromkeys(() if scenes is None else scenes.body_pairs)
    return list(found)


def _fill_percent(filling: LoadedCell) -> float:
    """How full the bin is [percent of its depth]."""
    cell = filling.cell
    return 100.0 * cell.bin_scan.layers[0] / cell.bin.inner[2]


def planning_job(scene: Scene, body_pairs: tuple[str, ...], stages: Stages) -> Job:
    """Survey the test grasps and connect them; what is left is to plan to each."""
    fillings = scene.loaded.fillings()
    known, cycles = [], []
    for filling in fillings:
        suffix = f"_at_{_fill_percent(filling):.6g}%_fill"
        one = stages if len(fillings) == 1 else _OneFilling(stages, suffix)
        way_in = connected_grasps(Scene.shared(filling, with_bin=True), one)
        known.append(way_in)
        cycles.append(whole_cycles(filling, way_in, body_pairs, one))
    whole = BinContext(
        fillings=fillings,
        known=tuple(known),
        body_pairs=body_pairs,
        cycles=tuple(cycles),
        refinement=refine(scene, stages),
    )
    return Job(function=plan_unit, context=whole, tally=tally)


def plan_unit(context: BinContext, grasps: range) -> dict[str, Any]:
    """Make all attempts at the test grasps of one unit.

    The first unit of a filling tells the evidence of its roadmap, the first of all
    what is known between the test grasps.
    """
    each = len(context.known[0].component)
    layer, first = divmod(grasps.start, each)
    scene = Scene.shared(context.fillings[layer], with_bin=True)
    known, cycle = context.known[layer], context.cycles[layer]
    results = plan_grasps(
        scene,
        known,
        range(first, first + len(grasps)),
        CyclePlanner.of(scene.loaded, known, cycle),
    )
    number = {name: k for k, name in enumerate(context.body_pairs)}
    payload = dataclasses.asdict(
        GraspResults.join(results).renumbered(
            np.array([number[name] for name in scene.checker.body_pairs], np.int64),
            sum(len(other.components.checks) for other in context.known[:layer]),
        )
    )
    if first == 0:
        payload["components"] = dataclasses.asdict(known.components)
    if grasps.start == 0 and context.refinement is not None:
        payload["refinement"] = dataclasses.asdict(context.refinement)
    return payload


def plan_grasps(
    scene: Scene,
    known: BinRoadmap,
    grasps: Sequence[int],
    cycle: CyclePlanner | None = None,
) -> list[GraspResults]:
    """Make all attempts at some test grasps.

    Parameters
    ----------
    scene : Scene
    known : BinRoadmap
    grasps : sequence of int
        Their numbers in the survey, which with the cell's seed make their own.
    cycle : CyclePlanner, optional
        Plans what follows.
    """
    spec, survey = scene.loaded.cell.bin_scan, known.survey
    attempts = RouteAttempts(scene, survey, known.routes)
    if spec.attempts == "roadmap":
        plans = [attempts.at(grasp, spec.repeats) for grasp in grasps]
    else:
        plans = plan_from_scratch(scene, survey, grasps)
    results, margins = [], MarginMeter(scene)
    for grasp, made in zip(grasps, plans, strict=True):
        missed = all(plan.path is None for plan, _ in made)
        own = attempts.own(grasp) if missed else None
        results.append(_results(scene, known, grasp, made, own, margins, cycle))
    return results


def _results(
    scene: Scene,
    known: BinRoadmap,
    grasp: int,
    plans: Sequence[tuple[PlanResult, int]],
    own: tuple[FloatArray, int] | None,
    margins: MarginMeter,
    cycle: CyclePlanner | None,
) -> GraspResults:
    survey, repeats = known.survey, scene.loaded.cell.bin_scan.repeats
    found = ways_in(survey, plans, own)
    after = None if cycle is None else cycle.plan(grasp, found)
    found, best = _chosen(found, after)
    measured, measured_own = _measured(Meter(scene), survey, plans, found, repeats)
    connected = known.routes.over_roadmap(survey, grasp) is not None
    return GraspResults(
        status=np.array([_status(survey, grasp, found=bool(found))], np.uint8),
        n_ik=survey.n_ik[[grasp]],
        n_ik_free=survey.n_ik_free[[grasp]],
        connected=np.array([connected], np.uint8),
        blocking_pair=survey.blocking_pair[[grasp]],
        path_found=np.isfinite(measured[..., 0]).astype(np.uint8),
        hit_time_limit=_per_attempt(plans, "hit_time_limit", repeats, np.uint8),
        checks=_per_attempt(plans, "checks", repeats, np.int64),
        measured=measured,
        own=measured_own,
        component=known.component[[grasp]],
        winning_roll=np.array([_roll_of(survey, grasp, best, after)]),
        margins=np.array(
            [[np.nan] * 4 if best is None else margins.of_path(*best[:2])]
        ),
        **_kept_paths(found, after, scene.robot.dof),
        best_repeat=np.array([NO_PATH if best is None else best.repeat], np.int64),
        cycle=None if after is None else CycleResults.of([after]),
    )


def _chosen(
    found: list[WayIn], after: CyclePlan | None
) -> tuple[list[WayIn], WayIn | None]:
    """Paths to the grasp to keep, and the one to execute."""
    if after is None or after.way_in is None:
        shortest = min(found, key=lambda way: path_length_rad(way.path), default=None)
        return found, shortest
    # What is executed is the whole cycle, even if another path to the grasp is shorter.
    best = after.way_in
    if best.repeat < 0:
        found = [*(way for way in found if way.repeat >= 0), best]
    return found, best


def _roll_of(
    survey: Survey, grasp: int, best: WayIn | None, after: CyclePlan | None
) -> float:
    """Roll of the way that a line would run [rad]; NaN without one."""
    if after is not None and after.way_in is not None:
        return after.roll_rad  # its goal is one of the cycle's own
    return float("nan") if best is None else survey.roll_of(grasp, best.goal)


def _measured(
    meter: Meter,
    survey: Survey,
    plans: Sequence[tuple[PlanResult, int]],
    found: Sequence[WayIn],
    repeats: int,
) -> tuple[FloatArray, FloatArray]:
    """Numbers of the attempts, (1, repeats, n), and of the roadmap's path, (1, n)."""
    of_attempts = np.full((1, repeats, len(MEASURED)), np.nan)
    of_own = np.full((1, len(MEASURED)), np.nan)
    for repeat, (plan, goal) in enumerate(plans):
        if plan.path is not None:
            way = survey.way_from(goal, plan.path[-1])
            of_attempts[0, repeat] = meter.measured(plan, way)
    for way_in in found:
        if way_in.repeat < 0:
            path, planned = way_in.path, way_in.planned
            approach = path[planned - 1 :]
            of_own[0] = meter.measured(
                PlanResult.without_search(path[:planned]), approach
            )
    return of_attempts, of_own


def _kept_paths(
    found: Sequence[WayIn], after: CyclePlan | None, dof: int
) -> dict[str, Any]:
    """Fields of the results: ways in, then the later stages of the cycle."""
    paths = [(way.path, way.planned, way.repeat, 0) for way in found]
    for stage, (path, planned) in enumerate(() if after is None else after.paths):
        paths.append((path, planned, -1, stage + 1))
    return {
        "configuration": np.vstack(
            [np.zeros((0, dof)), *(entry[0] for entry in paths)]
        ),
        "row_size": np.array([len(entry[0]) for entry in paths], np.int64),
        "planned_size": np.array([entry[1] for entry in paths], np.int64),
        "place": np.array([(0, entry[2]) for entry in paths], np.int64).reshape(-1, 2),
        "stage": np.array([entry[3] for entry in paths], np.uint8),
    }


def _per_attempt(
    plans: Sequence[tuple[PlanResult, int]], name: str, repeats: int, dtype: type
) -> Any:
    """A number of each attempt that was made, 0 of the others, shape (1, repeats)."""
    values: Any = np.zeros((1, repeats), dtype)
    values[0, : len(plans)] = [getattr(plan, name) for plan, _ in plans]
    return values


def _status(survey: Survey, grasp: int, *, found: bool) -> int:
    if not len(survey.goals_of(grasp)):
        return int(survey.status[grasp])
    return Status.PATH_FOUND if found else Status.NO_PATH_FOUND


def blank(document: Mapping[str, Any], unit: int, status: Status) -> dict[str, Any]:
    """Payload of a unit without results."""
    spec = cell_of_document(document).bin_scan
    each = document["grasps"] // document.get("fillings", 1)
    left = each - unit % -(-each // GRASPS_PER_UNIT) * GRASPS_PER_UNIT
    empty = GraspResults.blank(
        min(GRASPS_PER_UNIT, left),
        spec.repeats,
        len(document["joint_names"]),
        status,
        stages=len(document.get("stages", ())),
    )
    return dataclasses.asdict(empty)


def assemble(
    document: Mapping[str, Any], payloads: Sequence[Any], *, run: RunInfo
) -> BinMap:
    """Make the map from the payloads of all units."""
    parts: list[GraspResults] = []
    evidence: list[Components] = []
    refinement = None
    for payload in payloads:
        fields = dict(payload)
        components = fields.pop("components", None)
        if components is not None:
            evidence.append(components_from_payload(components))
        if (between := fields.pop("refinement", None)) is not None:
            refinement = Refinement(**between)
        if fields["cycle"] is not None:
            fields["cycle"] = CycleResults(**fields["cycle"])
        parts.append(GraspResults(**fields))
    complete = len(evidence) == document.get("fillings", 1)
    return assemble_bin_map(
        document,
        GraspResults.join(parts),
        run=run,
        components=join_components(evidence) if complete else None,
        refinement=refinement,
    )


KIND = Kind(name="bin_map", blank=blank, assemble=assemble, write=write_bin_map)
