"""``reachmap place-bin``: where the bin should stand."""

from __future__ import annotations

import json
from pathlib import Path

import click

from reachmap.cli.answers import facts_text
from reachmap.cli.options import (
    INPUT_FILE,
    json_option,
    output_option,
    overwrite_option,
    seed_option,
    set_option,
    workers_option,
)


@click.command()
@click.argument(
    "workspace", metavar="[WORKSPACE]", type=INPUT_FILE, default="workspace.h5"
)
@click.option(
    "--rule",
    type=click.Choice(["paper"]),
    default="paper",
    show_default=True,
    help="paper takes the best level and the 100 % point in its densest patch.",
)
@output_option("placement.h5")
@set_option
@seed_option
@workers_option
@overwrite_option
@json_option
def command(
    workspace: Path,
    rule: str,
    output: Path,
    overrides: tuple[str, ...],
    seed: int | None,
    workers: int,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Find where the bin should stand, and its scan configuration.

    WORKSPACE is what workspace-scan wrote; by default workspace.h5 in this folder. The
    result holds the cell with its new bin pose, so that bin-scan needs nothing else.

    Example: reachmap place-bin workspace.h5 --rule paper
    """
    from reachmap.tools.options import RunOptions
    from reachmap.tools.place_bin import place_bin, summary_of_placement

    placement = place_bin(
        workspace,
        output,
        rule=rule,
        overrides=overrides,
        seed=seed,
        run=RunOptions(workers=workers, overwrite=overwrite),
    )
    facts = {"output": str(output)} | summary_of_placement(placement)
    click.echo(json.dumps(facts) if as_json else facts_text(facts))
