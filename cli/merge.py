"""``reachmap merge``: one artefact from the journals of shards."""

from __future__ import annotations

from pathlib import Path

import click

from reachmap.cli.options import (
    INPUT_FILE,
    json_option,
    output_option,
    overwrite_option,
)
from reachmap.cli.terminal import print_answer


@click.command()
@click.argument("shards", metavar="SHARD...", nargs=-1, required=True, type=INPUT_FILE)
@output_option(holds=".h5", required=True, help="Write the merged artefact here.")
@overwrite_option
@json_option
def command(
    shards: tuple[Path, ...], output: Path, overwrite: bool, as_json: bool
) -> None:
    """Merge the journals of shards into one artefact.

    SHARD... are the journals of all N runs with --shard I/N, in any order. They must
    come from the same cell, seed, settings and package versions.
    The artefact has the same content hash as that of a single run; the journals are
    left as they are.

    Example: reachmap merge bin.shard-*-of-3.journal -o bin.h5
    """
    from reachmap.tools.merge import merge

    outcome = merge(shards, output=output, overwrite=overwrite)
    units = outcome.resumed
    print_answer(
        {"output": str(outcome.path), "shards": len(shards), "units": units},
        lambda: f"{outcome.path}: {units} units of {len(shards)} shards",
        as_json=as_json,
    )
