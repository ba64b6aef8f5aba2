"""Stages shared by all cycles of a scan, computed before single test grasps."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import IntArray
from reachmap.cell.model.tool import LISTED
from reachmap.maps.parts import StageStatus
from reachmap.runtime.job import Stages
from reachmap.runtime.progress import Progress
from reachmap.scans.bin_roadmap import BinRoadmap, MoreRolls, connected_goals
from reachmap.scans.cycle.lifts import LiftSurvey, lift_in_stages
from reachmap.scans.cycle.places import Places, find_places
from reachmap.scans.cycle.planning import CycleKnowledge
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.cycle.transfers import Hub, find_hubs
from reachmap.scans.ik_survey import Survey

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


def whole_cycles(
    loaded: LoadedCell, known: BinRoadmap, body_pairs: tuple[str, ...], stages: Stages
) -> tuple[BinRoadmap, CycleKnowledge | None]:
    """Lift the part from all goals, find where it may go, and connect the two.

    Where the roll is free, grasps that have a path and no lift get other rolls.

    Returns
    -------
    known : BinRoadmap
        With the goals of these rolls.
    shared : CycleKnowledge or None
        None where the cell has no part.
    """
    scenes = CycleScenes.of(loaded)
    if scenes is None:
        return known, None
    survey = known.survey
    reached = survey.frame[np.isfinite(known.routes.length_rad)]
    rows = np.flatnonzero(np.isin(survey.frame, reached))
    lifts = lift_in_stages(loaded, survey, rows, body_pairs, stages, "lift")
    if loaded.cell.tool.roll != LISTED and not scenes.empty.kinematics.any_roll:
        survey, lifts = _with_more_rolls(scenes, survey, lifts, body_pairs, stages)
        if survey is not known.survey:
            known = connected_goals(scenes.empty, stages, "connect_cycle", survey)
    goals = np.flatnonzero(lifts.status == StageStatus.PATH_FOUND)
    lifted = lifts.ways.take(goals).last if len(goals) else lifts.ways.point[:0]
    found = stages.once("return", partial(_places, scenes, body_pairs, lifted))
    places = Places.from_payload(found)

    def connect(progress: Progress) -> list[dict[str, Any]]:
        frame = known.survey.frame
        hubs = find_hubs(
            scenes, places, goals, frame[goals], lifted, len(frame), progress
        )
        return [hub.payload() for hub in hubs]

    hubs = tuple(Hub.from_payload(hub) for hub in stages.once("transfer", connect))
    return known, CycleKnowledge(lifts=lifts, places=places, hubs=hubs)


def _places(
    scenes: CycleScenes,
    body_pairs: tuple[str, ...],
    lifted: Any,
    progress: Progress,
) -> dict[str, Any]:
    return find_places(scenes, body_pairs, lifted, progress).payload()


def _with_more_rolls(
    scenes: CycleScenes,
    survey: Survey,
    lifts: LiftSurvey,
    body_pairs: tuple[str, ...],
    stages: Stages,
) -> tuple[Survey, LiftSurvey]:
    """Goals and lifts at other rolls of what is reached and has no lift.

    A few rolls at a time, until one has.
    """
    rolls = MoreRolls(scenes.empty, stages, "_cycle")
    for number, turns in enumerate(rolls.few_at_a_time(), start=1):
        wanted = _without_lift(survey, lifts, is_round=scenes.part.is_round)
        if not len(wanted):
            break
        more = rolls.add_turns(survey, wanted, turns)
        old = places_among(survey.frame, more.frame)
        rows = np.setdiff1d(np.arange(len(more.frame)), old)
        found = lift_in_stages(
            scenes.empty.loaded, more, rows, body_pairs, stages, f"lift_{number}"
        )
        if len(rows):
            survey, lifts = more, found.joined_with(lifts, old)
    return survey, lifts


def places_among(frame: IntArray, more: IntArray) -> IntArray:
    """Where goals are after others were added behind those of their frames."""
    number = np.arange(len(frame)) - np.searchsorted(frame, frame)
    return np.asarray(np.searchsorted(more, frame) + number)


def _without_lift(survey: Survey, lifts: LiftSurvey, *, is_round: bool) -> IntArray:
    """Groups that are reached and have no lift, although another roll may have one."""
    frame, status = survey.frame, lifts.status
    lifted = frame[status == StageStatus.PATH_FOUND]
    hopeless = status == StageStatus.NOT_ATTEMPTED
    if is_round:  # then no roll takes the part out of a wall
        hopeless |= status == StageStatus.PART_IN_COLLISION
    return np.setdiff1d(frame[~hopeless], lifted)
