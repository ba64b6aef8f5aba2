"""One variant of a study: from its cell to its objectives."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reachmap.cell.loading import LoadedCell
from reachmap.core.memo import Memo, fingerprint
from reachmap.core.scene import Scene
from reachmap.errors import ReachmapError
from reachmap.maps import BinMap, RunInfo, WorkspaceMap
from reachmap.maps.format.bin import tree_from_bin_map
from reachmap.maps.format.placement import placement_from_tree, tree_from_placement
from reachmap.maps.format.workspace import (
    tree_from_workspace_map,
    workspace_map_from_tree,
)
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.study.record import OBJECTIVES
from reachmap.runtime.options import IN_PROCESS
from reachmap.studies.assembly import failure
from reachmap.studies.in_place import payloads_in_place
from reachmap.studies.outcomes import Outcomes, of_bin, of_workspace
from reachmap.tools.bin_scan import bin_scan_work
from reachmap.tools.place_bin import PlacementChoice, placed_bin
from reachmap.tools.workspace_scan import workspace_work

OF_WORKSPACE = frozenset({"level_average"})
# Where the camera looks from matters to place-bin alone; its housing is a body.
NOT_OF_BIN_MAP = ("camera",)
# A workspace map is made without the bin, whatever is to be done with it later.
NOT_OF_WORKSPACE = ("bin", "bin_scan", "placement", *NOT_OF_BIN_MAP)
# What a message calls artefacts that have no files.
MAPPED, PLACED = Path("workspace.h5"), Path("placement.h5")
# What earlier variants have found, in this process.
_MEMO = Memo()


@dataclass(frozen=True, slots=True, kw_only=True)
class VariantUnit:
    """A variant to be computed.

    Attributes
    ----------
    loaded : LoadedCell
    workspace : int
        Which of the workspace maps that variants share; -1: none is needed.
    """

    loaded: LoadedCell
    workspace: int


@dataclass(frozen=True, slots=True, kw_only=True)
class VariantContext:
    """What is the same for all variants.

    Attributes
    ----------
    objectives : tuple of str
    places_bin : bool
        Whether place-bin decides where each variant's bin stands.
    workspaces : sequence of dict
        What :func:`map_workspace` found, map by map.
    """

    objectives: tuple[str, ...]
    places_bin: bool
    workspaces: Sequence[Mapping[str, Any]]


def needs_workspace(objectives: Sequence[str], *, places_bin: bool) -> bool:
    """Whether the objectives need a workspace map."""
    return places_bin or not OF_WORKSPACE.isdisjoint(objectives)


def workspace_key(loaded: LoadedCell) -> str:
    """Equal for cells whose workspace maps have the same frames and results."""
    return fingerprint(loaded, without=NOT_OF_WORKSPACE)


def map_workspace(context: Any, loaded: LoadedCell) -> dict[str, Any]:
    """Results of the test frames of a workspace map, or why there are none."""
    try:
        with _MEMO.active():
            payloads = payloads_in_place(
                workspace_work(loaded),
                Scene.shared(loaded, with_bin=False),
                NOT_OF_WORKSPACE,
            )
    except ReachmapError as error:
        return {"cause": _cause(error), "payloads": []}
    return {"cause": "", "payloads": payloads}


def compute_variant(context: VariantContext, unit: VariantUnit) -> dict[str, Any]:
    """Map a variant; a failure is a result as well."""
    try:
        with _MEMO.active():
            return _computed(context, unit)
    except ReachmapError as error:
        return failure(_cause(error))


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """A variant that an optimiser proposed; without a cell where that is wrong."""

    row: Mapping[str, Any]
    loaded: LoadedCell | None


def compute_proposal(context: VariantContext, unit: Proposal) -> dict[str, Any]:
    """Map a proposed variant, its workspace included; the row goes with it."""
    if unit.loaded is None:
        return failure(unit.row["cause"]) | {"row": dict(unit.row)}
    workspace = -1
    if needs_workspace(context.objectives, places_bin=context.places_bin):
        workspace = 0
        shared = map_workspace(None, unit.loaded)
        context = dataclasses.replace(context, workspaces=[shared])
    found = compute_variant(
        context, VariantUnit(loaded=unit.loaded, workspace=workspace)
    )
    return found | {"row": dict(unit.row)}


def _computed(context: VariantContext, unit: VariantUnit) -> dict[str, Any]:
    sha256: dict[str, str] = {}
    outcomes: dict[str, Outcomes] = {}
    loaded, workspace = unit.loaded, None
    if unit.workspace >= 0:
        shared = context.workspaces[unit.workspace]
        if shared["cause"]:
            return failure(shared["cause"])
        workspace = _assembled_workspace(loaded, shared["payloads"])
        sha256["workspace"] = workspace.stamp.content_sha256
        outcomes |= of_workspace(workspace)
    if not OF_WORKSPACE.issuperset(context.objectives):
        source = ""
        if context.places_bin and workspace is not None:
            loaded, source = _placed(workspace)
            sha256["placement"] = source
        bin_map = _bin_map(loaded, source)
        sha256["bin"] = str(tree_from_bin_map(bin_map).attributes["content_sha256"])
        outcomes |= of_bin(bin_map)
    return {
        "cause": "",
        "sha256": sha256,
        "outcomes": {
            name: dataclasses.asdict(outcomes[name])
            for name in OBJECTIVES
            if name in context.objectives and name in outcomes
        },
    }


def _assembled_workspace(loaded: LoadedCell, payloads: Sequence[Any]) -> WorkspaceMap:
    """The variant's own map, of results that it shares with others."""
    work = workspace_work(loaded)
    record: WorkspaceMap = work.kind.assemble(work.document, payloads, run=RunInfo())
    return workspace_map_from_tree(tree_from_workspace_map(record), MAPPED)


def _placed(workspace: WorkspaceMap) -> tuple[LoadedCell, str]:
    """The cell with its bin placed, and the content hash of the placement.

    As through files, but for the files: a study that is killed leaves none.
    """
    loaded = cell_of_artefact(workspace.provenance, str(MAPPED), ())
    placed = placed_bin(loaded, workspace, PlacementChoice(), IN_PROCESS)
    placement = placement_from_tree(tree_from_placement(placed.placement), PLACED)
    loaded = cell_of_artefact(placement.provenance, str(PLACED), ())
    return loaded, placement.stamp.content_sha256


def _bin_map(loaded: LoadedCell, source_sha256: str) -> BinMap:
    work = bin_scan_work(loaded, source_sha256)
    payloads = payloads_in_place(
        work, Scene.shared(loaded, with_bin=True), NOT_OF_BIN_MAP
    )
    record: BinMap = work.kind.assemble(work.document, payloads, run=RunInfo())
    return record


def _cause(error: ReachmapError) -> str:
    return "; ".join(error.lines)
