"""Planning to grasps: all branches, every roll, the bin in the scene."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.core.kinematics.windings import Windings
from reachmap.core.planning.planner import PlanResult
from reachmap.core.scene import Scene
from reachmap.geometry import inverse_transform
from reachmap.maps.parts import freeze
from reachmap.maps.records import NO_PAIR, Status
from reachmap.runtime.job import Job
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress
from reachmap.runtime.run import run
from reachmap.sampling.frames import approach_distance_m
from reachmap.scans.ik_survey import Survey, survey_frames
from reachmap.scans.measured import MEASURED, Meter, attempt_seed
from reachmap.validation.picks import Picks, tool_poses

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

FURTHEST = (Status.APPROACH_BLOCKED, Status.IK_IN_COLLISION, Status.NO_IK)
"""States without a goal; the one nearest to success is the cause of a failure."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PickContext:
    """What a worker needs: the cell with its bin, the grasps, how hard to try.

    Of a cell that is scanned at levels of filling, the bin is filled up to each grasp.
    ``body_pairs`` are those that blocking pairs are numbered in.
    """

    loaded: LoadedCell
    picks: Picks
    rolls: int
    repeats: int
    seed: int
    body_pairs: tuple[str, ...] = ()

    def cell_for(self, pick: int) -> LoadedCell:
        """The cell as a grasp finds it."""
        cell = self.loaded.cell
        if not cell.bin_scan.is_filled:
            return self.loaded
        T_bin_base = inverse_transform(cell.T_base_bin())
        height = T_bin_base[2, :3] @ self.picks.points[pick] + T_bin_base[2, 3]
        return self.loaded.filled_up_to(float(height))


@dataclass(frozen=True, slots=True, kw_only=True)
class PickResults:
    """Planning results. One row per grasp, r attempts each.

    Attributes
    ----------
    status : uint8 array, shape (n,)
        PATH_FOUND, NO_PATH_FOUND, or the state nearest to success of all tool poses.
    blocking_pair : int array, shape (n,)
        Index into the checker's ``body_pairs``, -1 where there is none.
    poses, poses_free : int array, shape (n,)
        Tool poses tried, and those with a free goal and a free approach.
    recommended_free : uint8 array, shape (n,)
        1 where the first, recommended tool pose is among the latter.
    found : uint8 array, shape (n, r)
    measured : array, shape (n, r, 7)
        In the order of :data:`reachmap.scans.measured.MEASURED`; NaN without path.
    pose : int array, shape (n, r)
        Tool pose that was reached, 0 for the recommended one, -1 without a path.
    checks : int array, shape (n, r)
        State checks spent on searching.
    hit_time_limit : uint8 array, shape (n, r)
        Whether the limit on wall-clock time struck.
    """

    status: CodeArray
    blocking_pair: IntArray
    poses: IntArray
    poses_free: IntArray
    recommended_free: CodeArray
    found: CodeArray
    measured: FloatArray
    pose: IntArray
    checks: IntArray
    hit_time_limit: CodeArray

    def __post_init__(self) -> None:
        freeze(self)

    def take(self, rows: slice) -> PickResults:
        """Results of some of the grasps."""
        return PickResults(
            **{name: getattr(self, name)[rows] for name in PickResults.__slots__}
        )


def plan_picks(
    context: PickContext, options: RunOptions, *, progress: Progress
) -> PickResults:
    """Plan to every grasp; verdicts do not depend on the number of workers."""
    job = Job(function=plan_unit, context=context)
    return joined_results(run(job, range(len(context.picks)), options, progress))


def joined_results(payloads: Sequence[dict[str, Any]]) -> PickResults:
    """Results of consecutive grasps, put together."""
    return PickResults(
        **{
            name: np.concatenate([payload[name] for payload in payloads])
            for name in PickResults.__slots__
        }
    )


def plan_unit(context: PickContext, pick: int) -> dict[str, Any]:
    """Plan to one grasp."""
    scene = Scene.shared(context.cell_for(pick), with_bin=True)
    survey = survey_of_pick(context, scene, pick)
    key = (context.seed, int(context.picks.number[pick]))
    results = plan_pick(scene, survey, key, context.repeats)
    number = {name: k for k, name in enumerate(context.body_pairs)}
    names = scene.checker.body_pairs
    pairs = [
        number.get(names[k], NO_PAIR) if k >= 0 else NO_PAIR
        for k in results.blocking_pair.tolist()
    ]
    return dataclasses.asdict(
        dataclasses.replace(results, blocking_pair=np.array(pairs))
    )


