"""Do the numbers of a bin map agree with each other."""

from __future__ import annotations

import numpy as np

from reachmap.geometry import AXES
from reachmap.maps.bytes.tree import Tree
from reachmap.maps.format.checks import (
    LENGTH_TOLERANCE_RAD,
    check_coordinates,
    check_goals,
    check_outcome,
    check_percent,
    check_pose,
    check_quaternions,
    path_lengths,
    require,
    share_of,
)
from reachmap.maps.format.section_checks import check_sections
from reachmap.maps.records import Status

_PATH_VALUES = (
    "path_length", "path_length_planned", "tcp_path_length", "execution_time",
    "planning_time", "planning_cpu_time", "simplification_time",
)  # fmt: skip


def check_bin(tree: Tree) -> list[str]:
    """Outcome, attempts, poses, percentages and stored paths."""
    status = tree.array("status")
    found = tree.array("path_found") == 1
    any_found = found.any(axis=-1)
    connected = tree.array("connected") == 1
    attempted = status != Status.NOT_ATTEMPTED
    percent = share_of(status == Status.PATH_FOUND, attempted)
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
    return problems or _check_paths(tree) or check_sections(tree)


def _check_approach(tree: Tree) -> list[str]:
    axis = tree.attributes["approach_axis"]
    distance = tree.attributes["approach_distance_m"]
    problems = []
    if axis not in AXES:
        problems.append(f"approach_axis must be one of {', '.join(AXES)}")
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
    if (index >= np.array(found.shape)).any() or (index[:, :4] < 0).any():
        return ["paths/index must name test grasps and attempts of this map"]
    whole, part = path_lengths(points, rows, planned)
    attempts = index[:, 4] >= 0
    place = tuple(index[attempts].T)
    problems = require(found[place], "paths/index must name attempts that found a path")
    for name, length, which in (
        ("path_length", whole[attempts], ""),
        ("path_length_planned", part[attempts], " up to planned_size"),
    ):
        problems += require(
            np.abs(length - tree.array(name)[place])
            <= LENGTH_TOLERANCE_RAD * (1.0 + length),
            f"paths must be as long as {name} says{which}",
        )
    return problems
