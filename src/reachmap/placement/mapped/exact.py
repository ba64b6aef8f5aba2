"""The exact score of a bin pose: roadmap to a sample of frames, bin in the scene.

What a score costs is mostly collision checks and straight approaches, so they are
looked at lazily: one free branch of each frame's inverse kinematics first, the others
only if the frame is not reached.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.planner import RoadmapSpec
from reachmap.core.planning.approach import StraightApproach
from reachmap.core.planning.connection import Connection, connect
from reachmap.core.planning.roadmap import Goals
from reachmap.core.scene import Scene
from reachmap.geometry import axis_vector, inverse_transform, yaw_transform
from reachmap.placement.mapped.sample import Sample, rolled, rolls_of
from reachmap.sampling.frames import approach_distance_m

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

# Hundreds of poses are compared: a plan has a quarter of the checks that it has for a
# map, and no second opinion.
SHARE_OF_CHECKS = 4
ALWAYS = -1.0
NEVER = 1000.0
ROUNDING = 1e-9
Pose = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseScore:
    """Score of one pose of the bin.

    Attributes
    ----------
    score : float
        Mean path reachability over the pick volume [percent].
    worst_point : float
        Path reachability of the worst of the points that were looked at [percent].
    reachable_share : float
        Share of test frames with an IK solution [percent], which no path can exceed.
    path_length_rad : float
        Mean over the frames with a path; infinite without any, NaN where the map was
        interpolated.
    error : float
        Standard error of the score, from the number of frames in the sample [points];
        NaN where the map was interpolated.
    """

    score: float
    worst_point: float
    reachable_share: float
    path_length_rad: float
    error: float = np.nan


def bin_at(cell: Cell, pose: Pose) -> FloatArray:
    """T_base_bin of a bin that stands upright at a pose, shape (4, 4).

    Parameters
    ----------
    cell : Cell
    pose : (x, y, z [m], yaw [rad])
        In the cell's level frame, see :meth:`Cell.T_base_level`.
    """
    return np.asarray(cell.T_base_level() @ yaw_transform(*pose))


def pose_of_bin(cell: Cell) -> Pose:
    """Where a cell has its bin, as a pose of :func:`bin_at`."""
    T_level_bin = inverse_transform(cell.T_base_level()) @ cell.T_base_bin()
    x, y, z = T_level_bin[:3, 3].tolist()
    return x, y, z, float(np.arctan2(T_level_bin[1, 0], T_level_bin[0, 0]))


class Placing(Protocol):
    """What is placed at a pose, and how to build its scene."""

    def cell_at(self, loaded: LoadedCell, pose: Pose) -> LoadedCell:
        """The cell at the pose; CellError where that is impossible."""

    def scene(self, loaded: LoadedCell) -> Scene:
        """A scene from which :meth:`at` derives others."""

    def at(self, scene: Scene, loaded: LoadedCell) -> Scene:
        """Scene of a cell of :meth:`cell_at`; invalidates ``scene``."""


@dataclass(frozen=True, slots=True)
class BinPlacing:
    """The pose is that of the bin in the level frame."""

    def cell_at(self, loaded: LoadedCell, pose: Pose) -> LoadedCell:
        """See :class:`Placing`."""
        return loaded.with_changes(bin_pose=bin_at(loaded.cell, pose))

    def scene(self, loaded: LoadedCell) -> Scene:
        """See :class:`Placing`."""
        return Scene.build(loaded, with_bin=True, bin_moves=True)

    def at(self, scene: Scene, loaded: LoadedCell) -> Scene:
        """See :class:`Placing`."""
        return scene.with_bin_of(loaded)


BIN_PLACING = BinPlacing()


class PlacedScene:
    """A cell with its bin, or its arm, at one pose, and the goals of its test frames.

    Parameters
    ----------
    scene : Scene
        Of the placing; must not be used by anybody else meanwhile.
    pose : (x, y, z [m], yaw [rad])
    sample : Sample
    placing : Placing

    Attributes
    ----------
    pose : (x, y, z [m], yaw [rad])
    scene : Scene
    T : array, shape (frames, 4, 4)
        T_base_tcp; where rolls do not matter, of the first roll.
    """

    def __init__(
        self,
        scene: Scene,
        pose: Pose,
        sample: Sample,
        placing: Placing = BIN_PLACING,
    ) -> None:
        changed = placing.cell_at(scene.loaded, pose)
        self.pose = pose
        self.scene = placing.at(scene, changed)
        cell = changed.cell
        self.T = self.scene.T_base_bin @ sample.T_bin_tcp
        self._rolled = rolled(cell, self.T).reshape(-1, 4, 4)
        self._sample = sample
        self._approach = StraightApproach(
            self.scene.kinematics,
            self.scene.motions,
            axis_vector(cell.robot.tcp.approach_axis),
            approach_distance_m(cell),
        )
        self._survey()
        self._first: _Goals | None = None
        self._known_motions: dict[bytes, bool] = {}

    def _survey(self) -> None:
        """Solve for all frames, and find the first free branch of each.

        Branches nearest to the cell's own scan configuration come first. Frames that
        the tool cannot take have no free branch, and none is looked for.
        """
        scene, rolls = self.scene, rolls_of(self.scene.loaded.cell)
        axis = scene.loaded.cell.robot.tcp.approach_axis
        Q, row = scene.kinematics.solve_rolls(
            self.T, axis, rolls, near=scene.scan_configuration
        )
        frame = row // len(rolls)
        self._has_ik = np.bincount(frame, minlength=len(self.T)) > 0
        away = np.round(np.linalg.norm(Q - scene.scan_configuration, axis=1), 9)
        order = np.lexsort((away, frame))
        self._Q, self._frame, self._row = Q[order], frame[order], row[order]
        bounds = np.searchsorted(self._frame, np.arange(len(self.T) + 1))
        self._end = bounds[1:]
        can = self._sample.weight > 0
        self._first_free = np.where(can, bounds[:-1], self._end)
        self._skip_blocked(self._first_free, np.flatnonzero(can))

    def _skip_blocked(self, rows: IntArray, frames: IntArray) -> None:
        """Move the rows of some frames on, each to its next free branch or its end."""
        is_free = self.scene.checker.is_free
        for frame in frames.tolist():
            row, end = int(rows[frame]), int(self._end[frame])
            while row < end and not is_free(self._Q[row]):
                row += 1
            rows[frame] = row

    @cached_property
    def grasps(self) -> tuple[FloatArray, IntArray]:
        """Free configurations of all frames, and the frame of each.

        Returns
        -------
        Q : array, shape (n, dof)
            [rad].
        frame : int array, shape (n,)
            Rising.
        """
        free = self.scene.checker.free_mask(self._Q)
        return self._Q[free], self._frame[free]

    @property
    def bound(self) -> float:
        """Upper bound of the score: weight of frames with a free configuration [%]."""
        return 100.0 * float(self._sample.weight @ (self._first_free < self._end))

    @property
    def reachable_share(self) -> float:
        """Share of test frames with an IK solution [percent]."""
        return 100.0 * float(self._sample.share @ self._has_ik)

    def score_from(
        self, q: FloatArray, *, above: float = ALWAYS, enough: float = NEVER
    ) -> tuple[float, PoseScore | None]:
        """Score the pose from a scan configuration.

        Parameters
        ----------
        q : array, shape (dof,)
            Free [rad].
        above : float
            The score is not wanted unless it may be above this [percent].
        enough : float
            A score from which on no more is looked for [percent].

        Returns
        -------
        bound : float
            No score can be higher.
        score : PoseScore or None
            None as soon as the bound is not above ``above``.
        """
        if self.bound <= above:
            return self.bound, None
        if self._first is None:
            self._first = self._first_goals(above)
        first = self._first
        if first.bound <= above:
            # Given up half-way: another question may need all of it.
            self._first = None
            return first.bound, None
        connection = self._connect(q, first, enough)
        score = self._score(connection)
        if score.score < min(enough, first.bound) - ROUNDING:
            every = self._with_other_branches(first, connection)
            if len(every.frame) > len(first.frame):
                score = self._score(self._connect(q, every, enough))
        return first.bound, score

    def _first_goals(self, above: float) -> _Goals:
        """One free approach for each frame that has one, unless too few have."""
        goals = _Goals(tried=self._first_free.copy(), bound=self.bound)
        pending = np.flatnonzero(goals.tried < self._end)
        while len(pending):
            missed = pending[~self._try_next(goals, pending)]
            self._skip_blocked(goals.tried, missed)
            ended = goals.tried[missed] == self._end[missed]
            goals.bound -= 100.0 * float(self._sample.weight[missed[ended]].sum())
            if goals.bound <= above:
                break
            pending = missed[~ended]
        return goals

    def _with_other_branches(self, first: _Goals, connection: Connection) -> _Goals:
        """Goals of all branches of the frames that were not reached."""
        every = first.copy()
        missed = every.tried < self._end
        missed[connection.roadmap.frames_reached()] = False
        pending = np.flatnonzero(missed)
        while len(pending):
            self._skip_blocked(every.tried, pending)
            pending = pending[every.tried[pending] < self._end[pending]]
            self._try_next(every, pending)
        return every

    def _try_next(self, goals: _Goals, frames: IntArray) -> BoolArray:
        """Look at the next branch of some frames; True where its approach is free."""
        rows = goals.tried[frames]
        goals.tried[frames] += 1
        ways = self._approach.of_many(self._rolled[self._row[rows]], self._Q[rows])
        followed = [(k, way) for k, way in enumerate(ways) if way is not None]
        free = np.zeros(len(frames), bool)
        free[[k for k, _ in followed]] = self.scene.motions.ways_are_verified(
            [way for _, way in followed]
        )
        goals.way += [way for k, way in followed if free[k]]
        goals.frame += frames[free].tolist()
        return free

    def _connect(self, q: FloatArray, goals: _Goals, enough: float) -> Connection:
        cell = self.scene.loaded.cell
        ways = [goals.way[k] for k in np.argsort(goals.frame, kind="stable")]
        dof = self.scene.robot.dof

        def of_ways(value: Callable[[FloatArray], FloatArray]) -> FloatArray:
            return np.array([value(way) for way in ways]).reshape(-1, dof)

        return connect(
            q,
            Goals(
                Q=of_ways(lambda way: way[0]),
                frame=np.sort(np.array(goals.frame, np.int64)),
                low=of_ways(lambda way: way.min(axis=0)),
                high=of_ways(lambda way: way.max(axis=0)),
            ),
            self.scene.motions,
            effort(cell.roadmap),
            seed=cell.seed,
            is_enough=lambda reached: self._percent(reached) >= enough,
            known=self._known_motions,
        )

    def _percent(self, reached: BoolArray) -> float:
        """Weighted share of frames; those beyond the array do not count [%]."""
        return 100.0 * float(self._sample.weight[: len(reached)] @ reached)

    def _score(self, connection: Connection) -> PoseScore:
        sample = self._sample
        length = np.full(len(self.T), np.inf)
        roadmap = connection.roadmap
        paths = roadmap.shortest_paths()
        to_goals = paths.length_rad[roadmap.shortest_to_goals(paths)]
        np.minimum.at(length, roadmap.goals.frame, to_goals)
        found = np.isfinite(length)
        return PoseScore(
            score=100.0 * float(sample.weight @ found),
            worst_point=100.0 * sample.worst_point(found),
            reachable_share=self.reachable_share,
            path_length_rad=(
                float(np.average(length[found], weights=sample.share[found]))
                if found.any()
                else np.inf
            ),
            error=100.0 * sample.standard_error(found),
        )


def effort(spec: RoadmapSpec) -> RoadmapSpec:
    """Planning effort of a score as a share of that of a map."""
    few = max(1, spec.max_checks // SHARE_OF_CHECKS)
    return spec.model_copy(update={"max_checks": few, "samples": 0})


@dataclass(slots=True, kw_only=True, eq=False)
class _Goals:
    """Pre-grasps found so far.

    Attributes
    ----------
    way : list of array, shape (n, dof)
        Approaches, from the pre-grasp on.
    frame : list of int
        Frame of each.
    tried : int array, shape (frames,)
        Branch of each frame to be looked at next.
    bound : float
        What the frames count for that have a goal or were not looked at [percent].
    """

    tried: IntArray
    bound: float
    way: list[FloatArray] = field(default_factory=list)
    frame: list[int] = field(default_factory=list)

    def copy(self) -> _Goals:
        return _Goals(
            tried=self.tried.copy(),
            bound=self.bound,
            way=list(self.way),
            frame=list(self.frame),
        )
