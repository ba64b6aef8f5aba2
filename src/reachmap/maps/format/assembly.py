"""From a record's arrays to a tree that follows its layout."""

from __future__ import annotations

import dataclasses
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.errors import EngineError
from reachmap.maps.bytes.tree import Array, Leaf, Tree, content_sha256, integrity_sha256
from reachmap.maps.format.layout import (
    FORMAT_VERSION,
    PROVENANCE_TEXTS,
    RUN_TEXTS,
    Layout,
    Variable,
)
from reachmap.maps.provenance import (
    provenance_from_texts,
    record_texts,
    run_from_texts,
)
from reachmap.maps.records import Provenance, RunInfo, Stamp

GROUP_LABELS = ("stages", "methods")
"""Lists that the group of their variables carries, too."""


def expand(
    layout: Layout, cubes: Iterable[str] = (), paths: Container[str] = ()
) -> list[Variable]:
    """Variables of a layout, those of ``{cube}`` once for each cube.

    Of its sections, those that one of the ``paths`` belongs to.
    """
    names = list(cubes)
    variables = []
    present = [section for section in layout.sections if section.is_in(paths)]
    scales = {v.path: v for section in present for v in section.scales}
    for variable in (
        *layout.variables,
        *scales.values(),
        *(v for section in present for v in section.arrays.values()),
    ):
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
    numbers: Mapping[str, float] | None = None,
    texts: Mapping[str, str] | None = None,
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
        As in the record; the stamp's ``content_sha256`` is recomputed.
    cubes : sequence of str
        Names of the cubes of a workspace map.
    numbers : mapping of str to float, optional
        Numbers that variables carry as attributes, by the name of the attribute.
    texts : mapping of str to str, optional
        Texts at the root, by name.

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
    variables = expand(layout, cubes, arrays)
    sizes = _dimension_sizes(variables, arrays)
    _add_groups(tree, variables, labels)
    for variable in variables:
        value = arrays.get(variable.path)
        if value is None and variable.dtype == "U":
            value = np.array(labels[variable.labels], str)
        if value is None and variable.dims == (variable.name,):
            value = np.arange(sizes.get((variable.group, variable.name), 0))
        if value is None:
            raise EngineError(f"the {layout.name} lacks {variable.path}")
        leaf = Leaf(
            value=_fitted(variable, value),
            dims=variable.dims,
            attributes=_variable_attributes(variable, labels, numbers or {}),
            is_hidden=variable.is_hidden,
        )
        tree.leaves[variable.path] = leaf
    tree.leaves.update({k: Leaf(value=text) for k, text in (texts or {}).items()})
    _add_texts(tree, "provenance", record_texts(provenance))
    _add_texts(tree, "run", record_texts(run))
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
    variable: Variable,
    labels: Mapping[str, Sequence[str]],
    numbers: Mapping[str, float],
) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "units": variable.units,
        "long_name": variable.meaning,
    }
    if variable.frame:
        attributes["frame"] = variable.frame
    if variable.codes is not None:
        attributes["flag_values"] = np.array(list(variable.codes), np.uint8)
        attributes["flag_meanings"] = " ".join(c.name.lower() for c in variable.codes)
    if variable.is_flag:
        attributes["flag_values"] = np.array([0, 1], np.uint8)
        attributes["flag_meanings"] = "no yes"
    if variable.labels:
        attributes[variable.labels] = tuple(labels[variable.labels])
    if variable.number:
        attributes[variable.number] = float(numbers[variable.number])
    return attributes


def _add_groups(
    tree: Tree, variables: Sequence[Variable], labels: Mapping[str, Sequence[str]]
) -> None:
    for variable in variables:
        if variable.group.startswith("cubes/"):
            tree.groups.setdefault("cubes", {"NX_class": "NXcollection"})
            tree.groups[variable.group] = {
                "NX_class": "NXdata",
                "signal": "status",
                "axes": ("cube_z", "cube_y", "cube_x", "orientation"),
            }
        elif variable.group:
            tree.groups.setdefault(variable.group, {"NX_class": "NXcollection"})
        if variable.labels in GROUP_LABELS:
            tree.groups[variable.group][variable.labels] = tuple(
                labels[variable.labels]
            )


def _add_texts(tree: Tree, group: str, texts: Mapping[str, str]) -> None:
    tree.groups[group] = {"NX_class": "NXcollection"}
    for name, text in texts.items():
        tree.leaves[f"{group}/{name}"] = Leaf(value=text)


def section_arrays(
    layout: Layout, record: Any
) -> tuple[dict[str, Any], dict[str, Sequence[str]], dict[str, float]]:
    """Arrays by path, lists and numbers of the sections that a record has."""
    arrays: dict[str, Any] = {}
    lists: dict[str, Sequence[str]] = {}
    numbers: dict[str, float] = {}
    for section in layout.sections:
        part = _part(record, section.field)
        if part is None:
            continue
        for name, variable in section.arrays.items():
            arrays[variable.path] = getattr(part, name) if section.part else part
        lists.update({label: getattr(part, n) for n, label in section.lists.items()})
        numbers.update({key: getattr(part, n) for n, key in section.numbers.items()})
    return arrays, lists, numbers


def _part(record: Any, field: str) -> Any:
    """A field of a record, or of a field of it; None where either is not there."""
    owner, _, name = field.rpartition(".")
    if owner:
        record = getattr(record, owner)
    return getattr(record, name) if name and record is not None else None


def sections_of(layout: Layout, tree: Tree) -> dict[str, Any]:
    """Fields of a record that the sections of a checked tree fill."""
    fields: dict[str, Any] = {}
    for section in layout.sections:
        if not section.field or not section.is_in(tree.leaves):
            continue
        values: dict[str, Any] = {
            name: tree.array(variable.path) for name, variable in section.arrays.items()
        }
        attributes = {
            key: value
            for variable in section.variables
            for key, value in tree.leaves[variable.path].attributes.items()
        }
        for name, label in section.lists.items():
            values[name] = tuple(attributes[label])
        for name, key in section.numbers.items():
            values[name] = float(attributes[key])
        only = next(iter(values.values()))
        owner, _, own = section.field.rpartition(".")
        if owner in fields:
            fields[owner] = dataclasses.replace(fields[owner], **{own: only})
        else:
            fields[section.field] = section.part(**values) if section.part else only
    return fields


def origin_of(tree: Tree, path: Path) -> dict[str, Any]:
    """Fields of a record that say where it comes from."""
    return {
        "stamp": stamp_of(tree),
        "provenance": provenance_of(tree, path),
        "run": run_of(tree, path),
    }


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
