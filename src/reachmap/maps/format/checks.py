"""Whether a tree follows its format: names, dimensions, types, ranges, consistency.

Structure comes first, then ranges, then what formats share of the consistency between
numbers. Every check returns sentences; an empty list means that all is well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeGuard

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.bytes.tree import Array, Leaf, Tree
from reachmap.maps.format.assembly import expand
from reachmap.maps.format.layout import COMMON_ATTRIBUTES, Layout, Variable
from reachmap.maps.records import NO_PAIR, Status

# Single precision with some room; what we write is good to 1e-15.
_ROTATION_TOLERANCE = 1e-6
LENGTH_TOLERANCE_RAD = 1e-6
"""By which lengths may differ from those of the stored waypoints, and their share."""


def check_structure(tree: Tree, layout: Layout) -> list[str]:
    """Compare names, types, dimensions, units and attributes with the layout.

    Returns
    -------
    list of str
        One sentence per mistake, the variable first. Variables that the layout does
        not know are ignored: a newer minor version may bring them.
    """
    problems = _check_root(tree, layout)
    variables = expand(layout, tree.cubes(), tree.leaves)
    sound = []
    for variable in variables:
        leaf = tree.leaves.get(variable.path)
        if leaf is None:
            problems.append(f"{variable.path} is missing")
        elif found := _check_leaf(variable, leaf):
            problems += found
        else:
            sound.append(variable)
    return problems + _check_sizes(tree, sound)


def _check_root(tree: Tree, layout: Layout) -> list[str]:
    wanted = [*COMMON_ATTRIBUTES, *layout.attributes]
    problems = [
        f"the root attribute {name} is missing"
        for name in wanted
        if name not in tree.attributes
    ]
    for name in ("joint_names", "body_pairs", "reasons"):
        if name in layout.attributes and not _is_text_list(tree.attributes.get(name)):
            problems.append(f"the root attribute {name} is not a list of texts")
    seed = tree.attributes.get("seed")
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool):
        problems.append("the root attribute seed is not an integer")
    if layout.kind == "workspace_map" and not tree.cubes():
        problems.append("cubes holds no cube")
    return problems


def _is_text_list(value: Any) -> TypeGuard[Sequence[str]]:
    return isinstance(value, Sequence) and not isinstance(value, str) and all(
        isinstance(item, str) for item in value
    )  # fmt: skip


def _check_leaf(variable: Variable, leaf: Leaf) -> list[str]:
    path, value = variable.path, leaf.value
    if isinstance(value, str):
        return [f"{path} is a text"]
    problems = []
    if variable.dtype != value.dtype.kind and (
        value.dtype.newbyteorder("=") != np.dtype(variable.dtype)
    ):
        problems.append(f"{path} has the type {value.dtype}, not {variable.dtype}")
    if leaf.dims != variable.dims:
        problems.append(
            f"{path} has the dimensions ({', '.join(leaf.dims)}), "
            f"not ({', '.join(variable.dims)})"
        )
    if leaf.attributes.get("units") != variable.units:
        problems.append(
            f"{path} has the unit {leaf.attributes.get('units')!r}, "
            f"not {variable.units!r}"
        )
    if variable.labels:
        labels = leaf.attributes.get(variable.labels)
        if not _is_text_list(labels):
            problems.append(f"{path} lacks its list {variable.labels}")
        elif variable.dims == (variable.name,) and len(labels) != value.size:
            problems.append(f"{path} and its list {variable.labels} differ in length")
        elif value.dtype.kind == "U" and value.tolist() != list(labels):
            problems.append(f"{path} must be its list {variable.labels}")
    if variable.number:
        number = leaf.attributes.get(variable.number)
        if not isinstance(number, float) or not 0.0 < number < np.inf:
            problems.append(f"{path} lacks its positive number {variable.number}")
    return problems


def _check_sizes(tree: Tree, variables: Sequence[Variable]) -> list[str]:
    """Every array is as long as the scales of its dimensions."""
    problems = []
    for variable in variables:
        shape = tree.array(variable.path).shape
        wanted = tuple(
            _scale_size(tree, variable.group, name) for name in variable.dims
        )
        if shape != wanted:
            problems.append(
                f"{variable.path} has the shape {shape}, its dimensions say {wanted}"
            )
    return problems


def _scale_size(tree: Tree, group: str, dimension: str) -> int | None:
    leaf = tree.leaves.get(f"{group}/{dimension}" if group else dimension)
    leaf = leaf or tree.leaves.get(dimension)
    if leaf is None or isinstance(leaf.value, str) or leaf.value.ndim != 1:
        return None
    return len(leaf.value)


def check_ranges(tree: Tree, layout: Layout) -> list[str]:
    """Numbers are finite where they must be, and within the range of their kind."""
    problems = []
    for variable in expand(layout, tree.cubes(), tree.leaves):
        problems += _check_values(variable, tree.array(variable.path), tree.attributes)
    return problems


def _check_values(
    variable: Variable, value: Array, attributes: Mapping[str, Any]
) -> list[str]:
    path, problems = variable.path, []
    if value.dtype.kind == "f":
        allowed = np.isfinite(value) | (np.isnan(value) if variable.nan else False)
        if not allowed.all():
            problems.append(f"{path} holds numbers that are not finite")
    if variable.low is not None and (value < variable.low).any():
        problems.append(f"{path} goes below {variable.low:g}")
    high = variable.high
    if variable.codes is not None:
        high = max(variable.codes)
    elif variable.is_flag:
        high = 1
    elif variable.is_index:
        high = len(attributes[variable.labels]) - 1
    if high is not None and (value > high + 1e-9).any():
        problems.append(f"{path} goes above {high:g}")
    return problems


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
