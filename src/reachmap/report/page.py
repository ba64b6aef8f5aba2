"""The report as one page: headline, sections, what is missing."""

from __future__ import annotations

from reachmap import __version__
from reachmap.cell.loaded import LoadedCell
from reachmap.maps.records import BinMap, WorkspaceMap
from reachmap.report.answers import headline_answers
from reachmap.report.cause_part import cause_section
from reachmap.report.cell_part import cell_section
from reachmap.report.folder import RunFolder, chain_doubts
from reachmap.report.map_parts import (
    bin_section,
    placement_section,
    workspace_section,
)
from reachmap.report.markup import Html, bullets, element, joined, paragraph, text
from reachmap.report.origin_part import origin_section
from reachmap.report.ranking_part import ranking_section
from reachmap.report.stylesheet import CSS
from reachmap.report.validation_part import validation_section

HEAD = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
<title>{title}</title>
<style>{css}</style>
</head>
<body>
<main>
"""
CONTENTS = {
    "cell": "Cell",
    "workspace": "Workspace",
    "placement": "Placement",
    "bin": "Bin",
    "causes": "Causes",
    "ranking": "Ranking",
    "validation": "Validation",
    "provenance": "Provenance",
}


def report_page(run: RunFolder, cell: LoadedCell | str) -> str:
    """Write a run as one page without any reference to another file.

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
    sections = _sections(run, cell)
    name = "a cell" if isinstance(cell, str) else cell.cell.name
    title = f"What {name} reaches"
    body = joined(
        [
            _header(title, run, cell, sections),
            headline_answers(run),
            _missing(run),
            *sections.values(),
            element(
                "footer",
                f"Made by reachmap {__version__} from the files of the folder ",
                element("b", run.name),
                ". Percentages are shares of tested tool orientations; lengths are in "
                "metres, in robot_base unless said otherwise.",
            ),
        ]
    )
    head = HEAD.format(title=text(title), css=CSS)
    return f"{head}{body}\n</main>\n</body>\n</html>\n"


def _sections(run: RunFolder, cell: LoadedCell | str) -> dict[str, Html]:
    sections = {"cell": cell_section(cell, run.latest)}
    maps: dict[str, WorkspaceMap | BinMap] = {}
    if run.workspace is not None:
        maps["Workspace"] = run.workspace
        sections["workspace"] = workspace_section(run.workspace)
    if run.placement is not None:
        source = run.placement.provenance.source_sha256
        known = run.workspace
        if known is not None and known.stamp.content_sha256 != source:
            known = None
        sections["placement"] = placement_section(run.placement, known)
    if run.bin_map is not None:
        maps["Bin"] = run.bin_map
        sections["bin"] = bin_section(run.bin_map)
    if maps:
        sections["causes"] = cause_section(maps)
    if run.ranked:
        sections["ranking"] = ranking_section(run.ranked, run.latest)
    if run.validation is not None:
        sections["validation"] = validation_section(run.validation)
    sections["provenance"] = origin_section(run)
    return sections


def _header(
    title: str, run: RunFolder, cell: LoadedCell | str, sections: dict[str, Html]
) -> Html:
    said = "" if isinstance(cell, str) else cell.cell.description
    links = [
        element("a", words, href=f"#{anchor}")
        for anchor, words in CONTENTS.items()
        if anchor in sections
    ]
    return element(
        "header",
        element("h1", title),
        paragraph(said or f"Results of the run in {run.name}", kind="lead"),
        element("nav", joined(links, " ")),
    )


def _missing(run: RunFolder) -> Html:
    """Say plainly what is not there, what cannot be used and what does not fit."""
    items: list[object] = [
        joined([element("b", name), " is not in this folder; ", element("code", how),
                " makes it"], "")
        for name, how in run.missing.items()
    ]  # fmt: skip
    items += [*run.doubts, *chain_doubts(run)]
    if not items:
        return Html("")
    return element(
        "div",
        paragraph(element("b", "What this report does not rest on")),
        bullets(items),
        class_="note",
    )
