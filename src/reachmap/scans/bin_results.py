"""Results of a bin scan, grasp by grasp, and their assembly to a map."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.cell.model.robot import LISTED
from reachmap.core.planning.timing import path_length_rad
from reachmap.maps import BinMap, PathStore, RunInfo, Stamp, Status
from reachmap.maps.parts import (
    ApproachTimes,
    BestPaths,
    Components,
    Effort,
    Margins,
    Refinement,
    concatenated,
    freeze,
)
from reachmap.maps.records import NO_PAIR
from reachmap.sampling.frames import approach_distance_m, bin_test_frames
from reachmap.scans.cycle.results import CycleResults
from reachmap.scans.document import cell_of_document, provenance_from_document
from reachmap.scans.measured import MEASURED, SECONDS_PER_CHECK

NO_PATH = -2
"""In place of a repeat, where there is no path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspResults:
    """Outcomes of test grasps and of their attempts.

    Attributes
    ----------
    status, n_ik, n_ik_free, connected : uint8 array, shape (grasps,)
    blocking_pair : int array, shape (grasps,)
    path_found, hit_time_limit : uint8 array, shape (grasps, repeats)
    checks : int array, shape (grasps, repeats)
        State checks of the search.
    measured : array, shape (grasps, repeats, 9)
        In the order of :data:`~reachmap.scans.measured.MEASURED`.
    own : array, shape (grasps, 9)
        The same of the roadmap's own path, NaN where it is not needed.
    component : int array, shape (grasps,)
    winning_roll : array, shape (grasps,)
        Of the best path, relative to the test grasp [rad].
    margins : array, shape (grasps, 4)
        Of the best path: clearance [m], the pair that comes closest (-1: none), joint
        margin [rad], smallest singular value; NaN without a path.
    configuration : array, shape (points, dof)
        Waypoints of all paths, one path after another.
    row_size, planned_size : int array, shape (paths,)
    place : int array, shape (paths, 2)
        Grasp and repeat of each path; repeat -1 for the roadmap's own, and for stages
        of the cycle.
    stage : uint8 array, shape (paths,)
        0: to the grasp; then the stages of the cycle.
    best_repeat : int array, shape (grasps,)
        Repeat of the path that a line would run, :data:`NO_PATH` without one.
    cycle : CycleResults or None
        None where the cell has no part.
    """

    status: CodeArray
    n_ik: CodeArray
    n_ik_free: CodeArray
    connected: CodeArray
    blocking_pair: IntArray
    path_found: CodeArray
    hit_time_limit: CodeArray
    checks: IntArray
    measured: FloatArray
    own: FloatArray
    component: IntArray
    winning_roll: FloatArray
    margins: FloatArray
    configuration: FloatArray
    row_size: IntArray
    planned_size: IntArray
    place: IntArray
    stage: CodeArray
    best_repeat: IntArray
    cycle: CycleResults | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @classmethod
    def blank(
        cls, grasps: int, repeats: int, dof: int, status: Status, *, stages: int = 0
    ) -> GraspResults:
        """Results of grasps without any outcome."""
        return cls(
            status=np.full(grasps, status, np.uint8),
            n_ik=np.zeros(grasps, np.uint8),
            n_ik_free=np.zeros(grasps, np.uint8),
            connected=np.zeros(grasps, np.uint8),
            blocking_pair=np.full(grasps, -1, np.int64),
            path_found=np.zeros((grasps, repeats), np.uint8),
            hit_time_limit=np.zeros((grasps, repeats), np.uint8),
            checks=np.zeros((grasps, repeats), np.int64),
            measured=np.full((grasps, repeats, len(MEASURED)), np.nan),
            own=np.full((grasps, len(MEASURED)), np.nan),
            component=np.full(grasps, -1, np.int64),
            winning_roll=np.full(grasps, np.nan),
            margins=np.full((grasps, 4), np.nan),
            configuration=np.zeros((0, dof)),
            row_size=np.zeros(0, np.int64),
            planned_size=np.zeros(0, np.int64),
            place=np.zeros((0, 2), np.int64),
            stage=np.zeros(0, np.uint8),
            best_repeat=np.full(grasps, NO_PATH, np.int64),
            cycle=CycleResults.blank(grasps, stages) if stages else None,
        )

    def renumbered(self, pair: IntArray, first_component: int) -> GraspResults:
        """The same with other numbers for pairs of bodies and components.

        Parameters
        ----------
        pair : int array, shape (pairs,)
            New number of each pair.
        first_component : int
            Number of component 0.
        """
        margins = self.margins.copy()
        closest = np.nan_to_num(margins[:, 1], nan=NO_PAIR).astype(np.int64)
        margins[closest >= 0, 1] = pair[closest[closest >= 0]]
        blocking, there = self.blocking_pair.copy(), self.blocking_pair >= 0
        blocking[there] = pair[blocking[there]]
        component = np.where(
            self.component >= 0, self.component + first_component, self.component
        )
        return replace(
            self, margins=margins, blocking_pair=blocking, component=component
        )

    @classmethod
    def join(cls, parts: Sequence[GraspResults]) -> GraspResults:
        """Results of consecutive grasps, put together."""
        joined = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in cls.__slots__
            if name not in ("place", "cycle")
        }
        begin = np.cumsum([0, *(len(part.status) for part in parts[:-1])])
        place = [
            part.place + np.array([first, 0])
            for part, first in zip(parts, begin, strict=True)
        ]
        cycles = [part.cycle for part in parts if part.cycle is not None]
        return cls(
            **joined,
            place=np.concatenate(place),
            cycle=concatenated(cycles) if cycles else None,
        )


