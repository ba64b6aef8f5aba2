"""Preparation of all test grasps before attempts: goals, roadmap, routes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.robot import LISTED
from reachmap.core.scene import Scene
from reachmap.maps.parts import Components
from reachmap.runtime.job import Stages
from reachmap.runtime.progress import Progress
from reachmap.sampling.frames import (
    FrameGrid,
    FrameList,
    approach_distance_m,
    bin_test_frames,
)
from reachmap.scans.ik_survey import Survey, SurveyContext, survey_in_stages
from reachmap.scans.rolls import AT_ONCE, RollGroups
from reachmap.scans.routes import Routes
from reachmap.scans.workspace_roadmap import (
    component_of_frames,
    components_of,
    connect_survey,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BinRoadmap:
    """Goals of all test grasps, and how they are connected.

    Attributes
    ----------
    survey : Survey
    component : int array, shape (grasps,)
        Component of the roadmap, -1 without goals.
    components : Components
        Evidence of the roadmap.
    routes : Routes
    """

    survey: Survey
    component: IntArray
    components: Components
    routes: Routes


def grasp_grid(scene: Scene) -> FrameGrid:
    """Test grasps of a scan, in robot_base."""
    return bin_test_frames(scene.loaded.cell, scene.T_base_bin).frames


def connected_grasps(scene: Scene, stages: Stages) -> BinRoadmap:
    """Survey the test grasps and connect them."""
    tool = scene.loaded.cell.tool
    survey = _survey(scene, stages, "survey", grasp_grid(scene))
    if tool.roll == LISTED:
        return connected_goals(scene, stages, "connect", survey)
    rolls = MoreRolls(scene, stages)
    survey = rolls.groups.share_goals(survey)
    if scene.kinematics.any_roll:
        T_goal = scene.kinematics.forward_many(survey.grasps)
        axis = scene.loaded.cell.robot.tcp.approach_axis
        measured = rolls.groups.measured(survey, axis, T_goal)
        return connected_goals(scene, stages, "connect", measured)
    without = np.setdiff1d(rolls.groups.group, survey.frame)
    survey = rolls.add(survey, without, until_found=True)
    known = connected_goals(scene, stages, "connect", survey)
    missed = np.setdiff1d(
        survey.frame, survey.frame[np.isfinite(known.routes.length_rad)]
    )
    # One roll had a goal, but no path: perhaps another one has.
    more = rolls.add(survey, missed, until_found=False)
    if len(more.frame) == len(survey.frame):
        return known
    return connected_goals(scene, stages, "connect_again", more)


class MoreRolls:
    """Solves for rolls that are not listed, in stages of their own."""

    def __init__(self, scene: Scene, stages: Stages, suffix: str = "") -> None:
        """Of a cell whose roll is free; the suffix tells its stages from others'."""
        cell = scene.loaded.cell
        self._scene, self._stages, self._suffix = scene, stages, suffix
        self._axis = cell.robot.tcp.approach_axis
        self.groups = RollGroups.of(grasp_grid(scene), self._axis, cell.tool)
        self._number = 0

    def add(self, survey: Survey, wanted: IntArray, *, until_found: bool) -> Survey:
        """See :meth:`RollGroups.add_rolls`."""
        return self.groups.add_rolls(
            survey, wanted, self._axis, self._solve, until_found=until_found
        )

    def few_at_a_time(self) -> list[FloatArray]:
        """Rolls to be tried in turn, each far from those before it [rad]."""
        turns = self.groups.turns
        return [turns[k : k + AT_ONCE] for k in range(0, len(turns), AT_ONCE)]

    def add_turns(self, survey: Survey, wanted: IntArray, turns: FloatArray) -> Survey:
        """Add the goals of some rolls to some groups."""
        few = dataclasses.replace(self.groups, turns=turns)
        return few.add_rolls(survey, wanted, self._axis, self._solve, until_found=False)

    def _solve(self, T: FloatArray) -> Survey:
        self._number += 1
        phase = f"rolls{self._suffix}_{self._number}"
        return _survey(self._scene, self._stages, phase, FrameList(T=T))


def _survey(
    scene: Scene, stages: Stages, phase: str, frames: FrameGrid | FrameList
) -> Survey:
    context = SurveyContext(
        loaded=scene.loaded,
        with_bin=True,
        grids=(frames,),
        approach_m=approach_distance_m(scene.loaded.cell),
    )
    return survey_in_stages(context, stages, phase)


def connected_goals(
    scene: Scene, stages: Stages, phase: str, survey: Survey
) -> BinRoadmap:
    """Connect the goals of a survey, in a stage of its own."""
    payload = stages.once(phase, partial(_connection, scene, survey))
    return _roadmap_from_payload(survey, payload)


def lengths_over_roadmap(
    scene: Scene, stages: Stages, phase: str, survey: Survey
) -> FloatArray:
    """Connect a survey; length of the path to each goal [rad], infinite without one."""

    def connect(progress: Progress) -> dict[str, Any]:
        connection = connect_survey(
            scene, survey, seed=scene.loaded.cell.seed, progress=progress
        )
        paths = connection.roadmap.shortest_paths()
        node = connection.roadmap.shortest_to_goals(paths)
        return {"length_rad": paths.length_rad[node]}

    return np.asarray(stages.once(phase, connect)["length_rad"])


def roadmap_of(scene: Scene, survey: Survey) -> BinRoadmap:
    """Connect the goals of a survey in this process."""
    silent = Progress("", quiet=True)
    return _roadmap_from_payload(survey, _connection(scene, survey, silent))


def _connection(scene: Scene, survey: Survey, progress: Progress) -> dict[str, Any]:
    cell = scene.loaded.cell
    connection = connect_survey(scene, survey, seed=cell.seed, progress=progress)
    routes = Routes.of(
        scene, survey, connection, with_network=cell.bin_scan.attempts == "roadmap"
    )
    return {
        "component": component_of_frames(survey, connection),
        "components": dataclasses.asdict(components_of(connection)),
        **routes.payload(),
    }


def _roadmap_from_payload(survey: Survey, payload: Mapping[str, Any]) -> BinRoadmap:
    """Roadmap from the stored payload of a stage."""
    return BinRoadmap(
        survey=survey,
        component=payload["component"],
        components=components_from_payload(payload["components"]),
        routes=Routes.from_payload(payload),
    )


def join_components(parts: Sequence[Components]) -> Components:
    """Evidence of several roadmaps, their components numbered on."""
    joined = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in dataclasses.fields(Components)
        if field.name != "methods"
    }
    return Components(**joined, methods=parts[0].methods)


def components_from_payload(values: Mapping[str, Any]) -> Components:
    """Evidence of the roadmap; lists of names come back from the store as lists."""
    return Components(**{**values, "methods": tuple(values["methods"])})
