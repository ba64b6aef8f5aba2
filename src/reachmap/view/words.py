"""What the viewer says of an artefact in one line."""

from __future__ import annotations

from reachmap.maps.any_file import Artefact
from reachmap.maps.records import BinMap, WorkspaceMap
from reachmap.maps.statistics import best_level, level_means, saturation_of
from reachmap.plots.placement import placement_words


def headline(record: Artefact | None) -> str:
    """Answer of a map: best level, share of test grasps, or where the bin goes."""
    if record is None:
        return "At the scan configuration"
    if isinstance(record, WorkspaceMap):
        best = best_level(record.path_reachability)
        if best is None:
            return "Workspace map, nothing attempted"
        mean = float(level_means(record.path_reachability)[best])
        z = float(record.z[best]) + 0.0
        return f"Workspace map: best level z = {z:.2f} m, {mean:.1f} %"
    if isinstance(record, BinMap):
        found = saturation_of(record)
        return f"Bin map: {found.share[-1]:.1f} % of {found.total} test grasps reached"
    return placement_words(record)[0]


def has_bin(record: Artefact | None) -> bool:
    """Whether the bin was among the obstacles; a workspace is mapped without it."""
    if record is None:
        return True
    standing = record.provenance.settings.get("with_bin")
    if isinstance(standing, bool):
        return standing
    return not isinstance(record, WorkspaceMap)


def legend_name(record: Artefact | None) -> str:
    """What the colours of the points mean; "" where there are no points."""
    if record is None:
        return ""
    if isinstance(record, WorkspaceMap | BinMap):
        return "path reachability"
    return "score"
