"""Stages shared by all cycles of a scan, computed before single test grasps."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import IntArray
from reachmap.cell.model.robot import LISTED
from reachmap.maps.parts import StageStatus
from reachmap.runtime.job import Stages
from reachmap.runtime.progress import Progress
from reachmap.scans.bin_roadmap import BinRoadmap, MoreRolls
from reachmap.scans.cycle.lifts import LiftSurvey, lift_in_stages
from reachmap.scans.cycle.places import (
    Places,
    WaysToPlace,
    find_places,
    ways_to_place,
)
from reachmap.scans.cycle.planning import CycleKnowledge
from reachmap.scans.cycle.quicker_rolls import quicker_goals
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.cycle.transfers import Hub, find_hubs
from reachmap.scans.ik_survey import Survey
from reachmap.scans.rolls import places_among

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


def whole_cycles(
    loaded: LoadedCell, known: BinRoadmap, body_pairs: tuple[str, ...], stages: Stages
) -> CycleKnowledge | None:
    """Lift the part from goals, find where it may go, and connect the two.

    Where the roll is free, grasps get goals at other rolls: at those that promise a
    quicker cycle, and at more of them until one has a lift. They are the cycle's own:
    what is known of the ways in stays as it is without a part.

    Returns
    -------
    CycleKnowledge or None
        None where the cell has no part.
    """
    scenes = CycleScenes.of(loaded)
    if scenes is None:
        return None
    placing = [ways_to_place(scenes, spec) for spec in loaded.cell.drop_offs]
    survey, lifts = _lifted(scenes, known, placing, body_pairs, stages)
    goals = np.flatnonzero(lifts.status == StageStatus.PATH_FOUND)
    lifted = lifts.ways.take(goals).last if len(goals) else lifts.ways.point[:0]
    found = stages.once("return", partial(_places, scenes, placing, body_pairs, lifted))
    places = Places.from_payload(found)

    def connect(progress: Progress) -> list[dict[str, Any]]:
        frame = survey.frame
        hubs = find_hubs(
            scenes, places, goals, frame[goals], lifted, len(frame), progress
        )
        return [hub.payload() for hub in hubs]

    hubs = tuple(Hub.from_payload(hub) for hub in stages.once("transfer", connect))
    return CycleKnowledge(survey=survey, lifts=lifts, places=places, hubs=hubs)


def _lifted(
    scenes: CycleScenes,
    known: BinRoadmap,
    placing: Sequence[WaysToPlace],
    body_pairs: tuple[str, ...],
    stages: Stages,
) -> tuple[Survey, LiftSurvey]:
    """Goals of the cycles, those of the ways in among them, and lifts from them."""
    survey, loaded = known.survey, scenes.empty.loaded
    reached = np.unique(survey.frame[np.isfinite(known.routes.length_rad)])
    rolls = None
    if loaded.cell.tool.roll != LISTED and not scenes.empty.kinematics.any_roll:
        rolls = MoreRolls(scenes.empty, stages, "_cycle")
    ways = [way for ways, _ in placing for way in ways]
    quicker = None
    if rolls is not None:
        quicker = quicker_goals(
            scenes, rolls.groups, survey, reached, ways, body_pairs, stages
        )
    if rolls is not None and quicker is not None:
        approaches = [quicker.approaches[k] for k in range(len(quicker.approaches))]
        survey = rolls.groups.with_more(survey, quicker.group, quicker.roll, approaches)
        reached = np.setdiff1d(reached, quicker.group)
    place = places_among(known.survey.frame, survey.frame)
    rows = place[np.isin(known.survey.frame, reached)]
    lifts = lift_in_stages(loaded, survey, rows, body_pairs, stages, "lift")
    if quicker is not None:
        added = np.setdiff1d(np.arange(len(survey.frame)), place)
        lifts = lifts.with_lifts(quicker.lifts, added)
    if rolls is None:
        return survey, lifts
    return _with_more_rolls(scenes, rolls, survey, lifts, body_pairs, stages)


def _places(
    scenes: CycleScenes,
    placing: Sequence[WaysToPlace],
    body_pairs: tuple[str, ...],
    lifted: Any,
    progress: Progress,
) -> dict[str, Any]:
    return find_places(scenes, placing, body_pairs, lifted, progress).payload()


def _with_more_rolls(
    scenes: CycleScenes,
    rolls: MoreRolls,
    survey: Survey,
    lifts: LiftSurvey,
    body_pairs: tuple[str, ...],
    stages: Stages,
) -> tuple[Survey, LiftSurvey]:
    """Goals and lifts at other rolls of what is reached and has no lift.

    A few rolls at a time, until one has.
    """
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
            survey, lifts = more, found.with_lifts(lifts, old)
    return survey, lifts


def _without_lift(survey: Survey, lifts: LiftSurvey, *, is_round: bool) -> IntArray:
    """Groups that are reached and have no lift, although another roll may have one."""
    frame, status = survey.frame, lifts.status
    lifted = frame[status == StageStatus.PATH_FOUND]
    hopeless = status == StageStatus.NOT_ATTEMPTED
    if is_round:  # then no roll takes the part out of a wall
        hopeless |= status == StageStatus.PART_IN_COLLISION
    return np.setdiff1d(frame[~hopeless], lifted)
