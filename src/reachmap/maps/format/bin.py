"""Bin maps: record to file and back."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from reachmap.geometry import AXES
from reachmap.maps.bytes.tree import Tree
from reachmap.maps.format.assembly import (
    assemble,
    origin_of,
    section_arrays,
    sections_of,
)
from reachmap.maps.format.bin_checks import check_bin
from reachmap.maps.format.layout import (
    COMMON_SCALES,
    GRASP,
    NONNEGATIVE,
    PERCENT,
    POINT,
    SCAN,
    Layout,
    Variable,
    coordinate,
    goal,
    index,
    outcome,
)
from reachmap.maps.format.sections import BIN_SECTIONS
from reachmap.maps.format.store import RecordFile
from reachmap.maps.parts import PathStore
from reachmap.maps.records import BinMap
from reachmap.maps.summary.directions import reachability_of_directions

INDEX_COLUMNS = ("layer", "y", "x", "orientation", "repeat")
"""What the columns of ``/paths/index`` count."""

_TRY = (*GRASP, "repeat")


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
    sections=BIN_SECTIONS,
    title="Path reachability of test grasps in a bin",
    signal="path_reachability",
    axes=POINT,
    attributes={
        "approach_axis": "TCP axis that points into the object, as in `+z`.",
        "approach_distance_m": "Length of the straight approach; 0: none.",
        "joint_names": "Names of the joints, in order.",
        "body_pairs": "Names of two bodies each; blocking_pair indexes this list.",
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
            dims=POINT,
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
            dims=(*POINT, "xyz"),
            dtype="f8",
            units="m",
            meaning="TCP position of the test grasps, d_test.",
            frame="robot_base",
        ),
        Variable(
            path="quaternion_wxyz",
            dims=(*GRASP, "quat"),
            dtype="f8",
            units="1",
            meaning="TCP orientation of the test grasps, R_test, unit quaternion.",
            frame="robot_base",
        ),
        *outcome("", GRASP),
        Variable(
            path="connected",
            dims=GRASP,
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
        _measured(
            "execution_time",
            "s",
            "Time optimum of the planned part and of the straight approach, at rest "
            "between them",
        ),
        goal("", GRASP, " on the shortest path"),
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
            meaning="Test grasp and attempt of each path; repeat -1: no attempt.",
            low=-1,
            labels="columns",
        ),
    ),
)


_ARRAYS = tuple(
    variable.name
    for variable in BIN.variables
    if not variable.group
    and variable.name in {item.name for item in dataclasses.fields(BinMap)}
)
_PATHS = ("configuration", "row_size", "planned_size", "index")


def tree_from_bin_map(record: BinMap) -> Tree:
    """Everything that the file will hold."""
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _ARRAYS}
    arrays.update({f"paths/{n}": getattr(record.paths, n) for n in _PATHS})
    if record.approach_axis in AXES:
        directions, points = reachability_of_directions(record)
        arrays["direction_reachability"] = directions
        arrays["point_reachability"] = points
    optional, lists, numbers = section_arrays(BIN, record)
    arrays.update(optional)
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
            **lists,
        },
        numbers=numbers,
        stamp=record.stamp,
        provenance=record.provenance,
        run=record.run,
    )


def bin_map_from_tree(tree: Tree, path: Path) -> BinMap:
    """Turn a checked tree into a record; ``path`` is named in messages."""
    sections = sections_of(BIN, tree)
    stage = sections.pop("paths.stage", None)
    paths = {name: tree.array(f"paths/{name}") for name in _PATHS}
    arrays: dict[str, Any] = {name: tree.array(name) for name in _ARRAYS}
    return BinMap(
        **arrays,
        approach_axis=str(tree.attributes["approach_axis"]),
        approach_distance=float(tree.attributes["approach_distance_m"]),
        joint_names=tuple(tree.attributes["joint_names"]),
        body_pairs=tuple(tree.attributes["body_pairs"]),
        paths=PathStore(**paths, stage=stage),
        **origin_of(tree, path),
        **sections,
    )


_FILE = RecordFile(layout=BIN, to_tree=tree_from_bin_map, from_tree=bin_map_from_tree)
write_bin_map, read_bin_map = _FILE.write, _FILE.read
