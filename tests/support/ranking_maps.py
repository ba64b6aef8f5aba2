"""Bin maps with invented measurements, for ranking without any planning."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from reachmap.cell.model.orientations import ConeFamily
from reachmap.geometry import quaternion_wxyz_from_rotation, yaw_transform
from reachmap.maps.parts import Effort, PathStore
from reachmap.maps.records import BinMap, Provenance, Stamp, Status
from reachmap.sampling.orientations import orientation_set

BODY_PAIRS = ("camera housing | bin wall +x", "gripper | bin bottom")
CELL: dict[str, Any] = {
    "robot": {"base_pose": {"xyz": [0, 0, 0.8], "rpy_deg": [0, 0, 90]}},
    "bodies": [
        {"name": "table", "attach_to": "world", "pose": {"xyz": [1, 0, 0]}},
        {"name": "rail", "attach_to": "robot_base", "pose": {"xyz": [0, 2, 0]}},
        {"name": "camera housing", "attach_to": "tool0", "pose": {}},
    ],
}


def make_bin_map(
    *,
    shape: tuple[int, int, int] = (1, 5, 7),
    family: ConeFamily | None = None,
    repeats: int = 5,
    reachable: float = 0.7,
    seed: int = 0,
    approach_axis: str = "+z",
    bin_pose: np.ndarray | None = None,
    **changes: Any,
) -> BinMap:
    """A bin map with random outcomes on a lattice 0.36 × 0.26 m inside.

    ``reachable`` is the share of test grasps that can be reached at all; of these,
    about one attempt in five fails as well.
    """
    rng = np.random.default_rng(seed)
    nl, ny, nx = shape
    family = family or ConeFamily(tilts_deg=(0.0, 30.0), azimuths=(1, 8), rolls=3)
    pose = yaw_transform(0.5, 0.1, -0.05, 0.3) if bin_pose is None else bin_pose
    R_bin = orientation_set(family, approach_axis)
    no = len(R_bin)
    layer = 0.05 + 0.04 * np.arange(nl)
    y = (np.arange(ny) - (ny - 1) / 2) * (0.26 / ny)
    x = (np.arange(nx) - (nx - 1) / 2) * (0.36 / nx)
    zz, yy, xx = np.meshgrid(layer, y, x, indexing="ij")
    points = np.stack([xx, yy, zz], axis=-1)
    position = points @ pose[:3, :3].T + pose[:3, 3]
    quaternion = quaternion_wxyz_from_rotation(pose[:3, :3] @ R_bin)
    grid = (nl, ny, nx, no)
    can = rng.random(grid) < reachable
    found = can[..., None] & (rng.random((*grid, repeats)) < 0.8)
    found[..., 0] |= can & ~found.any(axis=-1)
    causes = np.array([Status.NO_IK, Status.IK_IN_COLLISION, Status.NO_PATH_FOUND])
    status = np.where(can, Status.PATH_FOUND, rng.choice(causes, grid)).astype(np.uint8)
    pair = rng.integers(0, len(BODY_PAIRS), grid)
    sought = np.isin(status, (Status.PATH_FOUND, Status.NO_PATH_FOUND))
    blocking = np.where(status == Status.IK_IN_COLLISION, pair, -1).astype(np.int16)

    def measured(low: float, high: float) -> np.ndarray:
        return np.where(found, rng.uniform(low, high, found.shape), np.nan)

    fields: dict[str, Any] = {
        "layer": layer,
        "y": y,
        "x": x,
        "bin_pose": pose,
        "bin_inner": np.array([0.36, 0.26, 0.15]),
        "position": position,
        "quaternion_wxyz": np.broadcast_to(quaternion, (*grid, 4)).copy(),
        "approach_axis": approach_axis,
        "approach_distance": 0.0,
        "status": status,
        "blocking_pair": blocking,
        "n_ik": np.where(status == Status.NO_IK, 0, 4).astype(np.uint8),
        "n_ik_free": np.where(sought, 2, 0).astype(np.uint8),
        "connected": can.astype(np.uint8),
        "path_found": found.astype(np.uint8),
        "path_length": measured(1.0, 6.0),
        "path_length_planned": measured(1.0, 6.0),
        "tcp_path_length": measured(0.3, 2.0),
        "planning_time": measured(0.01, 0.2),
        "planning_cpu_time": measured(0.01, 0.2),
        "simplification_time": measured(0.001, 0.01),
        "execution_time": measured(0.5, 3.0),
        "goal_configuration": np.where(can[..., None], np.zeros(6), np.nan),
        "path_reachability": 100.0 * can.mean(axis=-1),
        "scan_configuration": np.zeros(6),
        "effort": Effort(
            checks=np.where(found, rng.integers(1, 4000, found.shape), 0),
            seconds_per_check=2e-5,
        ),
        "joint_names": tuple(f"joint_{i}" for i in range(6)),
        "body_pairs": BODY_PAIRS,
        "paths": PathStore(
            configuration=np.zeros((0, 6)),
            row_size=np.zeros(0, np.int64),
            planned_size=np.zeros(0, np.int64),
            index=np.zeros((0, 5), np.int64),
        ),
        "stamp": Stamp(seed=1, cell_sha256="c" * 64, config_sha256="d" * 64,
                       content_sha256="e" * 64),
        "provenance": Provenance(cell_yaml="", cell_resolved_json=json.dumps(CELL)),
    }  # fmt: skip
    return BinMap(**{**fields, **changes})
