"""Results of a bin scan, attempt by attempt, and the map they make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.cell.model import Cell
from reachmap.maps import BinMap, PathStore, RunInfo, Stamp, Status
from reachmap.maps.records import freeze
from reachmap.sampling.frames import bin_test_frames
from reachmap.scans.document import provenance_from_document
from reachmap.scans.measured import MEASURED


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspResults:
    """What became of test grasps and their attempts.

    Attributes
    ----------
    status, n_ik, n_ik_free, connected : uint8 array, shape (grasps,)
    blocking_pair : int array, shape (grasps,)
    path_found, hit_time_limit : uint8 array, shape (grasps, repeats)
    measured : array, shape (grasps, repeats, 7)
        In the order of :data:`~reachmap.scans.measured.MEASURED`.
    goal_configuration : array, shape (grasps, dof)
        Where the shortest path ends [rad].
    configuration : array, shape (points, dof)
        Way-points of all paths, one path after another.
    row_size, planned_size : int array, shape (paths,)
    place : int array, shape (paths, 2)
        Grasp and repeat of each path.
    """

    status: CodeArray
    n_ik: CodeArray
    n_ik_free: CodeArray
    connected: CodeArray
    blocking_pair: IntArray
    path_found: CodeArray
    hit_time_limit: CodeArray
    measured: FloatArray
    goal_configuration: FloatArray
    configuration: FloatArray
    row_size: IntArray
    planned_size: IntArray
    place: IntArray

    def __post_init__(self) -> None:
        freeze(self)

    @classmethod
    def blank(cls, grasps: int, repeats: int, dof: int, status: Status) -> GraspResults:
        """Results of grasps that nothing is known of."""
        return cls(
            status=np.full(grasps, status, np.uint8),
            n_ik=np.zeros(grasps, np.uint8),
            n_ik_free=np.zeros(grasps, np.uint8),
            connected=np.zeros(grasps, np.uint8),
            blocking_pair=np.full(grasps, -1, np.int64),
            path_found=np.zeros((grasps, repeats), np.uint8),
            hit_time_limit=np.zeros((grasps, repeats), np.uint8),
            measured=np.full((grasps, repeats, len(MEASURED)), np.nan),
            goal_configuration=np.full((grasps, dof), np.nan),
            configuration=np.zeros((0, dof)),
            row_size=np.zeros(0, np.int64),
            planned_size=np.zeros(0, np.int64),
            place=np.zeros((0, 2), np.int64),
        )

    @classmethod
    def join(cls, parts: Sequence[GraspResults]) -> GraspResults:
        """Results of consecutive grasps, put together."""
        joined = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in cls.__slots__
            if name != "place"
        }
        begin = np.cumsum([0, *(len(part.status) for part in parts[:-1])])
        place = [
            part.place + np.array([first, 0])
            for part, first in zip(parts, begin, strict=True)
        ]
        return cls(**joined, place=np.concatenate(place))


def assemble_bin_map(
    document: Mapping[str, Any], results: GraspResults, *, run: RunInfo
) -> BinMap:
    """Make the map of a scan.

    Parameters
    ----------
    document : mapping
        See :func:`reachmap.scans.document.scan_document`.
    results : GraspResults
        Of all test grasps.
    run : RunInfo
    """
    cell = Cell.model_validate_json(document["provenance"]["cell_resolved_json"])
    T_base_bin = cell.bin.pose.matrix()
    axis = cell.robot.tcp.approach_axis
    grid = bin_test_frames(cell.bin_scan, cell.bin, axis, T_base_bin)
    shape = grid.frames.shape

    def shaped(values: Any) -> Any:
        return values.reshape(*shape, *values.shape[1:])

    found = (results.status == Status.PATH_FOUND).reshape(shape)
    known = (results.status != Status.NOT_ATTEMPTED).reshape(shape)
    with np.errstate(invalid="ignore"):
        percent = 100.0 * found.sum(-1) / known.sum(-1)
    quaternion = np.broadcast_to(grid.frames.quaternion_wxyz, (*shape, 4))
    measured = {
        name: shaped(results.measured[..., k]) for k, name in enumerate(MEASURED)
    }
    return BinMap(
        layer=grid.layer,
        y=grid.y,
        x=grid.x,
        bin_pose=T_base_bin,
        bin_inner=np.array(cell.bin.inner),
        position=grid.frames.points,
        quaternion_wxyz=quaternion.copy(),
        approach_axis=axis,
        approach_distance=cell.bin_scan.approach_distance_m,
        status=shaped(results.status),
        blocking_pair=shaped(results.blocking_pair),
        n_ik=shaped(results.n_ik),
        n_ik_free=shaped(results.n_ik_free),
        connected=shaped(results.connected),
        path_found=shaped(results.path_found),
        hit_time_limit=shaped(results.hit_time_limit),
        **measured,
        goal_configuration=shaped(results.goal_configuration),
        path_reachability=percent,
        scan_configuration=np.array(document["scan_configuration"], float),
        joint_names=tuple(document["joint_names"]),
        body_pairs=tuple(document["body_pairs"]),
        paths=_path_store(results, shape),
        stamp=Stamp(**document["stamp"]),
        provenance=provenance_from_document(document),
        run=run,
    )


def _path_store(results: GraspResults, shape: tuple[int, ...]) -> PathStore:
    where = np.stack(np.unravel_index(results.place[:, 0], shape), axis=1)
    return PathStore(
        configuration=results.configuration,
        row_size=results.row_size,
        planned_size=results.planned_size,
        index=np.concatenate([where, results.place[:, 1:]], axis=1).astype(np.int64),
    )
