"""The goals of every test frame, or the reason why it has none."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.core.kinematics.windings import TURN_RAD, Windings
from reachmap.core.planning.approach import StraightApproach
from reachmap.core.planning.roadmap import Goals
from reachmap.core.scene import Scene
from reachmap.geometry import axis_vector
from reachmap.maps.parts import freeze
from reachmap.maps.records import NO_PAIR, Status
from reachmap.runtime.job import Job, Stages
from reachmap.sampling.frames import FrameGrid, FrameList

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

# What a byte of the map holds; more solutions are counted as this many.
MAX_COUNT = 255
TURNS_TRIED = 4
"""Turns of one solution that a plan is given at once."""


@dataclass(frozen=True, kw_only=True)  # no slots: it keeps what it computes
class Survey:
    """Goals of many test frames.

    Attributes
    ----------
    status : uint8 array, shape (frames,)
        NO_IK, IK_IN_COLLISION or APPROACH_BLOCKED; NOT_ATTEMPTED where there are goals.
    blocking_pair : int array, shape (frames,)
        Index into the checker's ``body_pairs``, -1 where there is none.
    n_ik, n_ik_free : uint8 array, shape (frames,)
        Different solutions, and those free of collision.
    frame : int array, shape (goals,)
        Frame of each goal, rising.
    way : array, shape (points, dof)
        Approaches, one after another, each from pre-grasp to grasp [rad]; a single
        point where there is no approach.
    way_size : int array, shape (goals,)
        Points of each.
    group : int array, shape (frames,), or None
        Where the roll is free, frames that differ by roll share their goals: the
        group of each frame; ``frame`` then counts groups.
    roll, frame_roll : array, shape (goals,), (frames,), or None
        Roll of each goal and of each frame about the approach axis, within its group
        [rad].
    """

    status: CodeArray
    blocking_pair: IntArray
    n_ik: CodeArray
    n_ik_free: CodeArray
    frame: IntArray
    way: FloatArray
    way_size: IntArray
    group: IntArray | None = None
    roll: FloatArray | None = None
    frame_roll: FloatArray | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @cached_property
    def way_begin(self) -> IntArray:
        """Row of ``way`` at which each approach begins, shape (goals,)."""
        return np.asarray(np.cumsum(self.way_size) - self.way_size)

    @cached_property
    def goals(self) -> FloatArray:
        """Where plans end: pre-grasp configurations, shape (goals, dof)."""
        return self.way[self.way_begin]

    @cached_property
    def grasps(self) -> FloatArray:
        """Where approaches end: configurations at the frames, shape (goals, dof)."""
        return np.asarray(self.way[self.way_begin + self.way_size - 1])

    @cached_property
    def roadmap_goals(self) -> Goals:
        """Goals of a roadmap, with the room that their approaches need."""
        Q = self.goals
        if not len(Q):
            return Goals.of(Q, self.frame)
        return Goals(
            Q=Q,
            frame=self.frame,
            low=np.minimum.reduceat(self.way, self.way_begin),
            high=np.maximum.reduceat(self.way, self.way_begin),
        )

    def ways(self) -> list[FloatArray]:
        """Approach of each goal; see :meth:`way_of`."""
        return [self.way_of(goal) for goal in range(len(self.frame))]

    def with_goals(
        self,
        frame: IntArray,
        roll: FloatArray,
        ways: Sequence[FloatArray],
        **others: Any,
    ) -> Survey:
        """Put other goals, in any order, in place of its own.

        Parameters
        ----------
        frame : int array, shape (goals,)
            Frame, or group of frames, of each.
        roll : array, shape (goals,)
        ways : sequence of array, shape (n, dof)
            Approach of each.
        **others
            Other fields that change.
        """
        order = np.argsort(frame, kind="stable")
        dof = self.way.shape[1]
        return dataclasses.replace(
            self,
            frame=frame[order],
            roll=roll[order],
            way=np.vstack([np.zeros((0, dof)), *(ways[k] for k in order)]),
            way_size=np.array([len(ways[k]) for k in order], np.int64),
            **others,
        )

    def payload(self) -> dict[str, Any]:
        """Its JSON payload for the journal."""
        return {
            f.name: value
            for f in dataclasses.fields(self)
            if (value := getattr(self, f.name)) is not None
        }

    def goals_of(self, frame: int) -> IntArray:
        """Rows of the goals of one frame."""
        return self.goals_of_group(
            frame if self.group is None else int(self.group[frame])
        )

    def goals_of_group(self, frame: int) -> IntArray:
        """Rows of the goals of what ``frame`` counts: frames, or groups of them."""
        low, high = np.searchsorted(self.frame, [frame, frame + 1])
        return np.arange(low, high)

    def way_of(self, goal: int) -> FloatArray:
        """Approach of one goal, shape (n, dof)."""
        begin = int(self.way_begin[goal])
        return self.way[begin : begin + int(self.way_size[goal])]

    def way_from(self, goal: int, q: FloatArray) -> FloatArray:
        """Approach of one goal from its pre-grasp at whatever turns, shape (n, dof)."""
        way = self.way_of(goal)
        return np.asarray(way + TURN_RAD * np.round((q - way[0]) / TURN_RAD))

    def roll_of(self, frame: int, goal: int) -> float:
        """By how much the tool is turned at a goal, relative to its frame [rad]."""
        if self.roll is None or self.frame_roll is None:
            return 0.0
        turn = float(self.roll[goal] - self.frame_roll[frame])
        return turn - TURN_RAD * round(turn / TURN_RAD)

    def by_frame(self, values: Any) -> Any:
        """Spread values of what ``frame`` counts over the frames."""
        return values if self.group is None else values[self.group]

    def goals_near(
        self, rows: IntArray, q: FloatArray, windings: Windings
    ) -> tuple[FloatArray, IntArray]:
        """Goals as a planner is to see them: with a few turns, the nearest first.

        Parameters
        ----------
        rows : int array, shape (n,)
        q : array, shape (dof,)
            Where plans begin.
        windings : Windings

        Returns
        -------
        Q : array, shape (m, dof)
        row : int array, shape (m,)
            Goal that each of them is.
        """
        every = self.roadmap_goals
        row, turns = windings.spread(
            every.Q[rows], q, every.low[rows], every.high[rows], each=TURNS_TRIED
        )
        return every.Q[rows[row]] + TURN_RAD * turns, rows[row]


def survey_frames(scene: Scene, T_base_tcp: FloatArray, approach_m: float) -> Survey:
    """Solve and check test frames.

    Parameters
    ----------
    scene : Scene
    T_base_tcp : array, shape (n, 4, 4)
    approach_m : float
        Length of the straight approach, 0 for none.
    """
    return _Surveyor(scene, T_base_tcp, approach_m).survey()


def join_surveys(surveys: Sequence[Survey]) -> Survey:
    """Put surveys of consecutive frames together."""
    offsets = np.cumsum([0, *(len(s.status) for s in surveys[:-1])])

    def joined(name: str) -> FloatArray:
        return np.concatenate([getattr(s, name) for s in surveys])

    return Survey(
        status=joined("status").astype(np.uint8),
        blocking_pair=joined("blocking_pair").astype(np.int64),
        n_ik=joined("n_ik").astype(np.uint8),
        n_ik_free=joined("n_ik_free").astype(np.uint8),
        frame=np.concatenate(
            [s.frame + offset for s, offset in zip(surveys, offsets, strict=True)]
        ),
        way=joined("way"),
        way_size=joined("way_size").astype(np.int64),
    )


class _Surveyor:
    def __init__(self, scene: Scene, T_base_tcp: FloatArray, approach_m: float) -> None:
        self._scene, self._T, self._approach_m = scene, T_base_tcp, approach_m
        self._windings = Windings(scene.robot)
        count = len(T_base_tcp)
        self._status = np.full(count, Status.NO_IK, np.uint8)
        self._pair = np.full(count, NO_PAIR, np.int64)

    @cached_property
    def _approach(self) -> StraightApproach:
        scene = self._scene
        axis = axis_vector(scene.loaded.cell.robot.tcp.approach_axis)
        return StraightApproach(scene.kinematics, scene.motions, axis, self._approach_m)

    def survey(self) -> Survey:
        """Solve all frames, then look at each frame's configurations."""
        count = len(self._T)
        Q, frame = self._scene.kinematics.solve_many(
            self._T, windings=False, near=self._scene.scan_configuration
        )
        free = self._scene.checker.free_mask(Q)
        n_ik = np.bincount(frame, minlength=count)
        n_free = np.bincount(frame[free], minlength=count)
        ways: list[FloatArray] = []
        owners: list[int] = []
        bounds = np.searchsorted(frame, np.arange(count + 1))
        for k in np.flatnonzero(n_ik):
            rows = slice(bounds[k], bounds[k + 1])
            found = self._goals_of(int(k), Q[rows], free[rows])
            ways += found
            owners += [int(k)] * len(found)
        dof = self._scene.robot.dof
        return Survey(
            status=self._status,
            blocking_pair=self._pair,
            n_ik=np.minimum(n_ik, MAX_COUNT).astype(np.uint8),
            n_ik_free=np.minimum(n_free, MAX_COUNT).astype(np.uint8),
            frame=np.array(owners, np.int64),
            way=np.vstack(ways) if ways else np.zeros((0, dof)),
            way_size=np.array([len(way) for way in ways], np.int64),
        )

    def _goals_of(self, k: int, Q: FloatArray, free: BoolArray) -> list[FloatArray]:
        """Approaches that a planner may aim at; none means a status with a cause."""
        if not free.any():
            self._status[k] = Status.IK_IN_COLLISION
            self._pair[k] = self._scene.checker.blocking_pair_of_many(Q)
            return []
        if self._approach_m == 0:
            self._status[k] = Status.NOT_ATTEMPTED
            return [q[None] for q in Q[free]]
        ways = [w for q in Q[free] if (w := self._way(self._pose(k, q), q)) is not None]
        found = [
            straight
            for way in ways
            if (straight := self._approach.free_and_straight(way)) is not None
        ]
        self._status[k] = Status.NOT_ATTEMPTED if found else Status.APPROACH_BLOCKED
        if not found:
            self._pair[k] = next(
                (p for way in ways if (p := self._approach.blocking_pair(way)) >= 0),
                NO_PAIR,
            )
        return found

    def _pose(self, k: int, q: FloatArray) -> FloatArray:
        """The pose of a frame as a configuration meets it, shape (4, 4)."""
        kinematics = self._scene.kinematics
        return kinematics.forward(q) if kinematics.any_roll else self._T[k]

    def _way(self, T_base_tcp: FloatArray, q: FloatArray) -> FloatArray | None:
        """Approach of a branch, at other turns where these end at a limit."""
        way = self._approach.of(T_base_tcp, q)
        if way is None and self._windings.exist:
            nearest = self._windings.in_order(q, self._scene.scan_configuration, q, q)
            for _, turns in islice(nearest, 1, TURNS_TRIED):
                way = self._approach.of(T_base_tcp, q + TURN_RAD * np.array(turns))
                if way is not None:
                    break
        return way


