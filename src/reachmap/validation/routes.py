"""Planning to grasps over roadmaps of their own, as the map planned to its test grasps.

Nothing of the map is used: the goals are those of the grasps themselves, the roadmaps
are made again with other seeds, and what neither of them connects is left to the cell's
planner, so that a miss is never the verdict of one method.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import IntArray
from reachmap.core.planning.planner import PlanResult
from reachmap.core.scene import Scene
from reachmap.maps.records import NO_PAIR, Status
from reachmap.runtime.job import Job
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress
from reachmap.runtime.run import run
from reachmap.scans.bin_roadmap import BinRoadmap, roadmap_of
from reachmap.scans.ik_survey import Survey, join_surveys
from reachmap.scans.measured import MEASURED, Meter
from reachmap.scans.routes import RouteAttempts
from reachmap.validation.planning import (
    PickContext,
    PickResults,
    joined_results,
    plan_unit,
    survey_of_pick,
)

ROADMAPS = 2
"""Roadmaps with seeds of their own, between which attempts take turns: what differs
between them is chance, which attempts over one roadmap would hide."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RouteContext:
    """What a worker needs: the grasps of one list, and how they are connected.

    Attributes
    ----------
    pick : PickContext
    rows : int array, shape (n,)
        The list's grasps among all.
    begin : int array, shape (n + 1,)
        First tool pose of each grasp, which are the frames of the survey.
    known : tuple of BinRoadmap
        One for each seed, all of one survey.
    """

    pick: PickContext
    rows: IntArray
    begin: IntArray
    known: tuple[BinRoadmap, ...]


def plan_picks_over_routes(
    context: PickContext, options: RunOptions, *, progress: Progress
) -> PickResults:
    """Plan to every grasp over routes that are shared by the grasps of its list.

    A list gives the same results alone and together with others.
    """
    picks = range(len(context.picks))
    job = Job(function=survey_pick, context=context)
    surveys = [Survey(**one) for one in run(job, picks, options, progress)]
    payloads = []
    for rows in _lists(context.picks.number):
        joined = join_surveys([surveys[row] for row in rows])
        scene = Scene.shared(context.loaded, with_bin=True)
        routes = RouteContext(
            pick=context,
            rows=rows,
            begin=np.cumsum([0, *(len(surveys[row].status) for row in rows)]),
            known=tuple(
                roadmap_of(_seeded(scene, context.seed, k), joined)
                for k in range(min(ROADMAPS, context.repeats))
            ),
        )
        job = Job(function=plan_over_routes, context=routes)
        payloads += run(job, range(len(rows)), options, progress)
    return joined_results(payloads)


def _lists(number: IntArray) -> list[IntArray]:
    """Rows of each list; grasps are counted from 0 in each."""
    begin = np.flatnonzero(number == 0)
    return np.split(np.arange(len(number)), begin[1:])


def _seeded(scene: Scene, seed: int, roadmap: int) -> Scene:
    """The same scene with the seed of one of the roadmaps, none of them the map's."""
    cell = scene.loaded.cell
    other = cell.model_copy(update={"seed": seed + 1 + roadmap})
    loaded = dataclasses.replace(scene.loaded, cell=other)
    return dataclasses.replace(scene, loaded=loaded)


def survey_pick(context: PickContext, pick: int) -> dict[str, Any]:
    """Goals of all tool poses of one grasp."""
    scene = Scene.shared(context.loaded, with_bin=True)
    return survey_of_pick(context, scene, pick).payload()


def plan_over_routes(context: RouteContext, k: int) -> dict[str, Any]:
    """Make all attempts at the k-th grasp of a list."""
    scene = Scene.shared(context.pick.loaded, with_bin=True)
    repeats = context.pick.repeats
    survey = context.known[0].survey
    frames = np.arange(context.begin[k], context.begin[k + 1])
    measured = np.full((1, repeats, len(MEASURED)), np.nan)
    pose = np.full((1, repeats), -1)
    checks = np.zeros_like(pose)
    meter = Meter(scene)
    for turn, known in enumerate(context.known):
        seeded = _seeded(scene, context.pick.seed, turn)
        mine = range(turn, repeats, len(context.known))
        made = _attempts(seeded, known, frames, len(mine))
        for attempt, (plan, goal) in zip(mine, made, strict=False):
            assert plan.path is not None
            way = survey.way_from(goal, plan.path[-1])
            measured[0, attempt] = meter.measured(plan, way)
            pose[0, attempt] = survey.frame[goal] - frames[0]
            checks[0, attempt] = plan.checks
    if (pose < 0).all():
        return plan_unit(context.pick, int(context.rows[k]))
    free = np.unique(survey.frame[np.isin(survey.frame, frames)])
    results = PickResults(
        status=np.array([Status.PATH_FOUND], np.uint8),
        blocking_pair=np.array([NO_PAIR]),
        poses=np.array([len(frames)]),
        poses_free=np.array([len(free)]),
        recommended_free=np.array([frames[0] in free], np.uint8),
        found=(pose >= 0).astype(np.uint8),
        measured=measured,
        pose=pose,
        checks=checks,
        hit_time_limit=np.zeros(pose.shape, np.uint8),
    )
    return dataclasses.asdict(results)


def _attempts(
    scene: Scene, known: BinRoadmap, frames: IntArray, repeats: int
) -> Sequence[tuple[PlanResult, int]]:
    """Attempts at the recommended tool pose, else at the one with the shortest path."""
    survey, length = known.survey, known.routes.length_rad
    least = np.array(
        [length[survey.goals_of(frame)].min(initial=np.inf) for frame in frames]
    )
    if not np.isfinite(least).any() or not repeats:
        return []
    chosen = 0 if np.isfinite(least[0]) else int(np.argmin(least))
    attempts = RouteAttempts(scene, survey, known.routes)
    return attempts.at(int(frames[chosen]), repeats)
