"""Consistency checks of the numbers of an artefact that formats share.

Each takes numbers whose structure is sound and returns sentences; an empty list means
that all is well.
"""

from __future__ import annotations

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.bytes.tree import Tree
from reachmap.maps.records import NO_PAIR, Status

_ROTATION_TOLERANCE = 1e-6
LENGTH_TOLERANCE_RAD = 1e-6
"""By which lengths may differ from those of the stored waypoints, and their share."""


def require(holds: BoolArray, sentence: str) -> list[str]:
    """Return the sentence with a count, unless all hold."""
    wrong = int(holds.size - np.count_nonzero(holds))
    return [f"{sentence} ({wrong} of {holds.size} do not)"] if wrong else []


def check_outcome(tree: Tree, prefix: str) -> list[str]:
    """Status against the solutions and the pair in collision."""
    status = tree.array(f"{prefix}status")
    pair = tree.array(f"{prefix}blocking_pair")
    n_ik, n_free = tree.array(f"{prefix}n_ik"), tree.array(f"{prefix}n_ik_free")
    collision = status == Status.IK_IN_COLLISION
    no_pair = np.isin(status, [Status.NOT_ATTEMPTED, Status.PATH_FOUND, Status.NO_IK])
    solved = np.isin(status, [Status.PATH_FOUND, Status.NO_PATH_FOUND])
    return [
        *require(
            ~collision | (pair != NO_PAIR),
            f"{prefix}blocking_pair must name a pair where all are in collision",
        ),
        *require(
            ~no_pair | (pair == NO_PAIR),
            f"{prefix}blocking_pair must be -1 where nothing collides",
        ),
        *require(n_free <= n_ik, f"{prefix}n_ik_free must not exceed n_ik"),
        *require(
            (status != Status.NO_IK) | (n_ik == 0),
            f"{prefix}n_ik must be 0 where the status is no_ik",
        ),
        *require(
            ~collision | ((n_ik > 0) & (n_free == 0)),
            f"{prefix}n_ik_free must be 0, and n_ik not, where all are in collision",
        ),
        *require(
            ~solved | (n_free > 0),
            f"{prefix}n_ik_free must not be 0 where a path was sought",
        ),
    ]


def check_quaternions(quaternions: FloatArray, prefix: str) -> list[str]:
    """Quaternions, shape (..., 4), have length 1."""
    norm = np.linalg.norm(quaternions, axis=-1)
    return require(
        np.abs(norm - 1.0) <= _ROTATION_TOLERANCE,
        f"{prefix}quaternion_wxyz must hold unit quaternions",
    )


def check_coordinates(
    tree: Tree, prefix: str, names: str | tuple[str, ...]
) -> list[str]:
    """Coordinates are there and rise strictly."""
    problems = []
    for name in names:
        values = tree.array(f"{prefix}{name}")
        if len(values) == 0:
            problems.append(f"{prefix}{name} is empty")
        elif (np.diff(values) <= 0).any():
            problems.append(f"{prefix}{name} must rise")
    return problems


def check_goals(goal: FloatArray, found: BoolArray, prefix: str) -> list[str]:
    """Goals, shape (..., dof), are whole or absent, and there where ``found``."""
    finite = np.isfinite(goal)
    return [
        *require(
            finite.all(axis=-1) == finite.any(axis=-1),
            f"{prefix}goal_configuration must be whole or absent",
        ),
        *require(
            finite.all(axis=-1) | ~found,
            f"{prefix}goal_configuration must be there where a path was found",
        ),
    ]


def check_percent(tree: Tree, path: str, percent: FloatArray) -> list[str]:
    """Compare stored percentages with recomputed ones."""
    stored = tree.array(path)
    same = np.isclose(stored, percent, atol=1e-9, rtol=0, equal_nan=True)
    return require(same, f"{path} must be what Eq. (1) gives for the status")


def check_pose(T: FloatArray, name: str = "bin_pose") -> list[str]:
    """``bin_pose``, or another, is a rigid transform."""
    if T.shape != (4, 4) or not np.allclose(T[3], [0, 0, 0, 1], atol=0):
        return [f"{name} must be a homogeneous matrix"]
    R = T[:3, :3]
    if not np.allclose(R @ R.T, np.eye(3), atol=_ROTATION_TOLERANCE):
        return [f"{name} must hold a rotation"]
    return [] if np.linalg.det(R) > 0 else [f"{name} must not mirror"]


def check_world(tree: Tree) -> list[str]:
    """``T_world_base``, where a file has it, is a rigid transform."""
    name = "T_world_base"
    return check_pose(tree.array(name), name) if name in tree.leaves else []


def share_of(hits: BoolArray, tried: BoolArray) -> FloatArray:
    """Eq. (1): hits among what was tried over the last axis [percent]."""
    percent = np.full(tried.shape[:-1], np.nan)
    count = (hits & tried).sum(axis=-1)
    np.divide(100.0 * count, tried.sum(axis=-1), out=percent, where=tried.any(axis=-1))
    return percent


def check_components(
    tree: Tree, frames: list[tuple[str, CodeArray, IntArray]]
) -> list[str]:
    """Evidence of components against the frames that lie in them.

    Parameters
    ----------
    tree : Tree
    frames : list of (str, array, array)
        Prefix, status and component of test frames.
    """
    if "components/checks" not in tree.leaves:
        return []
    reached = tree.array("components/reached") == 1
    problems = require(
        tree.array("components/method_checks").sum(axis=1)
        == tree.array("components/checks"),
        "components/method_checks must add up to checks",
    )
    for prefix, status, component in frames:
        if (component >= len(reached)).any():
            problems.append(f"{prefix}component must count in /components")
            continue
        known = component >= 0
        is_reached = np.append(reached, False)[component]
        problems += require(
            ~known | (status != Status.NO_PATH_FOUND) | ~is_reached,
            f"{prefix}status must not be no_path_found in a component that is reached",
        )
    return problems


def path_lengths(
    points: FloatArray, rows: IntArray, planned: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Joint-space lengths of ragged paths [rad]: whole, and of the planned part.

    Parameters
    ----------
    points : array, shape (points, dof)
    rows, planned : int array, shape (paths,)
        Waypoints of each path, and of its planned part.
    """
    # Length up to each waypoint as if all paths were one; jumps between paths cancel.
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    first = np.cumsum(rows) - rows
    start = travelled[first]
    whole = travelled[first + rows - 1] - start
    return np.asarray(whole), np.asarray(travelled[first + planned - 1] - start)
