"""``reachmap verify``: are files intact, and do they follow their format."""

from __future__ import annotations

from pathlib import Path

import click

from reachmap.cli.options import INPUT_FILE, json_option
from reachmap.cli.terminal import print_answer


@click.command()
@click.argument("files", metavar="FILE...", type=INPUT_FILE, nargs=-1, required=True)
@json_option
def command(files: tuple[Path, ...], as_json: bool) -> None:
    """Check files for damage and against their format.

    Reads every byte, compares every checksum, recomputes both hashes, and checks names,
    dimensions, types, units, ranges, states and percentages against the format. Intact
    files are listed on stdout, each defect is a line on stderr; the exit code is 2 if
    there is any. Journals of unfinished runs can be verified as well.

    Example: reachmap verify workspace.h5 placement.h5 bin.h5
    """
    from reachmap.tools.verify import verify

    found = verify(files)
    print_answer(
        found.facts(),
        lambda: "\n".join(verdict.text for verdict in found.whole),
        as_json=as_json,
    )
    found.require_whole()
