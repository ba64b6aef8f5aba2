"""Whether a tree follows the format of its kind: names, dimensions, types, ranges.

Consistency between the numbers is checked in :mod:`reachmap.maps.format.checks`.
Every check returns sentences; an empty list means that all is well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeGuard

import numpy as np

from reachmap.maps.bytes.tree import Array, Leaf, Tree
from reachmap.maps.format.assembly import expand
from reachmap.maps.format.layout import COMMON_ATTRIBUTES, Layout, Variable


def check_structure(tree: Tree, layout: Layout) -> list[str]:
    """Compare names, types, dimensions, units and attributes with the layout.

    Parameters
    ----------
    tree : Tree
    layout : Layout

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
