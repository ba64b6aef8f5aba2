"""Free rolls: test grasps that differ by a free roll share their goals."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.robot import FREE, ToolSpec
from reachmap.core.kinematics.windings import TURN_RAD
from reachmap.geometry import AXES, axis_turns
from reachmap.maps.records import NO_PAIR, Status
from reachmap.maps.summary.directions import same_direction
from reachmap.sampling.frames import FrameGrid
from reachmap.scans.ik_survey import MAX_COUNT, Survey

# Rounding of rolls that are meant to be equal.
_SAME_ROLL_RAD = 1e-6
AT_ONCE = 4
"""Rolls that are solved at once for directions that have nothing yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RollGroups:
    """Groups of test grasps that differ by a free roll.

    Attributes
    ----------
    group : int array, shape (frames,)
    roll : array, shape (frames,)
        About the approach axis, from the first frame of each group [rad].
    T : array, shape (groups, 4, 4)
        T_base_tcp of the first frame of each group.
    turns : array, shape (rolls,)
        Rolls that will do, in the order in which they are tried [rad].
    """

    group: IntArray
    roll: FloatArray
    T: FloatArray
    turns: FloatArray

    @classmethod
    def of(cls, grid: FrameGrid, axis: str, tool: ToolSpec) -> RollGroups:
        """Group the test grasps of a grid.

        Parameters
        ----------
        grid : FrameGrid
        axis : str
            TCP axis that points into the object.
        tool : ToolSpec
        """
        direction = same_direction(grid.quaternion_wxyz, axis)
        first = np.array([np.argmax(direction == d) for d in direction])
        roll = np.array(
            [
                _roll_between(grid.orientations[f], R, axis)
                for f, R in zip(first, grid.orientations, strict=True)
            ]
        )
        alike = direction[:, None] == direction
        if tool.roll != FREE:
            period = TURN_RAD / tool.count()
            apart = roll[:, None] - roll
            apart -= period * np.round(apart / period)
            alike &= np.abs(apart) < _SAME_ROLL_RAD
        leaders, member = np.unique(alike.argmax(axis=1), return_inverse=True)
        points = int(np.prod(grid.shape[:-1]))
        group = np.arange(points)[:, None] * len(leaders) + member
        frames = (np.arange(points)[:, None] * grid.shape[-1] + leaders).ravel()
        return cls(
            group=group.ravel(),
            roll=np.tile(roll - roll[leaders[member]], points),
            T=grid.transforms_at(frames),
            turns=_turns(tool),
        )

    @classmethod
    def apart(cls, T: FloatArray, tool: ToolSpec) -> RollGroups:
        """Test grasps (n, 4, 4) of which no two differ by a roll alone."""
        return cls(
            group=np.arange(len(T)),
            roll=np.zeros(len(T)),
            T=T,
            turns=_turns(tool),
        )

    def turned(self, groups: IntArray, turns: FloatArray, axis: str) -> FloatArray:
        """Poses of groups at some rolls, shape (groups · rolls, 4, 4)."""
        T = self.T[groups][:, None] @ axis_turns(axis, turns)
        return np.asarray(T.reshape(-1, 4, 4))

    def share_goals(self, survey: Survey) -> Survey:
        """Let the frames of each group share their goals."""
        group, roll = self.group[survey.frame], self.roll[survey.frame]
        return _with_goals(survey, self, group, roll, survey.ways())

    def measured(self, survey: Survey, axis: str, T_goal: FloatArray) -> Survey:
        """Take the rolls of goals from their poses.

        Parameters
        ----------
        survey : Survey
            Whose groups share their goals.
        axis : str
            TCP axis that points into the object.
        T_goal : array, shape (goals, 4, 4)
            T_base_tcp of each goal at its grasp.
        """
        of_groups = self.T[survey.frame]
        roll = [
            _roll_between(R_first, R_goal, axis)
            for R_first, R_goal in zip(
                of_groups[:, :3, :3], T_goal[:, :3, :3], strict=True
            )
        ]
        return dataclasses.replace(survey, roll=np.array(roll, float))

    def add_rolls(
        self,
        survey: Survey,
        wanted: IntArray,
        axis: str,
        solve: Callable[[FloatArray], Survey],
        *,
        until_found: bool,
    ) -> Survey:
        """Add the goals of rolls that are not listed.

        Parameters
        ----------
        survey : Survey
            Whose groups share their goals.
        wanted : int array
            Groups to add goals to.
        axis : str
            TCP axis that points into the object.
        solve : callable
            Surveys poses (n, 4, 4).
        until_found : bool
            Leave a group alone as soon as it has a goal.
        """
        step = AT_ONCE if until_found else len(self.turns)
        for begin in range(0, len(self.turns), step):
            if not len(wanted):
                break
            turns = self.turns[begin : begin + step]
            found = solve(self.turned(wanted, turns, axis))
            member, turn = np.divmod(found.frame, len(turns))
            survey = self.with_more(survey, wanted[member], turns[turn], found.ways())
            if until_found:
                wanted = wanted[~np.isin(wanted, survey.frame)]
        return survey

    def with_more(
        self, survey: Survey, group: IntArray, roll: FloatArray, ways: list[FloatArray]
    ) -> Survey:
        """Add goals, given by group, roll [rad] and approach, behind their group's."""
        assert survey.roll is not None
        return _with_goals(
            survey,
            self,
            np.concatenate([survey.frame, group]),
            np.concatenate([survey.roll, roll]),
            [*survey.ways(), *ways],
        )


def places_among(frame: IntArray, more: IntArray) -> IntArray:
    """Where goals are after others were added behind those of their frames."""
    number = np.arange(len(frame)) - np.searchsorted(frame, frame)
    return np.asarray(np.searchsorted(more, frame) + number)


def _with_goals(
    survey: Survey,
    groups: RollGroups,
    group: IntArray,
    roll: FloatArray,
    ways: list[FloatArray],
) -> Survey:
    """A survey with other goals, which count for every frame of their group."""
    goals = np.bincount(group, minlength=len(groups.T))[groups.group]
    n_free = np.maximum(survey.n_ik_free, np.minimum(goals, MAX_COUNT))
    return survey.with_goals(
        group,
        roll,
        ways,
        status=np.where(goals, Status.NOT_ATTEMPTED, survey.status).astype(np.uint8),
        blocking_pair=np.where(goals, NO_PAIR, survey.blocking_pair),
        n_ik=np.maximum(survey.n_ik, n_free).astype(np.uint8),
        n_ik_free=n_free.astype(np.uint8),
        group=groups.group,
        frame_roll=groups.roll,
    )


def _roll_between(R_from: FloatArray, R_to: FloatArray, axis: str) -> float:
    """Angle about the approach axis from one orientation to another [rad]."""
    column, sign = AXES[axis]
    R = R_from.T @ R_to
    after, last = (column + 1) % 3, (column + 2) % 3
    return sign * float(np.arctan2(R[last, after], R[after, after]))


def _turns(tool: ToolSpec) -> FloatArray:
    """Equivalent rolls besides the first, each far from those before it [rad]."""
    return _halving(tool.count()).astype(float) * TURN_RAD / tool.count()


def _halving(count: int) -> IntArray:
    """Numbers 1 … count − 1, each far from those before it."""
    bits = max(1, int(np.ceil(np.log2(count))))
    order = [int(f"{k:0{bits}b}"[::-1], 2) for k in range(2**bits)]
    return np.array([k for k in order if 0 < k < count], np.int64)
