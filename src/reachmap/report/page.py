"""The report as one page: headline, sections, what is missing."""

from __future__ import annotations

import base64

from jinja2 import Environment, PackageLoader, StrictUndefined

from reachmap import __version__
from reachmap.cell.loaded import LoadedCell
from reachmap.maps.records import BinMap, WorkspaceMap
from reachmap.report.answers import headline_answers
from reachmap.report.blocks import Bullets, Code, Section, Strong
from reachmap.report.folder import RunFolder, chain_warnings
from reachmap.report.parts.cause import cause_section
from reachmap.report.parts.cell import cell_section
from reachmap.report.parts.maps import (
    bin_section,
    placement_section,
    workspace_section,
)
from reachmap.report.parts.provenance import origin_section
from reachmap.report.parts.ranking import ranking_section
from reachmap.report.parts.study import study_section
from reachmap.report.parts.validation import validation_section

CONTENTS = {
    "cell": "Cell",
    "workspace": "Workspace",
    "placement": "Placement",
    "bin": "Bin",
    "causes": "Causes",
    "ranking": "Ranking",
    "validation": "Validation",
    "study": "Study",
    "provenance": "Provenance",
}


def report_page(run: RunFolder, cell: LoadedCell | str) -> str:
    """Render a run as one page without references to other files.

    Parameters
    ----------
    run : RunFolder
    cell : LoadedCell or str
        The cell of the latest artefact, or why it cannot be loaded on this machine.

    Returns
    -------
    str
        HTML; equal for equal inputs.
    """
    name = "a cell" if isinstance(cell, str) else cell.cell.name
    said = "" if isinstance(cell, str) else cell.cell.description
    return (
        _environment()
        .get_template("page.html")
        .render(
            title=f"What {name} reaches",
            lead=said or f"Results of the run in {run.name}",
            contents=CONTENTS,
            answers=headline_answers(run),
            missing=_missing(run),
            sections=_sections(run, cell),
            version=__version__,
            folder=run.name,
        )
    )


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("reachmap.report"),
        autoescape=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters["kind"] = lambda block: type(block).__name__
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode("ascii")
    environment.tests["strong"] = lambda text: isinstance(text, Strong)
    environment.tests["code"] = lambda text: isinstance(text, Code)
    return environment


def _sections(run: RunFolder, cell: LoadedCell | str) -> list[Section]:
    latest = run.artefacts[run.latest]
    sections = [cell_section(cell, latest)]
    maps: dict[str, WorkspaceMap | BinMap] = {}
    if run.workspace is not None:
        maps["Workspace"] = run.workspace
        sections.append(workspace_section(run.workspace))
    if run.placement is not None:
        source = run.placement.provenance.source_sha256
        known = run.workspace
        if known is not None and known.stamp.content_sha256 != source:
            known = None
        sections.append(placement_section(run.placement, known))
    if run.bin_map is not None:
        maps["Bin"] = run.bin_map
        sections.append(bin_section(run.bin_map))
    if maps:
        sections.append(cause_section(maps))
    if run.ranked:
        sections.append(ranking_section(run.ranked, latest))
    if run.validation is not None:
        sections.append(validation_section(run.validation))
    if run.study is not None:
        sections.append(study_section(run.study))
    sections.append(origin_section(run))
    return sections


def _missing(run: RunFolder) -> list[Bullets]:
    """List what is missing, unusable or inconsistent."""
    items: list[tuple[object, ...]] = [
        (Strong(name), " is not in this folder; create it with ", Code(how))
        for name, how in run.missing.items()
        if not run.is_study_alone
    ]
    items += [(warning,) for warning in [*run.warnings, *chain_warnings(run)]]
    return [Bullets(tuple(items))] if items else []
