"""What all cycles of a scan share, worked out before the test grasps one by one."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import IntArray
from reachmap.cell.model.tool import LISTED
from reachmap.maps.parts import StageStatus
from reachmap.runtime.job import Stages
from reachmap.runtime.progress import Progress
from reachmap.scans.bin_roadmap import BinRoadmap, with_more_rolls
from reachmap.scans.cycle.lifts import LiftSurvey, lift_in_stages
from reachmap.scans.cycle.places import Places, find_places
from reachmap.scans.cycle.planning import CycleKnowledge
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.cycle.transfers import Hub, find_hubs

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
    lifts = lift_in_stages(loaded, known, body_pairs, stages, "lift")
    if loaded.cell.tool.roll != LISTED:
        wanted = _without_lift(known, lifts, is_round=scenes.part.is_round)
        more = with_more_rolls(scenes.empty, known, wanted, stages)
        if more is not known:
            known = more
            lifts = lift_in_stages(loaded, known, body_pairs, stages, "lift_again")
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


def _without_lift(known: BinRoadmap, lifts: LiftSurvey, *, is_round: bool) -> IntArray:
    """Groups that are reached and have no lift, though another roll may have one."""
    frame, status = known.survey.frame, lifts.status
    lifted = frame[status == StageStatus.PATH_FOUND]
    hopeless = status == StageStatus.NOT_ATTEMPTED
    if is_round:  # then no roll takes the part out of a wall
        hopeless |= status == StageStatus.PART_IN_COLLISION
    return np.setdiff1d(frame[~hopeless], lifted)
