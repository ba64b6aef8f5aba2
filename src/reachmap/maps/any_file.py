"""Reading an artefact whose kind is not known beforehand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeAlias

from reachmap.maps.bin_file import bin_map_from_tree
from reachmap.maps.placement_file import placement_from_tree
from reachmap.maps.records import BinMap, BinPlacement, WorkspaceMap
from reachmap.maps.storage import load
from reachmap.maps.tree import Tree
from reachmap.maps.workspace_file import workspace_map_from_tree

Artefact: TypeAlias = WorkspaceMap | BinMap | BinPlacement

_RECORDS: Final[dict[str, Callable[[Tree, Path], Artefact]]] = {
    "workspace_map": workspace_map_from_tree,
    "bin_map": bin_map_from_tree,
    "bin_placement": placement_from_tree,
}


def read_artefact(path: Path) -> Artefact:
    """Read an artefact of any kind; everything about it is checked.

    Raises
    ------
    MapFileError
        The file is missing, damaged, or no artefact at all.
    """
    tree, layout = load(path)
    return _RECORDS[layout.kind](tree, path)


def kind_of(record: Artefact) -> str:
    """Kind of a record, as in ``"bin_map"``."""
    if isinstance(record, WorkspaceMap):
        return "workspace_map"
    return "bin_map" if isinstance(record, BinMap) else "bin_placement"
