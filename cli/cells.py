"""``reachmap cells``: the shipped cells, and the cell of an artefact."""

from __future__ import annotations

import json
from pathlib import Path

import click

from reachmap.cli.options import (
    INPUT_FILE,
    json_option,
    output_option,
    overwrite_option,
    unused,
)


@click.command()
@click.option(
    "--export",
    "artefact",
    type=INPUT_FILE,
    metavar="FILE",
    help="Write the cell that this artefact was made from as YAML.",
)
@output_option(help="Where --export writes; by default standard output.")
@overwrite_option
@json_option
def command(
    artefact: Path | None, output: Path | None, overwrite: bool, as_json: bool
) -> None:
    """List the shipped cells, or export one.

    Without options: name, robot and description of each shipped cell. The name is
    enough wherever a command takes a cell.

    With --export: the cell that an artefact was made from, with overrides, chosen bin
    pose and chosen scan configuration.

    Example: reachmap cells --export placement.h5 -o cell.yaml
    """
    from reachmap.tools.cells import export_cell, list_cells

    if artefact is None:
        unused("output", "overwrite", because="needs --export")
        rows = [
            {"name": row.name, "robot": row.robot, "description": row.description}
            for row in list_cells()
        ]
        if as_json:
            click.echo(json.dumps({"cells": rows}))
            return
        widths = [max(len(row[key]) for row in rows) for key in ("name", "robot")]
        for row in rows:
            name, robot = row["name"].ljust(widths[0]), row["robot"].ljust(widths[1])
            click.echo(f"{name}  {robot}  {row['description']}")
        return
    if output is None:
        unused("overwrite", because="needs --output")
    text = export_cell(artefact, output=output, overwrite=overwrite)
    if as_json:
        target = None if output is None else str(output)
        click.echo(json.dumps({"output": target, "cell_yaml": text}))
    elif output is None:
        click.echo(text, nl=False)
    else:
        click.echo(f"{output}: cell of {artefact}")
