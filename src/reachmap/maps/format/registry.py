"""Reading an artefact of unknown kind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeAlias

from reachmap.maps.base.format import BASE, base_from_tree, tree_from_base
from reachmap.maps.base.record import BasePlacement
from reachmap.maps.bytes.tree import Tree
from reachmap.maps.format.assembly import provenance_of
from reachmap.maps.format.bin import BIN, bin_map_from_tree, tree_from_bin_map
from reachmap.maps.format.layout import Layout
from reachmap.maps.format.placement import (
    PLACEMENT,
    placement_from_tree,
    tree_from_placement,
)
from reachmap.maps.format.store import load
from reachmap.maps.format.workspace import (
    WORKSPACE,
    tree_from_workspace_map,
    workspace_map_from_tree,
)
from reachmap.maps.records import BinMap, BinPlacement, Provenance, WorkspaceMap
from reachmap.maps.robustness.format import (
    ROBUSTNESS,
    robustness_from_tree,
    tree_from_robustness,
)
from reachmap.maps.robustness.record import Robustness
from reachmap.maps.study.format import STUDY, study_from_tree, tree_from_study
from reachmap.maps.study.record import Study

Artefact: TypeAlias = WorkspaceMap | BinMap | BinPlacement
Result: TypeAlias = Study | Robustness | BasePlacement
"""What is found out about maps and cells; no map itself."""

_RECORDS: Final[dict[str, Callable[[Tree, Path], Artefact | Result]]] = {
    "workspace_map": workspace_map_from_tree,
    "bin_map": bin_map_from_tree,
    "bin_placement": placement_from_tree,
    "base_placement": base_from_tree,
    "study": study_from_tree,
    "robustness": robustness_from_tree,
}


_TREES: Final[dict[str, Callable[[Any], Tree]]] = {
    "workspace_map": tree_from_workspace_map,
    "bin_map": tree_from_bin_map,
    "bin_placement": tree_from_placement,
    "base_placement": tree_from_base,
    "study": tree_from_study,
    "robustness": tree_from_robustness,
}


def read_artefact(path: str | Path) -> Artefact | Result:
    """Read an artefact of any kind; everything about it is checked.

    Raises
    ------
    MapFileError
        The file is missing, damaged, or no artefact at all.
    """
    path = Path(path)
    tree, layout = load_any(path)
    return _RECORDS[layout.kind](tree, path)


def kind_of(record: Artefact | Result) -> str:
    """Kind of a record, as in ``"bin_map"``."""
    if isinstance(record, WorkspaceMap):
        return "workspace_map"
    if isinstance(record, Study):
        return "study"
    if isinstance(record, Robustness):
        return "robustness"
    if isinstance(record, BasePlacement):
        return "base_placement"
    return "bin_map" if isinstance(record, BinMap) else "bin_placement"


def tree_of(record: Any) -> Tree:
    """What the file of a record will hold."""
    return _TREES[kind_of(record)](record)


LAYOUTS: Final[dict[str, Layout]] = {
    layout.kind: layout
    for layout in (WORKSPACE, BIN, PLACEMENT, BASE, STUDY, ROBUSTNESS)
}
"""Kind to format."""


def load_any(path: Path) -> tuple[Tree, Layout]:
    """Read an artefact of any kind as a tree; see :func:`store.load`."""
    return load(path, *LAYOUTS.values())


def read_provenance(path: Path) -> Provenance:
    """Read what any artefact was made from.

    Raises
    ------
    MapFileError
        The file is not an artefact, or it is damaged.
    """
    tree, _ = load_any(path)
    return provenance_of(tree, path)
