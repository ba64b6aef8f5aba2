"""``info``: any artefact or journal goes in, its summary comes out."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from reachmap.cell.text.data import at, text_at
from reachmap.maps.base.record import BasePlacement
from reachmap.maps.bytes.to_json import json_ready
from reachmap.maps.format.registry import Artefact, Result, kind_of
from reachmap.maps.records import BinMap, BinPlacement, WorkspaceMap
from reachmap.maps.robustness.record import Robustness
from reachmap.maps.robustness.summary import (
    RobustnessSummary,
    summarise_robustness,
)
from reachmap.maps.study.record import Study
from reachmap.maps.summary.base import BaseSummary, summarise_base
from reachmap.maps.summary.bin import BinSummary, summarise_bin
from reachmap.maps.summary.placement import PlacementSummary, summarise_placement
from reachmap.maps.summary.study import StudySummary, summarise_study
from reachmap.maps.summary.workspace import WorkspaceSummary, summarise_workspace
from reachmap.tools.artefacts import read_artefact_or_journal

Summary: TypeAlias = (
    WorkspaceSummary
    | BinSummary
    | PlacementSummary
    | BaseSummary
    | StudySummary
    | RobustnessSummary
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArtefactInfo:
    """An artefact in a few numbers, and where it comes from.

    Attributes
    ----------
    path : Path
    kind : str
        As in ``"bin_map"``.
    finished : bool
        False for the journal of a run that is in progress or was interrupted.
    record : record
        Of its kind.
    summary : summary
        Of its kind.
    """

    path: Path
    kind: str
    finished: bool
    record: Artefact | Result
    summary: Summary

    @property
    def cell_name(self) -> str:
        """Name of the cell, "" if the artefact does not have it."""
        return text_at(self._cell, "name") or ""

    @property
    def bin_name(self) -> str:
        """Which of several bins it is about, "" where there is one, or all are."""
        about_one = isinstance(self.record, BinMap | BinPlacement | Robustness)
        if not about_one or not at(self._cell, "bins"):
            return ""
        return text_at(self._cell, "bin", "name") or ""

    @property
    def _cell(self) -> Any:
        try:
            return json.loads(self.record.provenance.cell_resolved_json)
        except ValueError:
            return None

    def facts(self) -> dict[str, Any]:
        """Everything as JSON values; NaN is null."""
        stamp, provenance = self.record.stamp, self.record.provenance
        facts = {
            "file": str(self.path),
            "kind": self.kind,
            "finished": self.finished,
            **dataclasses.asdict(stamp),
            "cell": self.cell_name,
            "bin": self.bin_name or None,
            "overrides": provenance.overrides,
            "source_sha256": provenance.source_sha256,
            "settings": provenance.settings,
            "packages": provenance.packages,
            "run": dataclasses.asdict(self.record.run),
            "summary": dataclasses.asdict(self.summary),
        }
        return dict(json_ready(facts))


def info(path: str | Path) -> ArtefactInfo:
    """Summarise an artefact, or what the journal of a run holds so far.

    Raises
    ------
    MapFileError
        The file is missing, damaged, or neither artefact nor journal.
    """
    path = Path(path)
    record, finished = read_artefact_or_journal(path)
    summary: Summary
    if isinstance(record, WorkspaceMap):
        summary = summarise_workspace(record)
    elif isinstance(record, BinMap):
        summary = summarise_bin(record)
    elif isinstance(record, Study):
        summary = summarise_study(record)
    elif isinstance(record, Robustness):
        summary = summarise_robustness(record)
    elif isinstance(record, BasePlacement):
        summary = summarise_base(record)
    else:
        summary = summarise_placement(record)
    return ArtefactInfo(
        path=path,
        kind=kind_of(record),
        finished=finished,
        record=record,
        summary=summary,
    )
