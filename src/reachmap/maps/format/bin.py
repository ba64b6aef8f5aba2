"""Bin maps: record to file and back."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.bytes.tree import Array, Tree
from reachmap.maps.format.assembly import assemble, provenance_of, run_of, stamp_of
from reachmap.maps.format.checks import (
    check_coordinates,
    check_goals,
    check_outcome,
    check_percent,
    check_pose,
    check_quaternions,
    require,
)
from reachmap.maps.format.layout import (
    COMMON_SCALES,
    NONNEGATIVE,
    PERCENT,
    SCAN,
    Layout,
    Variable,
    coordinate,
    goal,
    index,
    outcome,
)
from reachmap.maps.format.store import load, store
from reachmap.maps.records import BinMap, PathStore, Status

INDEX_COLUMNS = ("layer", "y", "x", "orientation", "repeat")
"""What the columns of ``/paths/index`` count."""

_PATH_VALUES = (
    "path_length", "path_length_planned", "tcp_path_length", "execution_time",
    "planning_time", "planning_cpu_time", "simplification_time",
)  # fmt: skip
# The keys of reachmap.geometry.AXES, without waiting for SciPy.
_AXES = tuple(f"{sign}{name}" for name in "xyz" for sign in "+-")
_LENGTH_TOLERANCE_RAD = 1e-6


def check_bin(tree: Tree) -> list[str]:
    """Outcome, attempts, poses, percentages and stored paths."""
    status = tree.array("status")
    found = tree.array("path_found") == 1
    any_found = found.any(axis=-1)
    connected = tree.array("connected") == 1
    attempted = status != Status.NOT_ATTEMPTED
    percent = np.full(status.shape[:-1], np.nan)
    np.divide(
        100.0 * (status == Status.PATH_FOUND).sum(axis=-1),
        attempted.sum(axis=-1),
        out=percent,
        where=attempted.any(axis=-1),
    )
    problems = [
        *_check_approach(tree),
        *check_outcome(tree, ""),
        *check_quaternions(tree.array("quaternion_wxyz"), ""),
        *check_coordinates(tree, "", ("layer", "y", "x")),
        *check_pose(tree.array("bin_pose")),
        *require(
            (status == Status.PATH_FOUND) | ~any_found,
            "status must be path_found where an attempt found a path",
        ),
        *require(
            (status != Status.PATH_FOUND) | any_found | connected,
            "status must not be path_found without an attempt or a connection",
        ),
        *check_goals(tree.array("goal_configuration"), any_found, ""),
        *check_percent(tree, "path_reachability", percent),
    ]
    for name in _PATH_VALUES:
        problems += require(
            np.isfinite(tree.array(name)) == found,
            f"{name} must be finite exactly where path_found is 1",
        )
    return problems or _check_paths(tree)


def _check_approach(tree: Tree) -> list[str]:
    axis = tree.attributes["approach_axis"]
    distance = tree.attributes["approach_distance_m"]
    problems = []
    if axis not in _AXES:
        problems.append(f"approach_axis must be one of {', '.join(_AXES)}")
    if not isinstance(distance, float) or not 0.0 <= distance < np.inf:
        problems.append("approach_distance_m must be a length")
    return problems


def _check_paths(tree: Tree) -> list[str]:
    """Check that stored paths are whole, found, and as long as the map says."""
    index = tree.array("paths/index")
    rows, planned = tree.array("paths/row_size"), tree.array("paths/planned_size")
    points = tree.array("paths/configuration")
    found = tree.array("path_found") == 1
    if index.shape[1:] != (5,) or int(rows.sum()) != len(points):
        return ["paths/row_size must add up to the stored way-points"]
    if (planned > rows).any():
        return ["paths/planned_size must not exceed row_size"]
    if index.size == 0:
        return []
    if (index >= np.array(found.shape)).any():
        return ["paths/index must name test grasps and attempts of this map"]
    place = tuple(index.T)
    whole, part = path_lengths(points, rows, planned)
    return [
        *require(found[place], "paths/index must name attempts that found a path"),
        *require(
            np.abs(whole - tree.array("path_length")[place])
            <= _LENGTH_TOLERANCE_RAD * (1.0 + whole),
            "paths must be as long as path_length says",
        ),
        *require(
            np.abs(part - tree.array("path_length_planned")[place])
            <= _LENGTH_TOLERANCE_RAD * (1.0 + part),
            "paths must be as long as path_length_planned says up to planned_size",
        ),
    ]


def path_lengths(
    points: FloatArray, rows: Array, planned: Array
) -> tuple[FloatArray, FloatArray]:
    """Joint-space lengths of ragged paths [rad]: whole, and of the planned part.

    Parameters
    ----------
    points : array, shape (points, dof)
    rows, planned : int array, shape (paths,)
        Way-points of each path, and of its planned part.
    """
    # Length up to each way-point as if all paths were one; jumps between paths cancel.
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    first = np.cumsum(rows) - rows
    start = travelled[first]
    whole = travelled[first + rows - 1] - start
    return np.asarray(whole), np.asarray(travelled[first + planned - 1] - start)


_POINT = ("layer", "y", "x")
_GRASP = (*_POINT, "orientation")
_TRY = (*_GRASP, "repeat")


def _measured(name: str, units: str, meaning: str) -> Variable:
    return Variable(
        path=name,
        dims=_TRY,
        dtype="f8",
        units=units,
        meaning=f"{meaning}; NaN where no path was found.",
        **NONNEGATIVE,
    )


BIN = Layout(
    kind="bin_map",
    check=check_bin,
    title="Path reachability of test grasps in a bin",
    signal="path_reachability",
    axes=_POINT,
    attributes={
        "approach_axis": "TCP axis that points into the object, as in `+z`.",
        "approach_distance_m": "Length of the straight approach; 0: none.",
        "joint_names": "Names of the joints, in order.",
        "body_pairs": "Names of two bodies each; blocking_pair counts in this list.",
    },
    variables=(
        coordinate("layer", "Heights above the inner bottom.", "bin"),
        coordinate("y", "Rows of test points.", "bin"),
        coordinate("x", "Columns of test points.", "bin"),
        index("orientation", "Test grasps at a point."),
        index("repeat", "Attempts at a test grasp."),
        *COMMON_SCALES,
        index("xyz", "Coordinates x, y, z."),
        index("pose_row", "Rows of a homogeneous matrix."),
        index("pose_column", "Columns of a homogeneous matrix."),
        Variable(
            path="path_reachability",
            dims=_POINT,
            dtype="f8",
            meaning="Share of test grasps with a collision-free path, Eq. (1).",
            nan=True,
            **PERCENT,
        ),
        Variable(
            path="bin_pose",
            dims=("pose_row", "pose_column"),
            dtype="f8",
            units="m",
            meaning="T_base_bin; the rotation block has no unit.",
            frame="robot_base",
        ),
        Variable(
            path="bin_inner",
            dims=("xyz",),
            dtype="f8",
            units="m",
            meaning="Inner sides along x and y, and depth.",
            frame="bin",
            low=0.0,
        ),
        SCAN,
        Variable(
            path="position",
            dims=(*_POINT, "xyz"),
            dtype="f8",
            units="m",
            meaning="TCP position of the test grasps, d_test.",
            frame="robot_base",
        ),
        Variable(
            path="quaternion_wxyz",
            dims=(*_GRASP, "quat"),
            dtype="f8",
            units="1",
            meaning="TCP orientation of the test grasps, R_test, unit quaternion.",
            frame="robot_base",
        ),
        *outcome("", _GRASP),
        Variable(
            path="connected",
            dims=_GRASP,
            dtype="u1",
            units="1",
            meaning="1 where the roadmap proves a path, found by an attempt or not.",
            is_flag=True,
        ),
        Variable(
            path="path_found",
            dims=_TRY,
            dtype="u1",
            units="1",
            meaning="1 where the attempt found a path.",
            is_flag=True,
        ),
        Variable(
            path="hit_time_limit",
            dims=_TRY,
            dtype="u1",
            units="1",
            meaning="1 where the limit on wall-clock time ended the attempt.",
            is_flag=True,
        ),
        _measured("path_length", "rad", "Joint-space length of the whole path"),
        _measured(
            "path_length_planned", "rad", "Joint-space length of the planned part"
        ),
        _measured("tcp_path_length", "m", "Length of the way of the TCP, whole path"),
        _measured("planning_time", "s", "Wall-clock time of the planner"),
        _measured("planning_cpu_time", "s", "CPU time of the planning thread"),
        _measured("simplification_time", "s", "CPU time of shortening the path"),
        _measured("execution_time", "s", "Time optimum of the whole path"),
        goal("", _GRASP, " on the shortest path"),
        index("paths/path", "Stored paths."),
        index("paths/point", "Way-points of all stored paths."),
        index(
            "paths/index_column",
            "What index counts: layer, y, x, orientation, repeat.",
            labels="columns",
        ),
        Variable(
            path="paths/configuration",
            dims=("point", "joint"),
            dtype="f8",
            units="rad",
            meaning="Joint positions at the way-points, path after path.",
        ),
        Variable(
            path="paths/row_size",
            dims=("path",),
            dtype="i4",
            units="1",
            meaning="Number of way-points of each path.",
            low=1,
        ),
        Variable(
            path="paths/planned_size",
            dims=("path",),
            dtype="i4",
            units="1",
            meaning="Way-points that are planned; the rest is the straight approach.",
            low=1,
        ),
        Variable(
            path="paths/index",
            dims=("path", "index_column"),
            dtype="i4",
            units="1",
            meaning="Test grasp and attempt of each path.",
            low=0,
            labels="columns",
        ),
    ),
)


_NOT_ARRAYS = {
    "approach_axis", "approach_distance", "joint_names", "body_pairs", "paths",
    "stamp", "provenance", "run",
}  # fmt: skip
_ARRAYS = tuple(
    item.name for item in dataclasses.fields(BinMap) if item.name not in _NOT_ARRAYS
)
_PATHS = tuple(item.name for item in dataclasses.fields(PathStore))


def write_bin_map(path: Path, record: BinMap, overwrite: bool = False) -> str:
    """Write a bin map.

    Parameters
    ----------
    path : Path
    record : BinMap
        Its ``stamp.content_sha256`` is not used: it is computed from the numbers.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    str
        ``content_sha256``.

    Raises
    ------
    OutputError
        The file exists, or nothing can be written there.
    EngineError
        The record breaks the format.
    """
    return store(path, tree_from_bin_map(record), BIN, overwrite=overwrite)


def tree_from_bin_map(record: BinMap) -> Tree:
    """Everything that the file will hold."""
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _ARRAYS}
    arrays.update({f"paths/{n}": getattr(record.paths, n) for n in _PATHS})
    return assemble(
        BIN,
        arrays=arrays,
        attributes={
            "approach_axis": record.approach_axis,
            "approach_distance_m": float(record.approach_distance),
        },
        labels={
            "joint_names": record.joint_names,
            "body_pairs": record.body_pairs,
            "columns": INDEX_COLUMNS,
        },
        stamp=record.stamp,
        provenance=record.provenance,
        run=record.run,
    )


def read_bin_map(path: Path) -> BinMap:
    """Read a bin map; everything about it is checked.

    Raises
    ------
    MapFileError
        The file is missing, damaged, or something else.
    """
    tree, _ = load(path, BIN)
    return bin_map_from_tree(tree, path)


def bin_map_from_tree(tree: Tree, path: Path) -> BinMap:
    """Turn a checked tree into a record; ``path`` is named in messages."""
    return BinMap(
        **{name: tree.array(name) for name in _ARRAYS},
        approach_axis=str(tree.attributes["approach_axis"]),
        approach_distance=float(tree.attributes["approach_distance_m"]),
        joint_names=tuple(tree.attributes["joint_names"]),
        body_pairs=tuple(tree.attributes["body_pairs"]),
        paths=PathStore(**{name: tree.array(f"paths/{name}") for name in _PATHS}),
        stamp=stamp_of(tree),
        provenance=provenance_of(tree, path),
        run=run_of(tree, path),
    )
