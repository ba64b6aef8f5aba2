"""Whether a map was made for a given cell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pydantic import ValidationError

from reachmap.cell.loaded import LoadedCell, fingerprint
from reachmap.cell.model.cell import Cell
from reachmap.errors import MapFileError
from reachmap.maps.records import BinMap

# How a cell is scanned and where its bin stands: stages of the pipeline change these.
# What parameters lead to stands where it is used.
NOT_THE_CELL: Final = (
    "parameters",
    "expressions",
    "scan_configuration",
    "workspace_scan",
    "bin_scan",
    "planner",
    "roadmap",
    "placement",
    "seed",
)


def differing_sections(bin_map: BinMap, loaded: LoadedCell) -> list[str]:
    """Name the sections in which the map's cell differs from the one loaded.

    The pose of the bin and the scan configuration are left out, because placing the
    bin changes them; so are the settings of scans and planner. Files are compared by
    their contents, never by their paths.

    Returns
    -------
    list of str
        Empty when the map holds for the cell.
    """
    if bin_map.stamp.cell_sha256 == loaded.sha256:
        return []
    provenance = bin_map.provenance
    try:
        made_for = Cell.model_validate_json(provenance.cell_resolved_json)
    except ValidationError:
        raise MapFileError("the cell in the bin map is unreadable") from None
    kept: dict[str, Any] = {name: getattr(loaded.cell, name) for name in NOT_THE_CELL}
    placed = made_for.bin.model_copy(
        update={
            "pose": loaded.cell.bin.pose,
            "frame": loaded.cell.bin.frame,
            "on": None,
        }
    )
    neutral = made_for.model_copy(update={**kept, "bin": placed})
    made_sha256 = fingerprint(
        neutral, provenance.urdf, provenance.srdf, provenance.files_sha256
    )
    if made_sha256 == loaded.sha256:
        return []
    return _sections(neutral, loaded.cell) or ["the robot description or a mesh"]


def _sections(a: Cell, b: Cell) -> list[str]:
    left: Mapping[str, Any] = a.model_dump(exclude={"description", "resources"})
    right: Mapping[str, Any] = b.model_dump(exclude={"description", "resources"})
    return [name for name in left if left[name] != right[name]]
