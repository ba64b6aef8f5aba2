"""``reachmap run``: the whole pipeline for a cell, into one folder."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reachmap.cell.loading import read_cell
from reachmap.disk import one_or_more
from reachmap.errors import SettingsError
from reachmap.maps import read_bin_map, read_placement, read_workspace_map
from reachmap.maps.bytes.publish import make_folder
from reachmap.runtime.options import IN_PROCESS, RunOptions
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.heatmap import heatmap
from reachmap.tools.place_bin import place_bin
from reachmap.tools.prologue import with_seed
from reachmap.tools.rank import ListFormat, rank, read_list
from reachmap.tools.report import report
from reachmap.tools.workspace_scan import workspace_scan

logger = logging.getLogger(__name__)

MAPS = ("workspace.h5", "placement.h5", "bin.h5")


@dataclass(frozen=True, slots=True, kw_only=True)
class PipelineAnswer:
    """Files of a run of the pipeline.

    Attributes
    ----------
    made, kept : tuple of Path
        Artefacts that were made now, and that an earlier run had made already.
    report : Path
    """

    made: tuple[Path, ...]
    kept: tuple[Path, ...]
    report: Path

    def facts(self) -> dict[str, Any]:
        """As JSON values."""
        return {
            "made": [str(path) for path in self.made],
            "kept": [str(path) for path in self.kept],
            "report": str(self.report),
        }


def run_pipeline(
    cell: str | Path,
    folder: str | Path,
    *,
    grasps: Sequence[str | Path] = (),
    overrides: Sequence[str] = (),
    seed: int | None = None,
    run: RunOptions = IN_PROCESS,
) -> PipelineAnswer:
    """Scan, place the bin, scan the bin, draw, rank and report.

    What an earlier run left in the folder is kept where it was made from the same cell
    and from each other, and a scan that was interrupted goes on. Pictures, ranked list
    and report are always made again.

    Parameters
    ----------
    cell : str or path
        Shipped name or path.
    folder : path
        It is made if it is missing.
    grasps : sequence of path
        Grasp lists to rank.
    overrides : sequence of str
    seed : int, optional
    run : RunOptions
        With ``overwrite`` nothing is kept; its shard does not apply.

    Raises
    ------
    SettingsError
        The folder holds the results of another cell.
    ReachmapError
        See :mod:`reachmap.errors`.
    """
    if run.shard is not None:
        raise SettingsError("a whole run cannot be one of several shards")
    folder, grasps = Path(folder), one_or_more(grasps)
    changes = with_seed(overrides, seed)
    loaded = read_cell(str(cell), changes)
    if loaded.cell.bins:
        raise SettingsError(
            f"{cell}: has several bins, which are placed together and scanned one by "
            "one: workspace-scan, place-bin, then bin-scan for each placement"
        )
    for source in grasps:
        read_list(source, ListFormat())
    make_folder(folder)
    workspace, placement, bin_map = (folder / name for name in MAPS)
    chain = _Chain(run)
    chain.step(
        workspace,
        lambda: read_workspace_map(workspace).stamp.cell_sha256 == loaded.sha256,
        lambda options: workspace_scan(
            str(cell), workspace, overrides=changes, run=options
        ),
    )
    chain.step(
        placement,
        lambda: (
            read_placement(placement).provenance.source_sha256
            == read_workspace_map(workspace).stamp.content_sha256
        ),
        lambda options: place_bin(workspace, placement, run=options),
    )
    chain.step(
        bin_map,
        lambda: (
            read_bin_map(bin_map).provenance.source_sha256
            == read_placement(placement).stamp.content_sha256
        ),
        lambda options: bin_scan(placement, bin_map, run=options),
    )
    page = _present(folder, grasps)
    return PipelineAnswer(made=tuple(chain.made), kept=tuple(chain.kept), report=page)


def _present(folder: Path, grasps: Sequence[str | Path]) -> Path:
    """Draw the maps of a folder, rank grasps with them, and report; the page."""
    # Always: an earlier run may have been killed among the pictures.
    for name in MAPS:
        heatmap(folder / name, output=folder / "pictures", overwrite=True)
    if grasps:
        rank(
            grasps,
            map_path=folder / MAPS[-1],
            output=folder / "ranked.json",
            chart=folder / "ranking.png",
            overwrite=True,
        )
    return report(folder, output=folder / "report.html", overwrite=True)


class _Chain:
    """Makes artefacts from each other, or keeps existing ones."""

    def __init__(self, run: RunOptions) -> None:
        self._run = run
        self.made: list[Path] = []
        self.kept: list[Path] = []

    def step(
        self,
        path: Path,
        fits: Callable[[], bool],
        make: Callable[[RunOptions], object],
    ) -> None:
        """Keep an artefact that fits, make one that is missing, refuse another."""
        if path.exists() and not self._run.overwrite:
            if not fits():
                raise SettingsError(
                    f"{path}: was made from another cell or by another run; take "
                    "another folder, or replace what is there with --overwrite"
                )
            logger.info("%s: kept", path)
            self.kept.append(path)
            return
        make(self._run)
        self.made.append(path)