# Large enough to be solved in batches, small enough that workers end together.
FRAMES_PER_UNIT = 270


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyContext:
    """What a worker needs for a survey; frames are numbered through the grids."""

    loaded: LoadedCell
    with_bin: bool
    grids: tuple[FrameGrid | FrameList, ...]
    approach_m: float

    def blocks(self) -> list[tuple[int, slice]]:
        """Grid and range of frames of each unit."""
        return [
            (k, slice(start, min(start + FRAMES_PER_UNIT, grid.size)))
            for k, grid in enumerate(self.grids)
            for start in range(0, grid.size, FRAMES_PER_UNIT)
        ]


def survey_in_stages(
    context: SurveyContext, stages: Stages, phase: str = "survey"
) -> Survey:
    """Survey all frames; the result does not depend on the number of workers."""
    frames = sum(grid.size for grid in context.grids)
    payloads = stages.run(
        phase,
        Job(function=survey_unit, prepare=prepare_survey, context=context),
        context.blocks(),
        most=max(1, math.ceil(frames / (4 * FRAMES_PER_UNIT))),
    )
    return join_surveys([Survey(**payload) for payload in payloads])


def prepare_survey(context: SurveyContext) -> tuple[SurveyContext, Scene]:
    """Build the scene, once per worker."""
    return context, Scene.shared(context.loaded, with_bin=context.with_bin)


def survey_unit(
    state: tuple[SurveyContext, Scene], block: tuple[int, slice]
) -> dict[str, Any]:
    """Survey one block of frames."""
    context, scene = state
    T = context.grids[block[0]].transforms_at(block[1])
    return survey_frames(scene, T, context.approach_m).payload()
