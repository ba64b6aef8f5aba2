"""Contents of the artefacts, as frozen records of read-only arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.geometry import yaw_transform
from reachmap.maps.display import Shown, ShownBin
from reachmap.maps.parts import (
    ApproachTimes,
    BestPaths,
    Compared,
    Components,
    Cycle,
    Effort,
    Margins,
    PathStore,
    Refinement,
    freeze,
)
from reachmap.sampling.lattice import Lattice, Stitching, pooled_percent, stitch

NO_PAIR = -1


class Status(IntEnum):
    """Outcome of a test frame; the stored codes never change meaning."""

    NOT_ATTEMPTED = 0
    PATH_FOUND = 1
    NO_IK = 2
    IK_IN_COLLISION = 3
    NO_PATH_FOUND = 4
    ERROR = 5
    APPROACH_BLOCKED = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """What an artefact was made from, complete enough to make it again.

    Attributes
    ----------
    cell_yaml : str
        The cell file as read.
    cell_resolved_json : str
        The cell after defaults and overrides, paths made absolute where found.
    overrides : tuple of str
        ``--set`` assignments, in order.
    urdf, srdf : str
        Text of the robot description after xacro; srdf may be empty.
    files_sha256 : mapping
        Mesh name (as the cell or URDF names it) to the sha256 of its bytes.
    packages : mapping
        Distribution name to version.
    settings : mapping
        Method, planner, checking and simplification settings as JSON values.
    source_sha256 : str
        ``content_sha256`` of the artefact this one was made from, or "".
    """

    cell_yaml: str
    cell_resolved_json: str
    overrides: tuple[str, ...] = ()
    urdf: str = ""
    srdf: str = ""
    files_sha256: Mapping[str, str] = field(default_factory=dict)
    packages: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    source_sha256: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunInfo:
    """How one run went, outside every hash; ``wall_s``, ``cpu_s``: seconds by phase."""

    started: str = ""
    finished: str = ""
    host: str = ""
    command_line: str = ""
    workers: int = 1
    wall_s: Mapping[str, float] = field(default_factory=dict)
    cpu_s: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stamp:
    """The root attributes every artefact carries besides its format."""

    seed: int
    cell_sha256: str
    config_sha256: str
    content_sha256: str = ""
    format_version: str = "1.1"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CubeMap(Compared):
    """One cube of a workspace scan. Index order (z, y, x, orientation).

    Attributes
    ----------
    x, y, z : array, shape (nx,), (ny,), (nz,)
        Lattice coordinates in robot_base [m].
    quaternion_wxyz : array, shape (no, 4)
        TCP orientation of each test frame in robot_base.
    status : uint8 array, shape (nz, ny, nx, no)
        :class:`Status` codes.
    blocking_pair : int32 array, same shape
        Index into ``body_pairs``, -1 where there is none.
    n_ik, n_ik_free, attempts, paths_found : uint8 array, same shape
    component : int32 array, same shape
        Connected component of the roadmap, -1 where there is none.
    path_length : array, same shape
        Joint-space length of the path [rad], NaN unless ``path_found``.
    goal_configuration : array, shape (nz, ny, nx, no, dof)
        The free goal that the result rests on [rad], NaN where there is none.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    quaternion_wxyz: FloatArray
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

    def counts(self, kind: str) -> tuple[FloatArray, FloatArray]:
        """Frames that succeeded and that were attempted, each of shape (nz, ny, nx).

        Parameters
        ----------
        kind : {"path", "ik", "ik_free"}
        """
        hit: BoolArray = {
            "path": self.status == Status.PATH_FOUND,
            "ik": self.n_ik > 0,
            "ik_free": self.n_ik_free > 0,
        }[kind]
        attempted = self.status != Status.NOT_ATTEMPTED
        return (hit & attempted).sum(-1, dtype=float), attempted.sum(-1, dtype=float)

    def percent(self, kind: str) -> FloatArray:
        """Eq. (1): share of frames per point [percent], shape (nz, ny, nx).

        Parameters
        ----------
        kind : {"path", "ik", "ik_free"}
        """
        hits, attempted = self.counts(kind)
        percent = np.full(hits.shape, np.nan)
        np.divide(100.0 * hits, attempted, out=percent, where=attempted > 0)
        return percent


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class WorkspaceMap(Shown):
    """Path reachability over the cubes, seen from one scan configuration.

    ``x``, ``y``, ``z`` and the three percentages are the stitched lattice, where
    frames of points that cubes share are pooled (Eq. 1); ``T_base_grid`` (4, 4) is
    their frame. Files of version 1.0 lack ``components`` and ``T_world_base`` (4, 4).
    """

    cubes: Mapping[str, CubeMap]
    x: FloatArray
    y: FloatArray
    z: FloatArray
    path_reachability: FloatArray
    ik_reachability: FloatArray
    ik_free_reachability: FloatArray
    scan_configuration: FloatArray
    joint_names: tuple[str, ...]
    body_pairs: tuple[str, ...]
    method: str
    stamp: Stamp
    provenance: Provenance
    run: RunInfo = RunInfo()
    components: Components | None = None
    T_world_base: FloatArray | None = None
    T_base_grid: FloatArray = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class BinMap(ShownBin):
    """Every attempt at every test grasp of a bin.

    Index order (layer, y, x, orientation, repeat). ``x``, ``y``, ``layer`` [m] are
    in the bin frame: origin at the centre of the inner bottom, x along the long
    side, z up.

    Attributes
    ----------
    bin_pose : array, shape (4, 4)
        T_base_bin.
    position : array, shape (nl, ny, nx, 3)
        d_test in robot_base [m].
    quaternion_wxyz : array, shape (nl, ny, nx, no, 4)
        R_test in robot_base.
    approach_axis : str
        TCP axis that points into the object.
    status, blocking_pair, n_ik, n_ik_free : array, shape (nl, ny, nx, no)
    connected : uint8 array, shape (nl, ny, nx, no)
        1 where the roadmap proves a path, whether or not an attempt found one.
    path_found : uint8 array, shape (nl, ny, nx, no, nr)
    hit_time_limit : uint8 array, same shape
        1 where the limit on wall-clock time ended the attempt; zeros if left out.
    path_length, path_length_planned : array, same shape
        Whole path, straight approach included, and its planned part [rad].
    tcp_path_length : array, same shape
        Length of the TCP's way, whole path [m].
    planning_time, planning_cpu_time, simplification_time, execution_time
        Array, same shape [s]; NaN where no path.
    goal_configuration : array, shape (nl, ny, nx, no, dof)
        Of the shortest path [rad].
    path_reachability : array, shape (nl, ny, nx)
        Percent over orientations.
    component : int array, shape (nl, ny, nx, no), or None
        Connected component of the roadmap, -1: none.
    winning_roll : array, shape (nl, ny, nx, no), or None
        Roll of the best path, where roll is free [rad]; NaN without a path.
    T_world_base, components, effort, best, times, margins, cycle, part_corners,
    lift_above_rim, refinement
        What maps hold since version 1.1; None where the file does not.
    """

    layer: FloatArray
    y: FloatArray
    x: FloatArray
    bin_pose: FloatArray
    bin_inner: FloatArray
    position: FloatArray
    quaternion_wxyz: FloatArray
    approach_axis: str
    approach_distance: float
    status: CodeArray
    blocking_pair: IntArray
    n_ik: CodeArray
    n_ik_free: CodeArray
    connected: CodeArray
    path_found: CodeArray
    path_length: FloatArray
    path_length_planned: FloatArray
    tcp_path_length: FloatArray
    planning_time: FloatArray
    planning_cpu_time: FloatArray
    simplification_time: FloatArray
    execution_time: FloatArray
    goal_configuration: FloatArray
    path_reachability: FloatArray
    scan_configuration: FloatArray
    joint_names: tuple[str, ...]
    body_pairs: tuple[str, ...]
    paths: PathStore
    stamp: Stamp
    provenance: Provenance
    run: RunInfo = RunInfo()
    hit_time_limit: CodeArray = field(default_factory=lambda: np.zeros(0, np.uint8))
    component: IntArray | None = None
    components: Components | None = None
    effort: Effort | None = None
    best: BestPaths | None = None
    winning_roll: FloatArray | None = None
    times: ApproachTimes | None = None
    margins: Margins | None = None
    cycle: Cycle | None = None
    part_corners: FloatArray | None = None
    lift_above_rim: FloatArray | None = None
    refinement: Refinement | None = None
    T_world_base: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.hit_time_limit.size == 0:
            object.__setattr__(self, "hit_time_limit", np.zeros_like(self.path_found))
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class BinPlacement(Shown):
    """Placement of the bin, the configuration that images it, and the runners-up.

    Candidates are rows: the chosen one is row ``chosen``.

    Attributes
    ----------
    bin_pose : array, shape (4, 4)
        T_base_bin of the chosen candidate.
    candidate_pose : array, shape (n, 4)
        x, y, z [m], yaw [rad] of each candidate in the level frame.
    T_base_level : array, shape (4, 4)
        The level frame, which is upright; robot_base where that stands upright.
    score : array, shape (n,)
        Mean path reachability over the pick volume [percent], NaN if excluded.
    worst_point, reachable_share : array, shape (n,)
        Percent.
    exact : uint8 array, shape (n,)
        1 where the bin was in the scene, 0 where the map was interpolated.
    reason : tuple of str
        Why a candidate is excluded, "" if it is not.
    margin : mapping
        Direction ("+x", "-yaw", …) to how far it can move [m, rad] for 5 points.
    tolerance : pair of float, or None
        Shift [m] and turn [rad] under which ``worst_score`` is taken.
    worst_score, score_error : array, shape (n,), or None
        Least score under the tolerance; standard error of ``score`` [percent].
    support : str or None
        Body that the bin stands on, "" if it stands on none.
    T_world_base : array, shape (4, 4), or None
    """

    bin_pose: FloatArray
    scan_configuration: FloatArray
    chosen: int
    runner_up: int
    paper_choice: int
    rule: str
    candidate_pose: FloatArray
    score: FloatArray
    worst_point: FloatArray
    reachable_share: FloatArray
    exact: CodeArray
    reason: tuple[str, ...]
    margin: Mapping[str, float]
    joint_names: tuple[str, ...]
    stamp: Stamp
    provenance: Provenance
    run: RunInfo = RunInfo()
    tolerance: tuple[float, float] | None = None
    worst_score: FloatArray | None = None
    score_error: FloatArray | None = None
    support: str | None = None
    T_world_base: FloatArray | None = None
    T_base_level: FloatArray = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        freeze(self)

    def T_level_bin(self, row: int | None = None) -> FloatArray:  # noqa: N802
        """The chosen bin, or a candidate's, in the level frame, shape (4, 4)."""
        return yaw_transform(*self.candidate_pose[self.chosen if row is None else row])


