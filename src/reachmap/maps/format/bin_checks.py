"""Consistency checks of the numbers of a bin map and its optional parts."""

from __future__ import annotations

import numpy as np

from reachmap.geometry import AXES
from reachmap.maps.bytes.tree import Tree
from reachmap.maps.format.checks import (
    LENGTH_TOLERANCE_RAD,
    check_components,
    check_coordinates,
    check_goals,
    check_outcome,
    check_percent,
    check_pose,
    check_quaternions,
    check_world,
    path_lengths,
    require,
    share_of,
)
from reachmap.maps.records import NO_PAIR, Status
from reachmap.maps.summary.directions import direction_percent

# Sums of the same times in another order.
_TIME_TOLERANCE_S = 1e-9
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
        return ["paths/row_size must add up to the stored waypoints"]
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


def check_sections(tree: Tree) -> list[str]:
    """Check every part that a bin map has; the rest of the map is sound."""
    status = tree.array("status")
    problems = check_world(tree)
    for name, check in _CHECKS.items():
        if name in tree.leaves:
            problems += check(tree)
    if "component" in tree.leaves:
        problems += check_components(tree, [("", status, tree.array("component"))])
    return problems


def _check_rolls(tree: Tree) -> list[str]:
    status = tree.array("status")
    shares = direction_percent(
        status == Status.PATH_FOUND,
        status != Status.NOT_ATTEMPTED,
        tree.array("quaternion_wxyz"),
        str(tree.attributes["approach_axis"]),
    )
    names = ("direction_reachability", "point_reachability")
    return [
        problem
        for name, share in zip(names, shares, strict=True)
        for problem in check_percent(tree, name, share)
    ]


def _check_winning_roll(tree: Tree) -> list[str]:
    return require(
        np.isfinite(tree.array("winning_roll"))
        == (tree.array("status") == Status.PATH_FOUND),
        "winning_roll must be finite exactly where the status is path_found",
    )


def _check_effort(tree: Tree) -> list[str]:
    return require(
        (tree.array("effort_checks") == 0) | (tree.array("n_ik_free") > 0)[..., None],
        "effort_checks must be 0 where no goal is free",
    )


def _check_best(tree: Tree) -> list[str]:
    row, index = tree.array("best_path"), tree.array("paths/index")
    there = row >= 0
    problems = require(
        there == (tree.array("status") == Status.PATH_FOUND),
        "best_path must be there exactly where the status is path_found",
    )
    for name in ("best_path_length", "best_execution_time"):
        problems += require(
            np.isfinite(tree.array(name)) == there,
            f"{name} must be finite exactly where best_path is there",
        )
    if (row >= len(index)).any():
        return [*problems, "best_path must be a row of the stored paths"]
    rows, chosen = tree.array("paths/row_size"), row[there]
    stage = tree.leaves.get("paths/stage")
    to_grasp = np.zeros(len(rows)) if stage is None else tree.array("paths/stage")
    points = tree.array("paths/configuration")
    length, _ = path_lengths(points, rows, rows)
    last = points[np.cumsum(rows)[chosen] - 1]
    return [
        *problems,
        *require(
            (index[chosen, :4] == np.argwhere(there)).all(axis=1)
            & (to_grasp[chosen] == 0),
            "best_path must lead to its own test grasp",
        ),
        *require(
            np.abs(length[chosen] - tree.array("best_path_length")[there])
            <= LENGTH_TOLERANCE_RAD * (1.0 + length[chosen]),
            "best_path_length must be the length of best_path",
        ),
        *require(
            np.abs(last - tree.array("goal_configuration")[there]).max(axis=1)
            <= LENGTH_TOLERANCE_RAD,
            "goal_configuration must be where best_path ends",
        ),
    ]


