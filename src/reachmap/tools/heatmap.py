"""``reachmap heatmap``: an artefact in, pictures out."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from reachmap.disk import as_path
from reachmap.errors import SettingsError
from reachmap.maps import (
    artefact_kind,
    read_bin_map,
    read_placement,
    read_workspace_map,
)
from reachmap.maps.base.format import read_base
from reachmap.maps.format.registry import Artefact, Result
from reachmap.maps.records import BinMap, BinPlacement, WorkspaceMap
from reachmap.maps.robustness.format import read_robustness
from reachmap.maps.study.format import read_study
from reachmap.plots.albums import (
    base_album,
    bin_album,
    placement_album,
    robustness_album,
    study_album,
    workspace_album,
)
from reachmap.plots.parts.files import Picture, Table, write_all
from reachmap.plots.parts.levels import QUANTITIES, Quantity
from reachmap.plots.parts.style import Format, PercentMap
from reachmap.ranking.lookup.costs import columns_of
from reachmap.ranking.lookup.settings import RankSettings
from reachmap.ranking.lookup.table import table_from_bin_map

NO_LEVELS = ("bin_map", "bin_placement", "base_placement", "study", "robustness")

logger = logging.getLogger(__name__)


def heatmap(
    artefact: str | Path,
    *,
    output: str | Path,
    quantity: Quantity | Literal["all"] | None = None,
    levels: Sequence[float] = (),
    workspace: str | Path | None = None,
    percent_map: PercentMap = "RdYlGn",
    kind: Format = "png",
    tables: bool = False,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Draw an artefact of any kind.

    Parameters
    ----------
    artefact : Path
    output : Path
        Folder for the pictures; it is made if it is missing.
    quantity : str, optional
        What to draw of a workspace map; path reachability by default.
    levels : sequence of float
        Heights of the levels to draw [m]; without any, all and an overview.
    workspace : Path, optional
        Map to draw a placement on; by default ``workspace.h5`` beside it, if that is
        the map the placement was made from.
    percent_map : str
        Colour map of reachabilities.
    kind : {"png", "svg"}
    tables : bool
        Write the numbers as CSV files too.
    overwrite : bool
        Replace files that exist.

    Returns
    -------
    tuple of Path
        The files written.
    """
    artefact, output = Path(artefact), Path(output)
    workspace = as_path(workspace)
    found = artefact_kind(artefact)
    if found in NO_LEVELS and (quantity or levels):
        raise SettingsError(
            f"{artefact}: --quantity and --level are for workspace maps (this is a "
            f"{found.replace('_', ' ')})"
        )
    if workspace is not None and found != "bin_placement":
        raise SettingsError(f"{artefact}: --workspace is for placements")
    record: Artefact | Result
    items: list[Picture | Table]
    if found == "bin_map":
        record = read_bin_map(artefact)
        items = _bin_items(record, percent_map, tables)
    elif found == "bin_placement":
        record = read_placement(artefact)
        below = _map_below(artefact, record, workspace)
        items = placement_album(record, below, percent_map=percent_map, tables=tables)
    elif tables and found in NO_LEVELS:
        raise SettingsError(f"{artefact}: --csv is for maps (info --json has all)")
    elif found == "robustness":
        record = read_robustness(artefact)
        items = robustness_album(record)
    elif found == "base_placement":
        record = read_base(artefact)
        items = base_album(record, percent_map=percent_map)
    elif found == "study":
        record = read_study(artefact)
        items = study_album(record, percent_map=percent_map)
    else:
        record = read_workspace_map(artefact)
        chosen = QUANTITIES if quantity == "all" else (quantity or "path",)
        items = workspace_album(
            record, chosen, heights=levels, percent_map=percent_map, tables=tables
        )
    return write_all(
        output,
        items,
        kind=kind,
        config_sha256=record.stamp.config_sha256,
        overwrite=overwrite,
        inputs=[artefact, *(() if workspace is None else [workspace])],
    )


def _bin_items(
    bin_map: BinMap, percent_map: PercentMap, tables: bool
) -> list[Picture | Table]:
    table = table_from_bin_map(bin_map)
    cost = columns_of(table, RankSettings()).costs().reshape(table.shape)
    return bin_album(bin_map, cost, percent_map=percent_map, tables=tables)


def _map_below(
    artefact: Path, placement: BinPlacement, given: Path | None
) -> WorkspaceMap | None:
    """Read the workspace map that a placement was chosen from."""
    path = given or artefact.parent / "workspace.h5"
    if given is None and artefact_kind(path) != "workspace_map":
        logger.warning("%s: not there, so the placement is drawn without a map", path)
        return None
    workspace = read_workspace_map(path)
    if workspace.stamp.content_sha256 == placement.provenance.source_sha256:
        return workspace
    message = f"{path}: not the map that {artefact} was made from"
    if given is not None:
        raise SettingsError(message)
    logger.warning("%s, so it is drawn without one", message)
    return None
