"""Results of a workspace scan, frame by frame, and the map they make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.cell.model.cell import Cell
from reachmap.maps import (
    CubeMap,
    RunInfo,
    Stamp,
    Status,
    WorkspaceMap,
    workspace_map_from_cubes,
)
from reachmap.maps.parts import Components, freeze
from reachmap.sampling.frames import CubeFrames, workspace_frames
from reachmap.scans.document import provenance_from_document


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameResults:
    """Outcomes of test frames, in the order of the cubes.

    Attributes
    ----------
    status, n_ik, n_ik_free, attempts, paths_found : uint8 array, shape (frames,)
    blocking_pair, component : int array, shape (frames,)
    path_length : array, shape (frames,)
        [rad], NaN without a path.
    goal_configuration : array, shape (frames, dof)
        [rad], NaN without a path.
    """

    status: CodeArray
    blocking_pair: IntArray
    n_ik: CodeArray
    n_ik_free: CodeArray
    attempts: CodeArray
    paths_found: CodeArray
    component: IntArray
    path_length: FloatArray
    goal_configuration: FloatArray

    def __post_init__(self) -> None:
        freeze(self)

    @classmethod
    def blank(cls, frames: int, dof: int, status: Status) -> FrameResults:
        """Results of frames that nothing is known of."""
        zeros = np.zeros(frames, np.uint8)
        return cls(
            status=np.full(frames, status, np.uint8),
            blocking_pair=np.full(frames, -1, np.int64),
            n_ik=zeros,
            n_ik_free=zeros.copy(),
            attempts=zeros.copy(),
            paths_found=zeros.copy(),
            component=np.full(frames, -1, np.int64),
            path_length=np.full(frames, np.nan),
            goal_configuration=np.full((frames, dof), np.nan),
        )

    @classmethod
    def join(cls, parts: Sequence[FrameResults]) -> FrameResults:
        """Results of consecutive frames, put together."""
        return cls(
            **{
                name: np.concatenate([getattr(part, name) for part in parts])
                for name in cls.__slots__
            }
        )


def assemble_workspace_map(
    document: Mapping[str, Any],
    results: FrameResults,
    *,
    run: RunInfo,
    components: Components | None = None,
) -> WorkspaceMap:
    """Make the map of a scan.

    Parameters
    ----------
    document : mapping
        See :func:`reachmap.scans.document.scan_document`.
    results : FrameResults
    run : RunInfo
    components : Components, optional
        Evidence of the roadmap.
    """
    cell = Cell.model_validate_json(document["provenance"]["cell_resolved_json"])
    cubes = workspace_frames(cell)
    maps: dict[str, CubeMap] = {}
    begin = 0
    for cube in cubes:
        end = begin + cube.frames.size
        maps[cube.name] = _cube_map(cube, results, slice(begin, end))
        begin = end
    return workspace_map_from_cubes(
        maps,
        scan_configuration=np.array(document["scan_configuration"], float),
        joint_names=tuple(document["joint_names"]),
        body_pairs=tuple(document["body_pairs"]),
        method=document["method"],
        components=components,
        T_world_base=cell.robot.base_pose.matrix(),
        T_base_grid=cell.T_base_grid(),
        stamp=Stamp(**document["stamp"]),
        provenance=provenance_from_document(document),
        run=run,
    )


def _cube_map(cube: CubeFrames, results: FrameResults, rows: slice) -> CubeMap:
    shape = cube.frames.shape

    def part(name: str) -> Any:
        values = getattr(results, name)[rows]
        return values.reshape(*shape, *values.shape[1:])

    return CubeMap(
        x=cube.lattice.x,
        y=cube.lattice.y,
        z=cube.lattice.z,
        quaternion_wxyz=cube.frames.quaternion_wxyz,
        **{name: part(name) for name in FrameResults.__slots__},
    )
