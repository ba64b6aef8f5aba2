"""Workspace maps: record to file and back."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from reachmap.maps.assembly import assemble
from reachmap.maps.records import CubeMap, WorkspaceMap
from reachmap.maps.stamps import provenance_of, run_of, stamp_of
from reachmap.maps.storage import load, store
from reachmap.maps.tree import Tree
from reachmap.maps.workspace_format import WORKSPACE, cubes_from_tree

_STITCHED = (
    "x", "y", "z", "path_reachability", "ik_reachability", "ik_free_reachability",
    "scan_configuration",
)  # fmt: skip
_CUBE = tuple(item.name for item in dataclasses.fields(CubeMap))


def write_workspace_map(
    path: Path, record: WorkspaceMap, overwrite: bool = False
) -> str:
    """Write a workspace map.

    Parameters
    ----------
    path : Path
    record : WorkspaceMap
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
    return store(path, tree_from_workspace_map(record), WORKSPACE, overwrite=overwrite)


def tree_from_workspace_map(record: WorkspaceMap) -> Tree:
    """Everything that the file will hold."""
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _STITCHED}
    for cube, content in record.cubes.items():
        for name in _CUBE:
            arrays[f"cubes/{cube}/{name}"] = getattr(content, name)
    return assemble(
        WORKSPACE,
        arrays=arrays,
        attributes={"method": record.method},
        labels={"joint_names": record.joint_names, "body_pairs": record.body_pairs},
        stamp=record.stamp,
        provenance=record.provenance,
        run=record.run,
        cubes=tuple(record.cubes),
    )


def read_workspace_map(path: Path) -> WorkspaceMap:
    """Read a workspace map; everything about it is checked.

    Raises
    ------
    MapFileError
        The file is missing, damaged, or something else.
    """
    tree, _ = load(path, WORKSPACE)
    return workspace_map_from_tree(tree, path)


def workspace_map_from_tree(tree: Tree, path: Path) -> WorkspaceMap:
    """Turn a checked tree into a record; ``path`` is named in messages."""
    return WorkspaceMap(
        cubes=cubes_from_tree(tree),
        **{name: tree.array(name) for name in _STITCHED},
        joint_names=tuple(tree.attributes["joint_names"]),
        body_pairs=tuple(tree.attributes["body_pairs"]),
        method=str(tree.attributes["method"]),
        stamp=stamp_of(tree),
        provenance=provenance_of(tree, path),
        run=run_of(tree, path),
    )
