"""``reachmap report``."""

from __future__ import annotations

from pathlib import Path

import click

from reachmap.cli import options
from reachmap.cli.terminal import print_answer


@click.command("report")
@click.argument("folder", metavar="FOLDER", type=options.INPUT_FILE)
@options.output_option("report.html", help="The page.")
@options.overwrite_option
@options.json_option
def command(folder: Path, output: Path, overwrite: bool, as_json: bool) -> None:
    """Write a report of a run as one self-contained page.

    FOLDER holds workspace.h5, placement.h5, bin.h5, study.h5, ranked.json and
    validation.json, or some of them; the page says what is missing. It answers where
    the bin goes, how much of it is reached, which grasps come first and which change
    of a study helps most, shows the cell and the maps, names the bodies in the way,
    and lists settings and provenance. Pictures are embedded; the page loads nothing
    from the network and prints well. Its name is printed.

    Example: reachmap report run -o report.html
    """
    from reachmap.tools.report import report

    page = str(report(folder, output=output, overwrite=overwrite))
    print_answer({"output": page}, lambda: page, as_json=as_json)
