"""Grasps between the test grasps, with verdicts only, where the map is uncertain.

A test grasp stands for a box of places and a cone of directions, and a boundary of
what is reachable runs through many of them. Where the roll is free, further grasps are
drawn among those for whose tool the bin has room: the first anywhere, the others where
a regression over those before is least sure. Ranking takes its verdicts from the
regression over all of them.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.robot import FREE
from reachmap.core.scene import Scene
from reachmap.geometry import (
    approach_directions,
    axis_rotations,
    inverse_transform,
    quaternion_wxyz_from_rotation,
    transform_from_parts,
    transform_points,
)
from reachmap.maps.parts import Refinement
from reachmap.maps.records import Status
from reachmap.ranking.lookup.bin_room import BinRoom
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.queries import complete_rotation
from reachmap.runtime.job import Job, Stages, blocks
from reachmap.sampling.frames import approach_distance_m, bin_test_frames
from reachmap.sampling.regression import GraspRegression
from reachmap.sampling.volume import GraspVolume
from reachmap.scans.bin_roadmap import lengths_over_roadmap
from reachmap.scans.ik_survey import Survey, join_surveys, survey_frames
from reachmap.scans.rolls import RollGroups

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

FIRST_SHARE: Final = 0.1
"""Share of the grasps that are drawn anywhere."""
ROUNDS: Final = 8
"""Batches in which the rest are chosen, each by what is known by then."""
CANDIDATES: Final = 8
"""Drawn for each that is chosen."""
IN_DOUBT: Final = 0.45
"""Estimates nearer to one half are not sure; where none is, no more are drawn."""
# A choice: a bare flange, which turns about its own wrist.
SHORTEST_LEVER_M: Final = 0.1
# A choice: fewer than of a survey, as each is solved in many rolls.
GRASPS_PER_UNIT: Final = 20
# Degrees of freedom of a pose in space.
FULL_DOF: Final = 6
# Any number, so that the draws are those of no other part of a scan.
SEED_OF_REFINEMENT: Final = 0x5EF1


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleContext:
    """What a worker needs to find goals of some grasps, whose roll is free.

    Attributes
    ----------
    loaded : LoadedCell
    T : array, shape (n, 4, 4)
        T_base_tcp in one roll each.
    all_rolls : bool
        Whether all rolls are solved; else until a grasp has a goal.
    """

    loaded: LoadedCell
    T: FloatArray
    all_rolls: bool


def refine(scene: Scene, stages: Stages) -> Refinement | None:
    """Find verdicts between the test grasps.

    None where the cell asks for none, where a test grasp is one roll, where each layer
    has an obstacle of its own, and for arms that cannot take a direction of its own at
    every place: nearly all that is drawn would be out of their reach.
    """
    cell = scene.loaded.cell
    spec = cell.bin_scan
    if not spec.refine or cell.tool.roll != FREE or spec.is_filled:
        return None
    if scene.robot.dof < FULL_DOF:
        return None
    sizes = _sizes(min(spec.refine, spec.count()))
    source = _Source(cell)
    T = source.draw(CANDIDATES * sizes[0])[: sizes[0]]
    surveys = [_survey(scene, stages, "refine_0", T)]
    for number, count in enumerate(sizes[1:], start=1):
        batch = source.draw(CANDIDATES * count)
        batch = batch[_in_doubt(T, surveys, batch, cell)[:count]]
        if not len(batch):
            break
        surveys.append(_survey(scene, stages, f"refine_{number}", batch))
        T = np.concatenate([T, batch])
    return _verdicts(scene, stages, T, _joined(surveys))


def whole_volume(cell: Cell) -> GraspVolume:
    """The volume that the test grasps represent, sideways the whole bin."""
    T_base_bin, spec = cell.T_base_bin(), cell.bin_scan
    grid = bin_test_frames(cell, T_base_bin)
    half = np.array(cell.bin.inner[:2]) / 2
    corners = np.array([[*-half, 0.0], [*half, 0.0]])
    axes = approach_directions(grid.frames.orientations, cell.robot.tcp.approach_axis)
    pitch = float((2 * half / spec.grid).max())
    return GraspVolume.of(corners, grid.layer, pitch, axes @ T_base_bin[:3, :3])


def lever_of(cell: Cell) -> float:
    """Length of the tool, from its tip to the link that carries it [m]."""
    return max(float(np.linalg.norm(cell.robot.tcp.xyz)), SHORTEST_LEVER_M)


def _sizes(total: int) -> list[int]:
    """Grasps of each round."""
    first = max(1, round(FIRST_SHARE * total))
    rest = np.diff(np.linspace(first, total, ROUNDS + 1).round().astype(int))
    return [first, *(int(n) for n in rest if n)]


def _in_doubt(
    T: FloatArray, surveys: list[Survey], asked: FloatArray, cell: Cell
) -> IntArray:
    """Poses whose reachability is least certain, the least certain first."""
    axis = cell.robot.tcp.approach_axis
    has_goal = np.concatenate([s.status == Status.NOT_ATTEMPTED for s in surveys])
    regression = GraspRegression.fit(
        T[:, :3, 3],
        approach_directions(T[:, :3, :3], axis),
        has_goal.astype(float),
        lever_of(cell),
    )
    estimate = regression(asked[:, :3, 3], approach_directions(asked[:, :3, :3], axis))
    # Rounded, so that the last bits of another machine choose the same.
    order = np.argsort(np.abs(estimate - 0.5).round(6), kind="stable")
    return order[np.abs(estimate[order] - 0.5) < IN_DOUBT]


class _Source:
    """Draws grasps for whose tool there is room in the bin: others need no asking."""

    def __init__(self, cell: Cell) -> None:
        self._axis, self._T_base_bin = cell.robot.tcp.approach_axis, cell.T_base_bin()
        self._volume = whole_volume(cell)
        self._room = BinRoom.for_tool(
            cell.model_dump_json(), inverse_transform(self._T_base_bin)
        )
        self._rng = np.random.default_rng([cell.seed, SEED_OF_REFINEMENT])

    def draw(self, count: int) -> FloatArray:
        """Poses in robot_base, in the roll fixed by rule, at most (count, 4, 4)."""
        T_base_bin = self._T_base_bin
        points, axes = self._volume.draw(self._rng, count)
        points = transform_points(T_base_bin, points)
        axes = axes @ T_base_bin[:3, :3].T
        if self._room is not None:
            every = np.ones(count, bool)
            queries = Queries(
                points=points,
                axes=axes,
                quaternions=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
                free=every,
                valid=every,
            )
            kept = self._room.is_there(queries)
            points, axes = points[kept], axes[kept]
        R = complete_rotation(axes, T_base_bin[:3, :3], self._axis)
        return transform_from_parts(R, points)


def _survey(
    scene: Scene, stages: Stages, phase: str, T: FloatArray, *, all_rolls: bool = False
) -> Survey:
    context = SampleContext(loaded=scene.loaded, T=T, all_rolls=all_rolls)
    units = blocks(len(T), GRASPS_PER_UNIT)
    payloads = stages.run(phase, Job(function=survey_unit, context=context), units)
    return _joined([Survey(**payload) for payload in payloads])


def survey_unit(context: SampleContext, unit: range) -> dict[str, Any]:
    """Goals of some grasps in any roll."""
    scene = Scene.shared(context.loaded, with_bin=True)
    cell = context.loaded.cell
    axis, approach_m = cell.robot.tcp.approach_axis, approach_distance_m(cell)
    groups = RollGroups.apart(context.T[unit.start : unit.stop], cell.tool)
    survey = groups.share_goals(survey_frames(scene, groups.T, approach_m))
    wanted = groups.group
    if not context.all_rolls:
        wanted = np.setdiff1d(wanted, survey.frame)
    survey = groups.add_rolls(
        survey,
        wanted,
        axis,
        lambda T: survey_frames(scene, T, approach_m),
        until_found=not context.all_rolls,
    )
    return survey.payload()


def _joined(surveys: list[Survey]) -> Survey:
    """Surveys of grasps with a free roll each, put together."""
    joined = join_surveys(surveys)
    count = len(joined.status)
    return dataclasses.replace(
        joined,
        group=np.arange(count),
        roll=np.concatenate([np.zeros(0), *(s.roll for s in surveys)]),
        frame_roll=np.zeros(count),
    )


def _verdicts(
    scene: Scene, stages: Stages, T: FloatArray, survey: Survey
) -> Refinement:
    """Connect the goals and say which grasps are reached, and in which roll."""
    length = lengths_over_roadmap(scene, stages, "connect_refined", survey)
    missed = np.setdiff1d(survey.frame, survey.frame[np.isfinite(length)])
    if len(missed):
        more = _survey(scene, stages, "refine_rolls", T[missed], all_rolls=True)
        survey = _with_more(survey, missed, more)
        length = lengths_over_roadmap(scene, stages, "connect_refined_again", survey)
    status = survey.status.copy()
    status[status == Status.NOT_ATTEMPTED] = Status.NO_PATH_FOUND
    assert survey.roll is not None
    roll = np.zeros(len(T))
    # The last write wins, so the shortest goes last.
    order = np.argsort(-length, kind="stable")
    order = order[np.isfinite(length[order])]
    status[survey.frame[order]] = Status.PATH_FOUND
    roll[survey.frame[order]] = survey.roll[order]
    axis = scene.loaded.cell.robot.tcp.approach_axis
    return Refinement(
        position=T[:, :3, 3].copy(),
        quaternion_wxyz=quaternion_wxyz_from_rotation(
            T[:, :3, :3] @ axis_rotations(axis, roll)
        ),
        status=status,
        lever_m=lever_of(scene.loaded.cell),
    )


def _with_more(survey: Survey, grasps: IntArray, more: Survey) -> Survey:
    """A survey in which some grasps have the goals of another survey, their own."""
    assert survey.roll is not None
    assert more.roll is not None
    kept = np.flatnonzero(~np.isin(survey.frame, grasps))
    frame = np.concatenate([survey.frame[kept], grasps[more.frame]])
    roll = np.concatenate([survey.roll[kept], more.roll])
    ways = [survey.way_of(goal) for goal in kept.tolist()]
    return survey.with_goals(frame, roll, [*ways, *more.ways()])
