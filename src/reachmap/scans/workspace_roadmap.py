"""Workspace scan by connectivity: every frame at once, seconds instead of hours."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.planning.connection import Connection, connect
from reachmap.core.scene import Scene
from reachmap.maps import Status
from reachmap.maps.parts import Components, confidence_of
from reachmap.runtime.job import Stages, Work
from reachmap.runtime.journal import UNITS
from reachmap.runtime.progress import Progress
from reachmap.sampling.frames import workspace_frames
from reachmap.scans.document import journal_settings, tally
from reachmap.scans.ik_survey import MAX_COUNT, Survey, SurveyContext, survey_in_stages
from reachmap.scans.workspace_results import KIND, FrameResults, frames_of_cell


def roadmap_work(scene: Scene, document: Mapping[str, Any]) -> Work:
    """Work of a scan by connectivity, which looks at all frames together.

    Parameters
    ----------
    scene : Scene
    document : mapping
        See :func:`reachmap.scans.document.scan_document`.
    """
    frames = frames_of_cell(scene.loaded.cell)
    return Work(
        kind=KIND,
        units=["connection"],
        job=partial(connect_all, scene),
        settings=journal_settings(document),
        document={**document, "frames_per_unit": frames},
        frames=frames,
    )


def connect_all(scene: Scene, stages: Stages) -> None:
    """Survey all frames, then do the one unit of the work: connect them."""
    cell = scene.loaded.cell
    cubes = workspace_frames(cell)
    context = SurveyContext(
        loaded=scene.loaded,
        with_bin=scene.with_bin,
        grids=tuple(cube.frames for cube in cubes),
        approach_m=0.0,
    )
    survey = survey_in_stages(context, stages)

    def connect(progress: Progress) -> dict[str, Any]:
        connection = connect_survey(
            scene,
            survey,
            seed=cell.seed,
            progress=progress,
        )
        results = dataclasses.asdict(results_of_connection(survey, connection))
        return results | {"components": dataclasses.asdict(components_of(connection))}

    stages.once(UNITS, connect, tally)


def connect_survey(
    scene: Scene,
    survey: Survey,
    *,
    seed: int,
    progress: Progress | None = None,
) -> Connection:
    """Connect the goals of a survey to the scan configuration.

    Parameters
    ----------
    scene : Scene
    survey : Survey
    seed : int
    progress : Progress, optional
        Counts frames as they are reached, and at the end those that are not.
    """
    progress = progress or Progress("", quiet=True)
    # Most frames are reached soon, some late and some never.
    progress.begin(len(np.unique(survey.frame)), even=False)
    try:
        connection = connect(
            scene.scan_configuration,
            survey.roadmap_goals,
            scene.motions,
            scene.loaded.cell.roadmap,
            seed=seed,
            on_frame=lambda: progress.add(1, 1),
        )
        progress.add_rest()
    finally:
        progress.end()
    return connection


def results_of_connection(survey: Survey, connection: Connection) -> FrameResults:
    """Results of all frames of a survey.

    A frame's goal is its connected configuration with the shortest path; its
    attempts are those of the components that its goals lie in.
    """
    frames, dof = len(survey.status), survey.way.shape[1]
    paths = connection.roadmap.shortest_paths()
    node = connection.roadmap.shortest_to_goals(paths)
    length = paths.length_rad[node]
    best = _best_goal(survey.frame, length, frames)
    found = best >= 0
    status = survey.status.copy()
    status[status == Status.NOT_ATTEMPTED] = Status.NO_PATH_FOUND
    status[found] = Status.PATH_FOUND
    path_length = np.full(frames, np.nan)
    path_length[found] = length[best[found]]
    configuration = np.full((frames, dof), np.nan)
    configuration[found] = paths.configurations[node[best[found]]]
    component = _component_of_frames(survey.frame, connection, best, frames)
    attempts = np.zeros(frames, np.int64)
    known = connection.component >= 0
    np.add.at(
        attempts,
        *_distinct(
            survey.frame[known], connection.component[known], connection.attempts
        ),
    )
    return FrameResults(
        status=status,
        blocking_pair=survey.blocking_pair,
        n_ik=survey.n_ik,
        n_ik_free=survey.n_ik_free,
        attempts=np.minimum(attempts, MAX_COUNT).astype(np.uint8),
        paths_found=found.astype(np.uint8),
        component=component,
        path_length=path_length,
        goal_configuration=configuration,
    )


def _best_goal(frame: IntArray, length: FloatArray, frames: int) -> IntArray:
    """Goal with the shortest path of each frame, -1 without a connected one."""
    best = np.full(frames, -1, np.int64)
    # The last write wins, so the shortest goes last.
    order = np.argsort(-length, kind="stable")
    order = order[np.isfinite(length[order])]
    best[frame[order]] = order
    return best


def _component_of_frames(
    frame: IntArray, connection: Connection, best: IntArray, frames: int
) -> IntArray:
    """Component of the best goal, or of any goal where none is connected."""
    component = np.full(frames, -1, np.int64)
    known = connection.component >= 0
    component[frame[known][::-1]] = connection.component[known][::-1]
    found = best >= 0
    component[found] = connection.component[best[found]]
    return component


def _distinct(
    frame: IntArray, component: IntArray, attempts: Sequence[int] | IntArray
) -> tuple[IntArray, IntArray]:
    """Frames and the attempts of each different component they touch."""
    pairs = np.unique(np.stack([frame, component], axis=1), axis=0)
    return pairs[:, 0], np.asarray(attempts)[pairs[:, 1]]


def components_of(connection: Connection) -> Components:
    """Evidence of a connection as artefacts keep it."""
    checks, reached = connection.checks.sum(axis=1), connection.reached.astype(np.uint8)
    return Components(
        attempts=connection.attempts,
        checks=checks,
        reached=reached,
        agreed=connection.agreed.astype(np.uint8),
        method_checks=connection.checks,
        methods=connection.methods,
        confidence=confidence_of(checks, reached),
    )


def component_of_frames(survey: Survey, connection: Connection) -> IntArray:
    """Component of each frame of a survey, shape (frames,).

    That of its goal with the shortest path, or of any goal where none is connected;
    -1 without goals.
    """
    groups = max(len(survey.status), int(survey.frame.max(initial=-1)) + 1)
    paths = connection.roadmap.shortest_paths()
    length = paths.length_rad[connection.roadmap.shortest_to_goals(paths)]
    best = _best_goal(survey.frame, length, groups)
    of_groups = _component_of_frames(survey.frame, connection, best, groups)
    return np.asarray(survey.by_frame(of_groups))
