"""Bin maps: record to file and back."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from reachmap.maps.assembly import assemble
from reachmap.maps.bin_format import BIN, INDEX_COLUMNS
from reachmap.maps.records import BinMap, PathStore
from reachmap.maps.stamps import provenance_of, run_of, stamp_of
from reachmap.maps.storage import load, store
from reachmap.maps.tree import Tree

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
