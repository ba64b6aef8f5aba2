"""Where the roll is free: rolls at which a whole cycle is quicker than as listed.

The roll that a test grasp is listed with is arbitrary, and may take the wrist half-way
round and back. For every roll and branch of the kinematics there is a lower bound on
the time of a cycle; a few configurations with the least bounds get a straight approach
and a lift, and are goals of the cycle beside those at hand.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.planning.approach import StraightApproach
from reachmap.core.planning.lift import Lift, Lifts
from reachmap.geometry import axis_vector
from reachmap.maps.parts import StageStatus
from reachmap.runtime.job import Job, Stages, blocks
from reachmap.sampling.frames import approach_distance_m
from reachmap.scans.cycle.lifts import LiftSurvey, lift_payload
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.cycle.ways import Ways
from reachmap.scans.rolls import RollGroups

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.scans.ik_survey import Survey

# A choice: large enough for batches, small enough that workers end together.
GROUPS_PER_UNIT = 100
# A roll is tried where it promises to save a twentieth of the motion. Two goals of each
# grasp are kept, should one have no way in; the search ends after this many tries.
_WORTH, _KEPT, _MOST_TRIES = 0.95, 2, 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuickerContext:
    """What a worker needs.

    Attributes
    ----------
    loaded : LoadedCell
    body_pairs : tuple of str
    T : array, shape (groups, rolls, 4, 4)
        T_base_tcp of some groups at all rolls but the listed one.
    most_s : array, shape (groups,)
        Time that a cycle must promise to stay below [s].
    before, after : array, shape (places, dof)
        Where transfers end and ways back begin.
    """

    loaded: LoadedCell
    body_pairs: tuple[str, ...]
    T: FloatArray
    most_s: FloatArray
    before: FloatArray
    after: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuickerGoals:
    """Goals that promise quicker cycles, all of them with a lift.

    Attributes
    ----------
    group : int array, shape (goals,)
        Rising.
    roll : array, shape (goals,)
        [rad].
    approaches : Ways
    lifts : LiftSurvey
    """

    group: IntArray
    roll: FloatArray
    approaches: Ways
    lifts: LiftSurvey


def quicker_goals(
    scenes: CycleScenes,
    groups: RollGroups,
    survey: Survey,
    reached: IntArray,
    placing: Sequence[tuple[FloatArray, FloatArray]],
    body_pairs: tuple[str, ...],
    stages: Stages,
) -> QuickerGoals | None:
    """Look for rolls that promise quicker cycles; None where there is nothing to gain.

    Parameters
    ----------
    scenes : CycleScenes
    groups : RollGroups
    survey : Survey
        Whose groups share their goals.
    reached : int array
        Groups with a way in.
    placing : sequence of (array, array)
        Ways in and out of the drop-offs.
    body_pairs : tuple of str
    stages : Stages
    """
    if not placing or not len(reached) or not len(groups.turns):
        return None
    loaded, dof = scenes.empty.loaded, scenes.empty.robot.dof
    axis = loaded.cell.robot.tcp.approach_axis
    before = np.array([way[0] for way, _ in placing])
    after = np.array([retreat[-1] for _, retreat in placing])
    own_s = np.full(len(groups.T), np.inf)
    own_cycles_s = least_cycles_s(scenes, survey.grasps, before, after)
    np.minimum.at(own_s, survey.frame, own_cycles_s)
    T = groups.turned(reached, groups.turns, axis)
    context = QuickerContext(
        loaded=loaded,
        body_pairs=body_pairs,
        T=T.reshape(len(reached), -1, 4, 4),
        most_s=_WORTH * own_s[reached],
        before=before,
        after=after,
    )
    payloads = stages.run(
        "quicker_rolls",
        Job(function=quicker_unit, prepare=prepare, context=context),
        [(part.start, part.stop) for part in blocks(len(reached), GROUPS_PER_UNIT)],
    )
    turn = np.concatenate([payload["turn"] for payload in payloads])
    if not len(turn):
        return None
    return QuickerGoals(
        group=reached[np.concatenate([payload["group"] for payload in payloads])],
        roll=groups.turns[turn],
        approaches=Ways.join([payload["approaches"] for payload in payloads], dof),
        lifts=LiftSurvey.join([payload["lifts"] for payload in payloads], dof),
    )


def least_cycles_s(
    scenes: CycleScenes, Q: FloatArray, before: FloatArray, after: FloatArray
) -> FloatArray:
    """Nearly lower bounds on times of cycles over grasps (n, dof), shape (n,) [s].

    From the scan configuration to the grasp, on to where the part is put down, and
    back: each joint has to make its motion. Approach, lift and waits are left out,
    which differ little from roll to roll.
    """
    start = scenes.empty.scan_configuration
    rest_s = scenes.least_times_s(start, after)
    there_s = np.full(len(Q), np.inf)
    for q, back_s in zip(before, rest_s, strict=True):
        np.minimum(there_s, scenes.least_times_s(q, Q) + back_s, out=there_s)
    return np.asarray(scenes.least_times_s(start, Q) + there_s)


class _Worker:
    """Finds goals of one block of groups after the other."""

    def __init__(self, context: QuickerContext) -> None:
        scenes = CycleScenes.of(context.loaded)
        assert scenes is not None
        self.context, self._scenes = context, scenes
        self._lifts = Lifts(scenes.lifted, scenes.carried, scenes.part)
        cell, scene = context.loaded.cell, scenes.empty
        self._approach = StraightApproach(
            scene.kinematics,
            scene.motions,
            axis_vector(cell.robot.tcp.approach_axis),
            approach_distance_m(cell),
        )

    def goals_of(self, groups: range) -> list[tuple[int, int, FloatArray, Lift]]:
        """Group, turn, approach and lift of what is found."""
        context, scene = self.context, self._scenes.empty
        T = context.T[groups.start : groups.stop]
        rolls, poses = T.shape[1], T.reshape(-1, 4, 4)
        Q, pose = scene.kinematics.solve_many(
            poses, windings=False, near=scene.scan_configuration
        )
        least_s = least_cycles_s(self._scenes, Q, context.before, context.after)
        group, turn = np.divmod(pose, rolls)
        worth = least_s < context.most_s[groups.start + group]
        found = []
        for k in np.unique(group[worth]):
            rows = np.flatnonzero(worth & (group == k))
            rows = rows[np.argsort(least_s[rows], kind="stable")]
            free = rows[scene.checker.free_mask(Q[rows])][:_MOST_TRIES]
            made = 0
            for row in free.tolist():
                goal = self._goal(poses[pose[row]], Q[row])
                if goal is not None:
                    found.append((groups.start + int(k), int(turn[row]), *goal))
                    made += 1
                if made == _KEPT:
                    break
        return found

    def _goal(self, T: FloatArray, q: FloatArray) -> tuple[FloatArray, Lift] | None:
        """Approach to a configuration and lift from it; None without both."""
        way = self._approach.of(T, q)
        way = None if way is None else self._approach.free_and_straight(way)
        if way is None:
            return None
        lift = self._lifts.of(way[-1])
        return (way, lift) if lift.status == StageStatus.PATH_FOUND else None


def prepare(context: QuickerContext) -> _Worker:
    """Build the scenes, once per worker."""
    return _Worker(context)


def quicker_unit(worker: _Worker, block: tuple[int, int]) -> dict[str, Any]:
    """Find goals of one block of groups."""
    context = worker.context
    found = worker.goals_of(range(*block))
    dof = context.before.shape[1]
    approaches = Ways.of([way for *_, way, _ in found], dof)
    return {
        "group": np.array([entry[0] for entry in found], np.int64),
        "turn": np.array([entry[1] for entry in found], np.int64),
        "approaches": dataclasses.asdict(approaches),
        "lifts": lift_payload([lift for *_, lift in found], context.body_pairs, dof),
    }
