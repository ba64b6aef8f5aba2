"""``reachmap cells``: the shipped cells, and the cell of an artefact."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from reachmap.cli.completing import complete_cells
from reachmap.cli.options import (
    json_option,
    output_option,
    overwrite_option,
    unused,
)
from reachmap.cli.terminal import print_answer


@click.command()
@click.option(
    "--export",
    "source",
    metavar="NAME|FILE",
    shell_complete=complete_cells,
    help="Write a shipped cell, or the cell that an artefact was made from, as YAML.",
)
@output_option(holds=".yaml", help="Where --export writes; by default standard output.")
@overwrite_option
@json_option
def command(
    source: str | None, output: Path | None, overwrite: bool, as_json: bool
) -> None:
    """List the shipped cells, or export one.

    Without options: name, robot and description of each shipped cell. The name is
    enough wherever a command takes a cell.

    With --export: a shipped cell as it stands, its comments included, or the cell that
    an artefact was made from, with overrides, chosen bin pose and chosen scan
    configuration.

    \b
    Example:
      reachmap cells --export ur5-eye-in-hand -o my-cell.yaml
      reachmap cells --export placement.h5 -o cell.yaml
    """
    from reachmap.tools.cells import export_cell, list_cells

    if source is None:
        unused("output", "overwrite", because="needs --export")
        rows = [
            {"name": row.name, "robot": row.robot, "description": row.description}
            for row in list_cells()
        ]
        print_answer({"cells": rows}, lambda: "\n".join(_lines(rows)), as_json=as_json)
        return
    if output is None:
        unused("overwrite", because="needs --output")
    text = export_cell(source, output=output, overwrite=overwrite)
    target = None if output is None else str(output)
    print_answer(
        {"output": target, "cell_yaml": text},
        lambda: text if output is None else f"{output}: cell of {source}",
        as_json=as_json,
    )


def _lines(rows: Sequence[dict[str, str]]) -> Iterator[str]:
    widths = [max(len(row[key]) for row in rows) for key in ("name", "robot")]
    for row in rows:
        name, robot = row["name"].ljust(widths[0]), row["robot"].ljust(widths[1])
        yield f"{name}  {robot}  {row['description']}"