_AS_THEY_ARE = (
    "status", "blocking_pair", "n_ik", "n_ik_free", "connected", "path_found",
    "hit_time_limit",
)  # fmt: skip


def assemble_bin_map(
    document: Mapping[str, Any],
    results: GraspResults,
    *,
    run: RunInfo,
    components: Components | None,
    refinement: Refinement | None = None,
) -> BinMap:
    """Make the map of a scan.

    Parameters
    ----------
    document : mapping
        See :func:`reachmap.scans.document.scan_document`.
    results : GraspResults
        Of all test grasps.
    run : RunInfo
    components : Components or None
        Evidence of the roadmap; None where the unit that holds it is missing.
    refinement : Refinement, optional
        What is known between the test grasps.
    """
    cell = cell_of_document(document)
    T_base_bin = cell.T_base_bin()
    grid = bin_test_frames(cell, T_base_bin)
    shape = grid.frames.shape

    def shaped(values: Any) -> Any:
        return values.reshape(*shape, *values.shape[1:])

    found = (results.status == Status.PATH_FOUND).reshape(shape)
    known = (results.status != Status.NOT_ATTEMPTED).reshape(shape)
    with np.errstate(invalid="ignore"):
        percent = 100.0 * found.sum(-1) / known.sum(-1)
    cycle, rolls_are_listed = results.cycle, cell.tool.roll == LISTED
    quaternion = np.broadcast_to(grid.frames.quaternion_wxyz, (*shape, 4))
    best = _best_paths(results)
    return BinMap(
        T_world_base=cell.robot.base_pose.matrix(),
        layer=grid.layer,
        y=grid.y,
        x=grid.x,
        bin_pose=T_base_bin,
        bin_inner=np.array(cell.bin.inner),
        position=grid.frames.points,
        quaternion_wxyz=quaternion.copy(),
        approach_axis=cell.robot.tcp.approach_axis,
        approach_distance=approach_distance_m(cell),
        **{name: shaped(getattr(results, name)) for name in _AS_THEY_ARE},
        **_of_attempts(results, shaped),
        goal_configuration=shaped(_ends(results, best)),
        component=None if components is None else shaped(results.component),
        components=components,
        refinement=refinement,
        best=BestPaths(
            **{name: shaped(getattr(best, name)) for name in BestPaths.__slots__}
        ),
        winning_roll=None if rolls_are_listed else shaped(results.winning_roll),
        margins=_margins(shaped(results.margins)),
        cycle=cycle.section(document["stages"], known, shaped) if cycle else None,
        part_corners=_part_corners(document),
        lift_above_rim=shaped(cycle.lift_above_rim) if cycle else None,
        path_reachability=percent,
        scan_configuration=np.array(document["scan_configuration"], float),
        joint_names=tuple(document["joint_names"]),
        body_pairs=tuple(document["body_pairs"]),
        paths=_path_store(results, shape),
        stamp=Stamp(**document["stamp"]),
        provenance=provenance_from_document(document),
        run=run,
    )