KINDS = ("path", "ik", "ik_free")
"""Kinds of reachability: with a path, with a solution, with a solution that is free."""


def stitch_cubes(cubes: Mapping[str, CubeMap]) -> Stitching:
    """Join the lattices of the cubes; points are matched by position."""
    return stitch([Lattice(x=cube.x, y=cube.y, z=cube.z) for cube in cubes.values()])


def pooled_reachability(
    cubes: Mapping[str, CubeMap], stitching: Stitching, kind: str
) -> FloatArray:
    """Eq. (1) over the frames of all cubes [percent], shape (nz, ny, nx)."""
    counts = [cube.counts(kind) for cube in cubes.values()]
    hits, attempts = zip(*counts, strict=True)
    return pooled_percent(stitching, hits, attempts)


def workspace_map_from_cubes(cubes: Mapping[str, CubeMap], **rest: Any) -> WorkspaceMap:
    """Build the record of a workspace map from its cubes.

    Parameters
    ----------
    cubes : mapping of str to CubeMap
    **rest
        The other fields of :class:`WorkspaceMap`; lattice and percentages are computed.
    """
    stitching = stitch_cubes(cubes)
    lattice = stitching.lattice
    path, ik, ik_free = (pooled_reachability(cubes, stitching, k) for k in KINDS)
    return WorkspaceMap(
        cubes=dict(cubes),
        x=lattice.x,
        y=lattice.y,
        z=lattice.z,
        path_reachability=path,
        ik_reachability=ik,
        ik_free_reachability=ik_free,
        **rest,
    )
