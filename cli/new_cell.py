"""``reachmap new-cell``: a commented starter cell from a URDF."""

from __future__ import annotations

import json
from pathlib import Path

import click

from reachmap.cli.options import json_option, output_option, overwrite_option


@click.command()
@click.argument("urdf")
@click.option(
    "--base", metavar="LINK", help="Link to measure from; by default guessed."
)
@click.option(
    "--tip", metavar="LINK", help="Link that carries the tool; by default guessed."
)
@output_option("cell.yaml", help="Write the cell here.")
@overwrite_option
@json_option
def command(
    urdf: str,
    base: str | None,
    tip: str | None,
    output: Path,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write a commented starter cell for a robot.

    URDF is the path of a .urdf or .xacro file, or package://NAME/PATH. Chain, joints,
    limits, a bin and a free scan configuration are filled in; what had to be guessed
    is marked GUESS. If links touch in every position, an SRDF that says so is written
    beside the cell.

    Example: reachmap new-cell robot.urdf -o cell.yaml
    """
    from reachmap.tools.new_cell import new_cell

    made = new_cell(urdf, output=output, base=base, tip=tip, overwrite=overwrite)
    if as_json:
        answer = {
            "output": str(made.path),
            "srdf": None if made.srdf_path is None else str(made.srdf_path),
            "base": made.base,
            "tip": made.tip,
            "joints": made.joints,
            "problems": made.problems,
        }
        click.echo(json.dumps(answer))
        return
    count = len(made.joints)
    click.echo(f"{made.path}: {count} joints from {made.base} to {made.tip}")
    if made.srdf_path is not None:
        click.echo(f"{made.srdf_path}: links that touch in every position")
    for problem in made.problems:
        click.echo(f"to be mended: {problem}")
    click.echo(f"next: edit the lines marked GUESS, then reachmap check {made.path}")
