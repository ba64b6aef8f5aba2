"""The artefacts: records, their HDF5 form, provenance, checksums.

A file under its final name is complete, and everything read from it was checked, from
its bytes up to the consistency of its numbers.
"""

from __future__ import annotations

from reachmap.maps.bytes.publish import check_output, check_outputs, publish
from reachmap.maps.bytes.to_json import canonical_json, config_sha256
from reachmap.maps.format.bin import read_bin_map, write_bin_map
from reachmap.maps.format.placement import read_placement, write_placement
from reachmap.maps.format.registry import read_provenance
from reachmap.maps.format.store import artefact_kind
from reachmap.maps.format.workspace import read_workspace_map, write_workspace_map
from reachmap.maps.parts import PathStore
from reachmap.maps.provenance import RunClock, collect_provenance
from reachmap.maps.records import (
    NO_PAIR,
    BinMap,
    BinPlacement,
    CubeMap,
    Provenance,
    RunInfo,
    Stamp,
    Status,
    WorkspaceMap,
    workspace_map_from_cubes,
)

__all__ = [
    "NO_PAIR",
    "BinMap",
    "BinPlacement",
    "CubeMap",
    "PathStore",
    "Provenance",
    "RunClock",
    "RunInfo",
    "Stamp",
    "Status",
    "WorkspaceMap",
    "artefact_kind",
    "canonical_json",
    "check_output",
    "check_outputs",
    "collect_provenance",
    "config_sha256",
    "publish",
    "read_bin_map",
    "read_placement",
    "read_provenance",
    "read_workspace_map",
    "workspace_map_from_cubes",
    "write_bin_map",
    "write_placement",
    "write_workspace_map",
]
