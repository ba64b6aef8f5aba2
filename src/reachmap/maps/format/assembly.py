"""From a record's arrays to a tree that follows its layout."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.errors import EngineError
from reachmap.maps.bytes.hashing import content_sha256, integrity_sha256
from reachmap.maps.bytes.tree import Array, Leaf, Tree
from reachmap.maps.format.layout import (
    FORMAT_VERSION,
    PROVENANCE_TEXTS,
    RUN_TEXTS,
    STATUS_CODES,
    STATUS_MEANINGS,
    Layout,
    Variable,
)
from reachmap.maps.provenance import (
    provenance_from_texts,
    provenance_texts,
    run_from_texts,
    run_texts,
)
from reachmap.maps.records import Provenance, RunInfo, Stamp


def expand(layout: Layout, cubes: Iterable[str] = ()) -> list[Variable]:
    """Variables of a layout, those of ``{cube}`` once for each cube."""
    names = list(cubes)
    variables = []
    for variable in layout.variables:
        if "{cube}" in variable.path:
            variables += [
                dataclasses.replace(variable, path=variable.path.format(cube=name))
                for name in names
            ]
        else:
            variables.append(variable)
    return variables


def assemble(
    layout: Layout,
    *,
    arrays: Mapping[str, Any],
    attributes: Mapping[str, Any],
    labels: Mapping[str, Sequence[str]],
    stamp: Stamp,
    provenance: Provenance,
    run: RunInfo,
    cubes: Sequence[str] = (),
) -> Tree:
    """Build the tree of an artefact, checksums included.

    Parameters
    ----------
    layout : Layout
    arrays : mapping of str to array
        By path. Coordinates that only count may be left out.
    attributes : mapping
        Root attributes of this kind of artefact.
    labels : mapping of str to sequence of str
        Lists that variables index, by the name the layout gives them.
    stamp, provenance, run
        As in the record; the stamp's ``content_sha256`` is computed anew.
    cubes : sequence of str
        Names of the cubes of a workspace map.

    Raises
    ------
    EngineError
        An array is missing or does not fit its type: the producer is at fault.
    """
    tree = Tree(attributes=_root_attributes(layout, stamp))
    tree.attributes.update(attributes)
    tree.attributes.update(
        {k: tuple(v) for k, v in labels.items() if k in layout.attributes}
    )
    variables = expand(layout, cubes)
    sizes = _dimension_sizes(variables, arrays)
    _add_groups(tree, variables)
    for variable in variables:
        value = arrays.get(variable.path)
        if value is None and variable.dims == (variable.name,):
            value = np.arange(sizes.get((variable.group, variable.name), 0))
        if value is None:
            raise EngineError(f"the {layout.name} lacks {variable.path}")
        leaf = Leaf(
            value=_fitted(variable, value),
            dims=variable.dims,
            attributes=_variable_attributes(variable, labels),
        )
        tree.leaves[variable.path] = leaf
    _add_texts(tree, "provenance", provenance_texts(provenance))
    _add_texts(tree, "run", run_texts(run))
    tree.attributes["content_sha256"] = content_sha256(tree)
    tree.attributes["integrity_sha256"] = integrity_sha256(tree)
    return tree


def _root_attributes(layout: Layout, stamp: Stamp) -> dict[str, Any]:
    return {
        "Conventions": "CF-1.11",
        "format": layout.format,
        "format_version": FORMAT_VERSION,
        "title": layout.title,
        "NX_class": "NXdata",
        "signal": layout.signal,
        "axes": layout.axes,
        "frame": "robot_base",
        "seed": np.uint64(stamp.seed),
        "cell_sha256": stamp.cell_sha256,
        "config_sha256": stamp.config_sha256,
    }


def _dimension_sizes(
    variables: Sequence[Variable], arrays: Mapping[str, Any]
) -> dict[tuple[str, str], int]:
    """Length of each dimension by (group of its scale, name), from the arrays."""
    scales = {(v.group, v.name) for v in variables if v.dims == (v.name,)}
    sizes: dict[tuple[str, str], int] = {}
    for variable in variables:
        # What is left out has no shape, as a number has none.
        shape = np.shape(arrays.get(variable.path, 0))
        for dimension, size in zip(variable.dims, shape, strict=False):
            group = variable.group if (variable.group, dimension) in scales else ""
            sizes.setdefault((group, dimension), int(size))
    return sizes


def _fitted(variable: Variable, value: Any) -> Array:
    """Cast to the type of the layout; refuse where numbers would change."""
    array = np.asarray(value)
    wanted = np.dtype(variable.dtype)
    if array.ndim != len(variable.dims):
        raise EngineError(
            f"{variable.path} must have the dimensions ({', '.join(variable.dims)}), "
            f"got the shape {array.shape}"
        )
    fitted = array.astype(wanted)
    if wanted.kind != "f" and not np.array_equal(fitted, array):
        raise EngineError(f"{variable.path} holds numbers that {wanted} cannot hold")
    return fitted


def _variable_attributes(
    variable: Variable, labels: Mapping[str, Sequence[str]]
) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "units": variable.units,
        "long_name": variable.meaning,
    }
    if variable.frame:
        attributes["frame"] = variable.frame
    if variable.is_status:
        attributes["flag_values"] = np.array(STATUS_CODES, np.uint8)
        attributes["flag_meanings"] = STATUS_MEANINGS
    if variable.is_flag:
        attributes["flag_values"] = np.array([0, 1], np.uint8)
        attributes["flag_meanings"] = "no yes"
    if variable.labels:
        attributes[variable.labels] = tuple(labels[variable.labels])
    return attributes


def _add_groups(tree: Tree, variables: Sequence[Variable]) -> None:
    for variable in variables:
        if variable.group.startswith("cubes/"):
            tree.groups.setdefault("cubes", {"NX_class": "NXcollection"})
            tree.groups[variable.group] = {
                "NX_class": "NXdata",
                "signal": "status",
                "axes": ("z", "y", "x", "orientation"),
            }
        elif variable.group:
            tree.groups[variable.group] = {"NX_class": "NXcollection"}


def _add_texts(tree: Tree, group: str, texts: Mapping[str, str]) -> None:
    tree.groups[group] = {"NX_class": "NXcollection"}
    for name, text in texts.items():
        tree.leaves[f"{group}/{name}"] = Leaf(value=text)


def stamp_of(tree: Tree) -> Stamp:
    """Collect the root attributes of a checked tree."""
    return Stamp(
        seed=int(tree.attributes["seed"]),
        cell_sha256=str(tree.attributes["cell_sha256"]),
        config_sha256=str(tree.attributes["config_sha256"]),
        content_sha256=str(tree.attributes["content_sha256"]),
        format_version=str(tree.attributes["format_version"]),
    )


def provenance_of(tree: Tree, path: Path) -> Provenance:
    """Collect ``/provenance`` of a checked tree; ``path`` is named in messages."""
    texts = {name: tree.text(f"provenance/{name}") for name in PROVENANCE_TEXTS}
    return provenance_from_texts(texts, str(path))


def run_of(tree: Tree, path: Path) -> RunInfo:
    """Collect ``/run`` of a checked tree; ``path`` is named in messages."""
    texts = {name: tree.text(f"run/{name}") for name in RUN_TEXTS}
    return run_from_texts({k: v for k, v in texts.items() if v}, str(path))