def survey_of_pick(context: PickContext, scene: Scene, pick: int) -> Survey:
    """Goals of the tool poses of one grasp, the recommended one first."""
    cell = scene.loaded.cell
    T = tool_poses(
        context.picks,
        pick,
        rolls=context.rolls,
        approach_axis=cell.robot.tcp.approach_axis,
    )
    return survey_frames(scene, T, approach_distance_m(cell))


def plan_pick(
    scene: Scene, survey: Survey, key: tuple[int, int], repeats: int
) -> PickResults:
    """Make all attempts at one grasp, as a picking loop would.

    An attempt plans to the recommended tool pose, as the map did to its test grasps.
    Where that fails, or the pose has no goal, it plans to all other poses at once.

    Parameters
    ----------
    scene : Scene
    survey : Survey
        Of its tool poses.
    key : (int, int)
        Seed, and number of the grasp.
    repeats : int

    Returns
    -------
    PickResults
        A single row.
    """
    meter = Meter(scene)
    measured = np.full((1, repeats, len(MEASURED)), np.nan)
    pose = np.full((1, repeats), -1)
    checks, hit_time_limit = np.zeros_like(pose), np.zeros(pose.shape, np.uint8)
    for k in range(repeats):
        plans = _attempt(scene, survey, (*key, k))
        checks[0, k] = sum(plan.checks for plan, _ in plans)
        hit_time_limit[0, k] = any(plan.hit_time_limit for plan, _ in plans)
        if plans and plans[-1][1] >= 0:
            measured[0, k] = _measure(meter, survey, plans)
            pose[0, k] = survey.frame[plans[-1][1]]
    status, pair = _verdict(survey, found=bool((pose >= 0).any()))
    free = np.unique(survey.frame)
    return PickResults(
        status=np.array([status], np.uint8),
        blocking_pair=np.array([pair]),
        poses=np.array([len(survey.status)]),
        poses_free=np.array([len(free)]),
        recommended_free=np.array([0 in free], np.uint8),
        found=(pose >= 0).astype(np.uint8),
        measured=measured,
        pose=pose,
        checks=checks,
        hit_time_limit=hit_time_limit,
    )


def _attempt(
    scene: Scene, survey: Survey, key: tuple[int, ...]
) -> list[tuple[PlanResult, int]]:
    """Plans of one attempt, each with the row of the goal it reached, or -1."""
    plans, windings = [], Windings(scene.robot)
    recommended = survey.goals_of(0)
    others = np.arange(len(recommended), len(survey.frame))
    for stage, rows in enumerate((recommended, others)):
        if not len(rows):
            continue
        goals, row = survey.goals_near(rows, scene.scan_configuration, windings)
        plan = scene.planner.plan(
            scene.scan_configuration, goals, attempt_seed(*key, stage)
        )
        plans.append((plan, int(row[plan.goal]) if plan.path is not None else -1))
        if plan.path is not None:
            break
    return plans


def _measure(
    meter: Meter, survey: Survey, plans: Sequence[tuple[PlanResult, int]]
) -> FloatArray:
    """Numbers of a successful attempt; the time of the plan that failed counts."""
    final, goal = plans[-1]
    assert final.path is not None
    way = survey.way_from(goal, final.path[-1])
    measured = np.array(meter.measured(final, way))
    for plan, _ in plans[:-1]:
        measured[MEASURED.index("planning_time")] += plan.planning_time_s
        measured[MEASURED.index("planning_cpu_time")] += plan.planning_cpu_time_s
    return measured


def _verdict(survey: Survey, *, found: bool) -> tuple[int, int]:
    """Status of a grasp, and the bodies in the way of most of its tool poses."""
    if found:
        return Status.PATH_FOUND, NO_PAIR
    if len(survey.frame):
        return Status.NO_PATH_FOUND, NO_PAIR
    status = next(s for s in FURTHEST if (survey.status == s).any())
    pairs = survey.blocking_pair[survey.status == status]
    pairs = pairs[pairs >= 0]
    return status, int(np.bincount(pairs).argmax()) if len(pairs) else NO_PAIR
