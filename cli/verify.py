"""``reachmap verify``: are files whole, and do they keep to their contract."""

from __future__ import annotations

import json
from pathlib import Path

import click

from reachmap.cli.options import INPUT_FILE, json_option


@click.command()
@click.argument("files", metavar="FILE...", type=INPUT_FILE, nargs=-1, required=True)
@json_option
def command(files: tuple[Path, ...], as_json: bool) -> None:
    """Check a file for damage and against its contract.

    Reads every byte, compares every checksum, computes both hashes anew, and checks
    names, dimensions, types, units, ranges, states and percentages against the format.
    Whole files are named on stdout, each mistake is a line on stderr; the exit code is
    2 if there is any. Journals of unfinished runs can be verified, too.

    Example: reachmap verify workspace.h5 placement.h5 bin.h5
    """
    from reachmap.tools.verify import verify

    found = verify(files)
    if as_json:
        click.echo(json.dumps(found.facts()))
    else:
        for verdict in found.whole:
            click.echo(verdict.text)
    found.require_whole()
