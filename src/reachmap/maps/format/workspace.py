"""Workspace maps: record to file and back."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.maps.bytes.tree import Tree
from reachmap.maps.format.assembly import (
    assemble,
    origin_of,
    section_arrays,
    sections_of,
)
from reachmap.maps.format.checks import (
    check_components,
    check_coordinates,
    check_goals,
    check_outcome,
    check_percent,
    check_quaternions,
    check_world,
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
from reachmap.maps.format.sections import WORKSPACE_SECTIONS
from reachmap.maps.format.store import RecordFile
from reachmap.maps.records import (
    KINDS,
    CubeMap,
    Status,
    WorkspaceMap,
    pooled_reachability,
    stitch_cubes,
)


def check_workspace(tree: Tree) -> list[str]:
    """Cubes one by one, then the stitched percentages against their status."""
    problems = []
    for name in tree.cubes():
        problems += _check_cube(tree, f"cubes/{name}/")
    frames = [
        (prefix, tree.array(f"{prefix}status"), tree.array(f"{prefix}component"))
        for prefix in (f"cubes/{name}/" for name in tree.cubes())
    ]
    problems += [*check_components(tree, frames), *check_world(tree)]
    return problems or _check_stitching(tree)


def _check_cube(tree: Tree, prefix: str) -> list[str]:
    status = tree.array(f"{prefix}status")
    found = status == Status.PATH_FOUND
    length = tree.array(f"{prefix}path_length")
    attempts = tree.array(f"{prefix}attempts")
    paths_found = tree.array(f"{prefix}paths_found")
    goal = tree.array(f"{prefix}goal_configuration")
    return [
        *check_outcome(tree, prefix),
        *check_quaternions(tree.array(f"{prefix}quaternion_wxyz"), prefix),
        *check_coordinates(tree, prefix, "zyx"),
        *(
            f"{prefix}cube_{axis} must be {prefix}{axis}"
            for axis in "zyx"
            if not np.array_equal(
                tree.array(f"{prefix}cube_{axis}"), tree.array(f"{prefix}{axis}")
            )
        ),
        *require(
            np.isfinite(length) == found,
            f"{prefix}path_length must be finite exactly where a path was found",
        ),
        *require(
            paths_found <= attempts, f"{prefix}paths_found must not exceed attempts"
        ),
        *require(
            found | (paths_found == 0),
            f"{prefix}paths_found must be 0 unless the status is path_found",
        ),
        *check_goals(goal, found, prefix),
    ]


def _check_stitching(tree: Tree) -> list[str]:
    """Eq. (1) again, from the cubes."""
    cubes = cubes_from_tree(tree)
    stitching = stitch_cubes(cubes)
    for axis in "xyz":
        stored, own = tree.array(axis), getattr(stitching.lattice, axis)
        if stored.shape != own.shape or not np.allclose(stored, own, atol=1e-6):
            return [f"{axis} is not the union of the cubes' {axis}"]
    problems = []
    for kind in KINDS:
        percent = pooled_reachability(cubes, stitching, kind)
        problems += check_percent(tree, f"{kind}_reachability", percent)
    return problems


def cubes_from_tree(tree: Tree) -> dict[str, CubeMap]:
    """Collect the cubes of a tree whose structure is sound."""
    names = [item.name for item in dataclasses.fields(CubeMap)]
    return {
        cube: CubeMap(**{name: tree.array(f"cubes/{cube}/{name}") for name in names})
        for cube in tree.cubes()
    }


_LEVEL = ("z", "y", "x")
_AXES = (*_LEVEL, "cube_z", "cube_y", "cube_x")
_FRAME = ("cube_z", "cube_y", "cube_x", "orientation")
_CUBE = "cubes/{cube}/"


def _cube_scales() -> tuple[Variable, ...]:
    """Coordinates of a cube; x, y, z are their names in version 1.0.

    In xarray's trees the dimensions of a group are those of the groups above it, so
    that a cube's cannot be called like the root's.
    """
    words = {"z": "Levels", "y": "Rows", "x": "Columns"}
    return tuple(
        dataclasses.replace(
            coordinate(f"{_CUBE}{prefix}{axis}", f"{text} of the cube.", "robot_base"),
            is_hidden=not prefix,
        )
        for prefix in ("cube_", "")
        for axis, text in words.items()
    )


WORKSPACE = Layout(
    kind="workspace_map",
    check=check_workspace,
    sections=WORKSPACE_SECTIONS,
    title="Path reachability over the workspace of a robot cell",
    signal="path_reachability",
    axes=_LEVEL,
    attributes={
        "method": "How paths were sought: `roadmap` or `per-frame`.",
        "joint_names": "Names of the joints, in order.",
        "body_pairs": "Names of two bodies each; blocking_pair indexes this list.",
    },
    variables=(
        coordinate("z", "Levels of the stitched lattice.", "robot_base"),
        coordinate("y", "Rows of the stitched lattice.", "robot_base"),
        coordinate("x", "Columns of the stitched lattice.", "robot_base"),
        *COMMON_SCALES,
        Variable(
            path="path_reachability",
            dims=_LEVEL,
            dtype="f8",
            meaning="Share of test frames with a collision-free path, Eq. (1).",
            nan=True,
            **PERCENT,
        ),
        Variable(
            path="ik_reachability",
            dims=_LEVEL,
            dtype="f8",
            meaning="Share of test frames with a solution of the inverse kinematics.",
            nan=True,
            **PERCENT,
        ),
        Variable(
            path="ik_free_reachability",
            dims=_LEVEL,
            dtype="f8",
            meaning="Share of test frames with a solution free of collision.",
            nan=True,
            **PERCENT,
        ),
        SCAN,
        *_cube_scales(),
        index(f"{_CUBE}orientation", "Test frames at a point."),
        Variable(
            path=f"{_CUBE}quaternion_wxyz",
            dims=("orientation", "quat"),
            dtype="f8",
            units="1",
            meaning="TCP orientation of each test frame, unit quaternion.",
            frame="robot_base",
        ),
        *outcome(_CUBE, _FRAME),
        Variable(
            path=f"{_CUBE}attempts",
            dims=_FRAME,
            dtype="u1",
            units="1",
            meaning="Planning attempts (method roadmap: those of the component).",
        ),
        Variable(
            path=f"{_CUBE}paths_found",
            dims=_FRAME,
            dtype="u1",
            units="1",
            meaning="Attempts that found a path.",
        ),
        Variable(
            path=f"{_CUBE}component",
            dims=_FRAME,
            dtype="i4",
            units="1",
            meaning="Connected component of the roadmap; -1: none.",
            low=-1,
        ),
        Variable(
            path=f"{_CUBE}path_length",
            dims=_FRAME,
            dtype="f8",
            units="rad",
            meaning="Euclidean joint-space length of the path; NaN unless path_found.",
            **NONNEGATIVE,
        ),
        goal(_CUBE, _FRAME, ""),
    ),
)


_STITCHED = (
    "x", "y", "z", "path_reachability", "ik_reachability", "ik_free_reachability",
    "scan_configuration",
)  # fmt: skip
_CUBE_FIELDS = tuple(item.name for item in dataclasses.fields(CubeMap))


def tree_from_workspace_map(record: WorkspaceMap) -> Tree:
    """Everything that the file will hold."""
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _STITCHED}
    for cube, content in record.cubes.items():
        for name in _CUBE_FIELDS:
            arrays[f"cubes/{cube}/{name}"] = getattr(content, name)
        for axis in "zyx":
            arrays[f"cubes/{cube}/cube_{axis}"] = getattr(content, axis)
    layout = WORKSPACE.in_frame("T_base_grid", record.T_base_grid, _AXES, "grid")
    optional, lists, numbers = section_arrays(layout, record)
    return assemble(
        layout,
        arrays={**arrays, **optional},
        attributes={"method": record.method},
        labels={
            "joint_names": record.joint_names,
            "body_pairs": record.body_pairs,
            **lists,
        },
        numbers=numbers,
        stamp=record.stamp,
        provenance=record.provenance,
        run=record.run,
        cubes=tuple(record.cubes),
    )


def workspace_map_from_tree(tree: Tree, path: Path) -> WorkspaceMap:
    """Turn a checked tree into a record; ``path`` is named in messages."""
    arrays: dict[str, Any] = {name: tree.array(name) for name in _STITCHED}
    return WorkspaceMap(
        cubes=cubes_from_tree(tree),
        **arrays,
        joint_names=tuple(tree.attributes["joint_names"]),
        body_pairs=tuple(tree.attributes["body_pairs"]),
        method=str(tree.attributes["method"]),
        **origin_of(tree, path),
        **sections_of(WORKSPACE, tree),
    )


_FILE = RecordFile(
    layout=WORKSPACE, to_tree=tree_from_workspace_map, from_tree=workspace_map_from_tree
)
write_workspace_map, read_workspace_map = _FILE.write, _FILE.read
