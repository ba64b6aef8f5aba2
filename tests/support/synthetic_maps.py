"""Small valid artefacts with a given pattern of reachability.

    from tests.support.synthetic_maps import synthetic_bin_map, synthetic_workspace_map

Each keeps to the format, so it can be written, read and verified. Frames that are not
reachable get causes in turn: no solution, all in collision, no path.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.cell.model.cell import BinScanSpec, BinSpec, Cell, RobotSpec, TcpSpec
from reachmap.cell.model.orientations import ConeFamily
from reachmap.cell.text.expressions import resolve_expressions
from reachmap.cell.text.yaml_reader import parse_yaml
from reachmap.geometry import quaternion_wxyz_from_rotation, yaw_transform
from reachmap.maps.format.checks import path_lengths
from reachmap.maps.parts import PathStore
from reachmap.maps.records import (
    NO_PAIR,
    BinMap,
    BinPlacement,
    CubeMap,
    Provenance,
    RunInfo,
    Stamp,
    Status,
    WorkspaceMap,
    workspace_map_from_cubes,
)
from reachmap.sampling.frames import bin_test_frames
from reachmap.sampling.orientations import orientation_set

JOINTS = ("pan", "lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
BODY_PAIRS = (
    "camera housing | bin wall +x",
    "gripper | bin floor",
    "forearm | pedestal",
)
SCAN = np.array([0.0, -1.9, 1.7, -1.4, -1.6, 0.0])
CAUSES = (Status.NO_IK, Status.IK_IN_COLLISION, Status.NO_PATH_FOUND)
CELL = Path(__file__).parents[2] / "cells" / "ur5-eye-in-hand.yaml"


@cache
def cell_json() -> str:
    """The shipped cell as resolved JSON, without looking up its meshes."""
    document = parse_yaml(CELL.read_text(encoding="utf-8"), str(CELL))
    resolve_expressions(document)
    return Cell.model_validate(document.data).model_dump_json()


def synthetic_provenance(**changes: Any) -> Provenance:
    """Provenance with something in every field."""
    fields: dict[str, Any] = {
        "cell_yaml": CELL.read_text(encoding="utf-8"),
        "cell_resolved_json": cell_json(),
        "overrides": ("seed=1",),
        "urdf": "<robot name='synthetic'/>",
        "srdf": "",
        "files_sha256": {"body camera: housing.stl": "ab" * 32},
        "packages": {"python": "3.11.7", "numpy": "2.4.6"},
        "settings": {"repeats": 5, "planner": {"name": "LBKPIECE1"}},
        "source_sha256": "",
    }
    return Provenance(**{**fields, **changes})


def synthetic_run() -> RunInfo:
    """A run with something in every field."""
    return RunInfo(
        started="2026-01-02T03:04:05+00:00",
        finished="2026-01-02T03:05:05+00:00",
        host="bench",
        command_line="reachmap synthetic",
        workers=2,
        wall_s={"plan": 60.0},
        cpu_s={"plan": 110.5},
    )


def synthetic_stamp(seed: int = 1) -> Stamp:
    """Hashes that look like hashes."""
    return Stamp(seed=seed, cell_sha256="c" * 64, config_sha256="d" * 64)


def statuses(reachable: Any) -> np.ndarray:
    """Status codes (uint8) for a boolean array; causes take turns."""
    turn = np.arange(reachable.size).reshape(reachable.shape) % len(CAUSES)
    causes = np.array([int(cause) for cause in CAUSES], np.uint8)[turn]
    return np.where(reachable, np.uint8(Status.PATH_FOUND), causes).astype(np.uint8)


def frames_from_fraction(fraction: np.ndarray, orientations: int) -> np.ndarray:
    """Booleans (..., orientations), the first ones True."""
    count = np.rint(np.asarray(fraction, float) * orientations)
    return np.arange(orientations) < count[..., None]


def _outcome(status: np.ndarray) -> dict[str, Any]:
    """Solutions and blocking pairs that go with a status."""
    collision = status == Status.IK_IN_COLLISION
    turn = np.arange(status.size).reshape(status.shape) % len(BODY_PAIRS)
    free = np.isin(status, [Status.PATH_FOUND, Status.NO_PATH_FOUND])
    return {
        "blocking_pair": np.where(collision, turn, NO_PAIR).astype(np.int32),
        "n_ik": np.where(collision | free, 8, 0).astype(np.uint8),
        "n_ik_free": np.where(free, 3, 0).astype(np.uint8),
    }


def synthetic_cube(
    status: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray, seed: int = 1
) -> CubeMap:
    """A cube with the given status codes, shape (nz, ny, nx, orientations)."""
    rng = np.random.default_rng(seed)
    count = status.shape[-1]
    family = orientation_set(ConeFamily(tilts_deg=(20.0,), azimuths=(count,), rolls=1))
    found = status == Status.PATH_FOUND
    goal = np.where(found[..., None], rng.uniform(-3, 3, (*status.shape, 6)), np.nan)
    return CubeMap(
        x=np.asarray(x, float),
        y=np.asarray(y, float),
        z=np.asarray(z, float),
        quaternion_wxyz=quaternion_wxyz_from_rotation(family),
        status=status.astype(np.uint8),
        **_outcome(status),
        attempts=np.where(status >= Status.PATH_FOUND, 5, 0).astype(np.uint8),
        paths_found=np.where(found, 5, 0).astype(np.uint8),
        component=np.where(found, 0, -1).astype(np.int32),
        path_length=np.where(found, rng.uniform(0.5, 6, status.shape), np.nan),
        goal_configuration=goal,
    )


def synthetic_workspace_map(
    reachable: np.ndarray,
    *,
    x: np.ndarray | None = None,
    y: np.ndarray | None = None,
    z: np.ndarray | None = None,
    shared_row: int | None = None,
    status: np.ndarray | None = None,
    orientations: int = 4,
    seed: int = 1,
) -> WorkspaceMap:
    """A workspace map with a given pattern.

    Parameters
    ----------
    reachable : array, shape (nz, ny, nx) or (nz, ny, nx, no)
        Fractions from 0 to 1 per point, or booleans per frame.
    x, y, z : array, optional
        Coordinates [m]; steps of 0.1 from (0.2, -0.2, 0.0) if left out.
    shared_row : int, optional
        Row of y that two cubes "right" (rows up to it) and "left" (rows from it)
        share; one cube "all" if left out.
    status : array, optional
        Status codes per frame, instead of causes in turn.
    orientations : int
        Test frames per point where fractions are given.
    """
    reachable = np.asarray(reachable)
    if reachable.ndim == 3:
        reachable = frames_from_fraction(reachable, orientations)
    status = statuses(reachable) if status is None else np.asarray(status, np.uint8)
    nz, ny, nx = status.shape[:3]
    x = np.round(0.2 + 0.1 * np.arange(nx), 12) if x is None else np.asarray(x)
    y = np.round(-0.2 + 0.1 * np.arange(ny), 12) if y is None else np.asarray(y)
    z = np.round(0.1 * np.arange(nz), 12) if z is None else np.asarray(z)
    if shared_row is None:
        cubes = {"all": synthetic_cube(status, x, y, z, seed)}
    else:
        right, left = slice(0, shared_row + 1), slice(shared_row, None)
        cubes = {
            "right": synthetic_cube(status[:, right], x, y[right], z, seed),
            "left": synthetic_cube(status[:, left], x, y[left], z, seed + 1),
        }
    return workspace_map_from_cubes(
        cubes,
        scan_configuration=SCAN,
        joint_names=JOINTS,
        body_pairs=BODY_PAIRS,
        method="roadmap",
        stamp=synthetic_stamp(seed),
        provenance=synthetic_provenance(),
        run=synthetic_run(),
    )


def synthetic_bin_map(
    path_found: np.ndarray | float = 0.8,
    *,
    shape: tuple[int, int, int, int, int] = (1, 4, 5, 6, 3),
    bin_pose: np.ndarray | None = None,
    status: np.ndarray | None = None,
    connected: np.ndarray | None = None,
    seed: int = 1,
) -> BinMap:
    """A bin map with given attempts.

    Parameters
    ----------
    path_found : array, shape (nl, ny, nx, no, nr), or float
        Which attempts found a path, or the chance that one does.
    shape : tuple
        (nl, ny, nx, no, nr) where a chance is given.
    bin_pose : array, shape (4, 4), optional
        T_base_bin; (0.5, 0.1, -0.05) turned by 90 degrees if left out.
    status : array, shape (nl, ny, nx, no), optional
        Status codes, instead of path_found where an attempt did and causes in turn.
    connected : array, same shape, optional
        Frames that the roadmap proves; where an attempt found a path if left out.
    """
    rng = np.random.default_rng(seed)
    if np.ndim(path_found) == 0:
        path_found = rng.random(shape) < path_found
    found = np.asarray(path_found).astype(bool)
    nl, ny, nx, no, _ = found.shape
    T_base_bin = (
        yaw_transform(0.5, 0.1, -0.05, np.pi / 2) if bin_pose is None else bin_pose
    )
    spec = BinScanSpec(
        grid=(nx, ny),
        layers=tuple(0.05 * (1 + np.arange(nl))),
        orientations=ConeFamily(tilts_deg=(20.0,), azimuths=(no,), rolls=1),
    )
    fields: dict[str, Any] = {
        "robot": RobotSpec(urdf="arm.urdf", tcp=TcpSpec(parent="tool")),
        "bin": BinSpec(inner=(0.36, 0.26, 0.15)),
        "bin_scan": spec,
    }
    cell = Cell.model_construct(**fields)
    frames = bin_test_frames(cell, T_base_bin)
    T = frames.T_base_tcp
    tried = np.asarray(found.any(axis=-1))
    proved = tried if connected is None else np.asarray(connected, bool)
    status = statuses(tried | proved) if status is None else status
    paths = synthetic_paths(found, rng)
    values = _path_values(found, paths, rng)
    goal = np.where(tried[..., None], rng.uniform(-3, 3, (*status.shape, 6)), np.nan)
    attempted = (status != Status.NOT_ATTEMPTED).sum(axis=-1)
    hits = (status == Status.PATH_FOUND).sum(axis=-1)
    percent = np.where(attempted > 0, 100.0 * hits / np.maximum(attempted, 1), np.nan)
    return BinMap(
        layer=frames.layer,
        y=frames.y,
        x=frames.x,
        bin_pose=np.array(T_base_bin),
        bin_inner=np.array(cell.bin.inner),
        position=np.array(T[..., 0, :3, 3]),
        quaternion_wxyz=quaternion_wxyz_from_rotation(T[..., :3, :3]),
        approach_axis="+z",
        approach_distance=0.03,
        status=np.asarray(status, np.uint8),
        **_outcome(np.asarray(status)),
        connected=proved.astype(np.uint8),
        path_found=found.astype(np.uint8),
        **values,
        goal_configuration=goal,
        path_reachability=percent,
        scan_configuration=SCAN,
        joint_names=JOINTS,
        body_pairs=BODY_PAIRS,
        paths=paths,
        stamp=synthetic_stamp(seed),
        provenance=synthetic_provenance(),
        run=synthetic_run(),
    )


def synthetic_paths(found: np.ndarray, rng: np.random.Generator) -> PathStore:
    """A path of two to five waypoints for every attempt that found one."""
    index = np.argwhere(found).astype(np.int32)
    planned = rng.integers(2, 5, len(index)).astype(np.int32)
    rows = planned + 1
    configuration = rng.uniform(-3, 3, (int(rows.sum()), 6))
    configuration[np.cumsum(rows) - rows] = SCAN
    return PathStore(
        configuration=configuration, row_size=rows, planned_size=planned, index=index
    )


def _path_values(
    found: np.ndarray, paths: PathStore, rng: np.random.Generator
) -> dict[str, Any]:
    whole, planned = path_lengths(
        paths.configuration, paths.row_size, paths.planned_size
    )
    place = tuple(paths.index.T)
    lengths = {"path_length": whole, "path_length_planned": planned}
    values: dict[str, Any] = {}
    for name, length in lengths.items():
        values[name] = np.full(found.shape, np.nan)
        values[name][place] = length
    for name in ("tcp_path_length", "planning_time", "planning_cpu_time",
                 "simplification_time", "execution_time"):  # fmt: skip
        values[name] = np.where(found, rng.uniform(0.1, 2.0, found.shape), np.nan)
    return values


def synthetic_placement(**changes: Any) -> BinPlacement:
    """Four candidates: the chosen one, a runner-up, the paper's, an excluded one."""
    poses = np.array(
        [[0.5, 0.1, -0.05, 1.5], [0.3, -0.3, 0.0, 0.0], [0.6, 0.0, 0.0, 0.0],
         [0.0, 0.0, 0.0, 0.7]]
    )  # fmt: skip
    fields: dict[str, Any] = {
        "bin_pose": yaw_transform(*poses[0]),
        "scan_configuration": SCAN,
        "chosen": 0,
        "runner_up": 1,
        "paper_choice": 2,
        "rule": "search",
        "candidate_pose": poses,
        "score": np.array([96.5, 91.0, 88.25, np.nan]),
        "worst_point": np.array([70.0, 55.0, 40.0, np.nan]),
        "reachable_share": np.array([96.0, 91.5, 88.0, np.nan]),
        "exact": np.array([1, 1, 1, 0], np.uint8),
        "reason": ("", "", "", "the bin collides with pedestal"),
        "margin": {"+x": 0.12, "-x": 0.08, "+yaw": 0.4, "-yaw": 0.35},
        "joint_names": JOINTS,
        "stamp": synthetic_stamp(),
        "provenance": synthetic_provenance(source_sha256="e" * 64),
        "run": synthetic_run(),
    }
    return BinPlacement(**{**fields, **changes})
