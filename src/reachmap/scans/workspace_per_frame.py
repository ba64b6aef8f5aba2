"""Workspace scan as the paper did it: a plan from scratch to each frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.kinematics.windings import Windings
from reachmap.core.planning.timing import path_length_rad
from reachmap.core.scene import Scene
from reachmap.maps import Status
from reachmap.runtime.job import Job, Work, blocks
from reachmap.sampling.frames import workspace_frames
from reachmap.scans.document import journal_settings, tally
from reachmap.scans.ik_survey import survey_frames
from reachmap.scans.measured import attempt_seed
from reachmap.scans.workspace_results import KIND, FrameResults, frames_of_cell

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

# Few, as planning to one frame may take its whole budget.
FRAMES_PER_UNIT = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class PerFrameContext:
    """What a worker needs; frames are numbered through the cubes."""

    loaded: LoadedCell
    with_bin: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _State:
    scene: Scene
    poses: FloatArray


def per_frame_work(
    loaded: LoadedCell, document: Mapping[str, Any], *, with_bin: bool
) -> Work:
    """Work of a scan that plans to each frame."""
    frames = frames_of_cell(loaded.cell)
    job = Job(
        function=plan_unit,
        prepare=prepare,
        context=PerFrameContext(loaded=loaded, with_bin=with_bin),
        tally=tally,
    )
    return Work(
        kind=KIND,
        units=blocks(frames, FRAMES_PER_UNIT),
        job=lambda stages: job,
        settings=journal_settings(document),
        document={**document, "frames_per_unit": FRAMES_PER_UNIT},
        frames=frames,
    )


def prepare(context: PerFrameContext) -> _State:
    """Build scene and frames, once per worker."""
    cell = context.loaded.cell
    cubes = workspace_frames(cell)
    return _State(
        scene=Scene.shared(context.loaded, with_bin=context.with_bin),
        poses=np.concatenate([c.frames.transforms().reshape(-1, 4, 4) for c in cubes]),
    )


def plan_unit(state: _State, frames: range) -> dict[str, Any]:
    """Plan to the frames of one unit."""
    results = plan_frames(state.scene, state.poses[frames], frames)
    return dataclasses.asdict(results)


def plan_frames(
    scene: Scene, T_base_tcp: FloatArray, numbers: Sequence[int]
) -> FrameResults:
    """Plan to frames, each up to ``repeats`` times and until the first success.

    Parameters
    ----------
    scene : Scene
    T_base_tcp : array, shape (n, 4, 4)
    numbers : sequence of int
        Number of each frame in the scan, which with the cell's seed makes its own.
    """
    cell = scene.loaded.cell
    survey = survey_frames(scene, T_base_tcp, 0.0)
    count, dof = len(T_base_tcp), scene.robot.dof
    windings = Windings(scene.robot)
    status = survey.status.copy()
    attempts, found = np.zeros(count, np.uint8), np.zeros(count, np.uint8)
    length, goal = np.full(count, np.nan), np.full((count, dof), np.nan)
    for k in np.flatnonzero(status == Status.NOT_ATTEMPTED).tolist():
        goals, _ = survey.goals_near(
            survey.goals_of(k), scene.scan_configuration, windings
        )
        status[k] = Status.NO_PATH_FOUND
        for repeat in range(cell.workspace_scan.repeats):
            attempts[k] += 1
            seed = attempt_seed(cell.seed, numbers[k], repeat)
            plan = scene.planner.plan(scene.scan_configuration, goals, seed)
            if plan.path is not None:
                status[k], found[k] = Status.PATH_FOUND, 1
                length[k], goal[k] = path_length_rad(plan.path), goals[plan.goal]
                break
    return FrameResults(
        status=status,
        blocking_pair=survey.blocking_pair,
        n_ik=survey.n_ik,
        n_ik_free=survey.n_ik_free,
        attempts=attempts,
        paths_found=found,
        component=np.full(count, -1, np.int64),
        path_length=length,
        goal_configuration=goal,
    )