def _check_times(tree: Tree) -> list[str]:
    found = tree.array("path_found") == 1
    problems = []
    for name in ("approach_time", "retreat_time"):
        problems += require(
            np.isfinite(tree.array(name)) == found,
            f"{name} must be finite exactly where path_found is 1",
        )
    rest = tree.array("execution_time") - tree.array("approach_time")
    return problems + require(
        ~found | (rest >= -_TIME_TOLERANCE_S),
        "execution_time must not be less than approach_time",
    )


def _check_margins(tree: Tree) -> list[str]:
    found = tree.array("status") == Status.PATH_FOUND
    pair = tree.array("clearance_pair")
    problems = require(
        np.isfinite(tree.array("clearance")) == (pair != NO_PAIR),
        "clearance must be finite exactly where clearance_pair names a pair",
    )
    for name in ("clearance", "joint_margin", "smallest_singular_value"):
        problems += require(
            np.isnan(tree.array(name)) | found,
            f"{name} must be NaN unless the status is path_found",
        )
    return problems


def _check_cycle(tree: Tree) -> list[str]:
    status = tree.array("cycle/stage_status")
    pair = tree.array("cycle/stage_blocking_pair")
    done = status == Status.PATH_FOUND
    whole = done.all(axis=-1)
    attempted = tree.array("status") != Status.NOT_ATTEMPTED
    problems = require(
        ~done | (pair == NO_PAIR),
        "cycle/stage_blocking_pair must be -1 where the stage has a path",
    )
    for name in ("stage_time", "stage_length"):
        problems += require(
            np.isfinite(tree.array(f"cycle/{name}")) == done,
            f"cycle/{name} must be finite exactly where the stage has a path",
        )
    return [
        *problems,
        *require(
            np.isfinite(tree.array("cycle/cycle_time")) == whole,
            "cycle/cycle_time must be finite exactly where every stage has a path",
        ),
        *require(
            ~whole | (tree.array("status") == Status.PATH_FOUND),
            "cycle/stage_status must not be path_found throughout without a grasp",
        ),
        # A cycle of the lift alone goes nowhere.
        *require(
            ~whole | (tree.array("cycle/drop_off") >= 0) | (status.shape[-1] == 1),
            "cycle/drop_off must be given where every stage has a path",
        ),
        *check_percent(tree, "cycle/cycle_reachability", share_of(whole, attempted)),
    ]


def _check_lift(tree: Tree) -> list[str]:
    times = tree.leaves.get("cycle/cycle_time")
    if times is None:
        return []
    lifted = np.isfinite(tree.array("cycle/lift_above_rim"))
    return require(
        lifted == np.isfinite(times.value),
        "cycle/lift_above_rim must be finite exactly where every stage has a path",
    )


def _check_stage(tree: Tree) -> list[str]:
    stage = tree.array("paths/stage")
    scale = tree.leaves.get("cycle/stage")
    stages = 0 if scale is None else np.size(scale.value)
    return require(
        stage <= stages, "paths/stage must be 0 or count the stages of the cycle"
    ) + require(
        (stage == 0) | (tree.array("paths/index")[:, 4] == -1),
        "paths/index must have repeat -1 for later stages",
    )


def _check_refinement(tree: Tree) -> list[str]:
    lever_m = tree.leaves["refinement/position"].attributes["lever_m"]
    return [
        *check_quaternions(tree.array("refinement/quaternion_wxyz"), "refinement/"),
        *require(np.array(0.0 < lever_m < np.inf), "lever_m must be a length above 0"),
        *require(
            np.array(tree.array("refinement/status").size > 0),
            "refinement must have a sample",
        ),
    ]


_CHECKS = {
    "direction_reachability": _check_rolls,
    "winning_roll": _check_winning_roll,
    "effort_checks": _check_effort,
    "best_path": _check_best,
    "approach_time": _check_times,
    "clearance": _check_margins,
    "cycle/stage_status": _check_cycle,
    "cycle/lift_above_rim": _check_lift,
    "paths/stage": _check_stage,
    "refinement/status": _check_refinement,
}
