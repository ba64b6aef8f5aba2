"""What all cycles of a scan share, worked out before the test grasps one by one."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap.maps.parts import StageStatus
from reachmap.runtime.job import Stages
from reachmap.runtime.progress import Progress
from reachmap.scans.bin_roadmap import BinRoadmap
from reachmap.scans.cycle.lifts import lift_in_stages
from reachmap.scans.cycle.places import Places, find_places
from reachmap.scans.cycle.planning import CycleKnowledge
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.cycle.transfers import Hub, find_hubs

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

logger = logging.getLogger(__name__)


def knowledge_of(
    loaded: LoadedCell, known: BinRoadmap, body_pairs: tuple[str, ...], stages: Stages
) -> CycleKnowledge:
    """Lift the part from all goals, find where it may go, and connect the two."""
    lifts = lift_in_stages(loaded, known, body_pairs, stages)
    scenes = CycleScenes.of(loaded)
    assert scenes is not None
    goals = np.flatnonzero(lifts.status == StageStatus.PATH_FOUND)
    lifted = lifts.ways.take(goals).last if len(goals) else lifts.ways.point[:0]
    places = Places.from_payload(
        stages.once(
            "return",
            lambda progress: find_places(
                scenes, body_pairs, lifted, progress
            ).payload(),
        )
    )

    def connect(progress: Progress) -> list[dict[str, Any]]:
        frame = known.survey.frame
        hubs = find_hubs(
            scenes, places, goals, frame[goals], lifted, len(frame), progress
        )
        return [hub.payload() for hub in hubs]

    hubs = stages.once("transfer", connect)
    return CycleKnowledge(
        lifts=lifts,
        places=places,
        hubs=tuple(Hub.from_payload(hub) for hub in hubs),
    )