def _part_corners(document: Mapping[str, Any]) -> FloatArray | None:
    corners = document.get("part_corners")
    return None if corners is None else np.array(corners, float)


def _of_attempts(results: GraspResults, shaped: Callable[[Any], Any]) -> dict[str, Any]:
    """What the map holds of every attempt."""
    measured = {
        name: shaped(results.measured[..., k]) for k, name in enumerate(MEASURED)
    }
    return {
        "times": ApproachTimes(
            approach=measured.pop("approach_time"),
            retreat=measured.pop("retreat_time"),
        ),
        "effort": Effort(
            checks=shaped(results.checks), seconds_per_check=SECONDS_PER_CHECK
        ),
        **measured,
    }


def _margins(values: FloatArray) -> Margins:
    """Margins from their columns, shape (..., 4)."""
    clearance, pair, joint_margin, singular_value = np.moveaxis(values, -1, 0)
    return Margins(
        clearance=clearance,
        clearance_pair=np.nan_to_num(pair, nan=NO_PAIR).astype(np.int64),
        joint_margin=joint_margin,
        smallest_singular_value=singular_value,
    )


def _best_paths(results: GraspResults) -> BestPaths:
    """The path to execute to each test grasp."""
    grasps = len(results.status)
    row = np.full(grasps, -1, np.int64)
    execution = np.full(grasps, np.nan)
    length = np.full(grasps, np.nan)
    effort = np.zeros(grasps, np.int64)
    ends = np.cumsum(results.row_size)
    for k, (grasp, repeat) in enumerate(results.place.tolist()):
        if results.stage[k] or repeat != results.best_repeat[grasp]:
            continue
        path = results.configuration[ends[k] - results.row_size[k] : ends[k]]
        row[grasp], length[grasp] = k, path_length_rad(path)
        own = repeat < 0
        numbers = results.own[grasp] if own else results.measured[grasp, repeat]
        execution[grasp] = numbers[MEASURED.index("execution_time")]
        effort[grasp] = 0 if own else results.checks[grasp, repeat]
    return BestPaths(
        row=row, path_length=length, execution_time=execution, effort_checks=effort
    )


def _ends(results: GraspResults, best: BestPaths) -> FloatArray:
    """Where the best path to each grasp ends, shape (grasps, dof); NaN without one."""
    ends = np.full((len(best.row), results.configuration.shape[1]), np.nan)
    there = best.row >= 0
    last = np.cumsum(results.row_size) - 1
    ends[there] = results.configuration[last[best.row[there]]]
    return ends


def _path_store(results: GraspResults, shape: tuple[int, ...]) -> PathStore:
    where = np.stack(np.unravel_index(results.place[:, 0], shape), axis=1)
    return PathStore(
        configuration=results.configuration,
        row_size=results.row_size,
        planned_size=results.planned_size,
        index=np.concatenate([where, results.place[:, 1:]], axis=1).astype(np.int64),
        stage=None if results.cycle is None else results.stage,
    )
