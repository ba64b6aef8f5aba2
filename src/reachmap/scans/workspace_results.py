"""Results of a workspace scan, frame by frame, and the map they make."""

from __future__ import annotations

import dataclasses
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
    write_workspace_map,
)
from reachmap.maps.parts import Components, concatenated, freeze
from reachmap.runtime.job import Kind
from reachmap.sampling.frames import CubeFrames, workspace_frames
from reachmap.scans.document import cell_of_document, provenance_from_document


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


def frames_of_cell(cell: Cell) -> int:
    """Number of test frames of a cell's workspace scan."""
    cubes = workspace_frames(cell)
    return sum(cube.frames.size for cube in cubes)


def blank(document: Mapping[str, Any], unit: int, status: Status) -> dict[str, Any]:
    """Payload of a unit without results."""
    cell = cell_of_document(document)
    size = document["frames_per_unit"]
    left = frames_of_cell(cell) - unit * size
    dof = len(document["joint_names"])
    return dataclasses.asdict(FrameResults.blank(min(size, left), dof, status))


def assemble(
    document: Mapping[str, Any], payloads: Sequence[Any], *, run: RunInfo
) -> WorkspaceMap:
    """Make the map from the payloads of all units.

    Parameters
    ----------
    document : mapping
        See :func:`reachmap.scans.document.scan_document`.
    payloads : sequence of mapping
        Results of consecutive frames; of the roadmap's one unit, with its evidence.
    run : RunInfo
    """
    parts = [dict(payload) for payload in payloads]
    evidence = parts[0].pop("components", None)
    results = concatenated([FrameResults(**part) for part in parts])
    cell = cell_of_document(document)
    maps: dict[str, CubeMap] = {}
    begin = 0
    for cube in workspace_frames(cell):
        end = begin + cube.frames.size
        maps[cube.name] = _cube_map(cube, results, slice(begin, end))
        begin = end
    return workspace_map_from_cubes(
        maps,
        scan_configuration=np.array(document["scan_configuration"], float),
        joint_names=tuple(document["joint_names"]),
        body_pairs=tuple(document["body_pairs"]),
        method=document["method"],
        components=None
        if evidence is None
        else Components(**evidence | {"methods": tuple(evidence["methods"])}),
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


KIND = Kind(
    name="workspace_map", blank=blank, assemble=assemble, write=write_workspace_map
)
