"""``reachmap new-cell``: a commented starter cell from a URDF."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from reachmap.cli.options import (
    INPUT_FILE,
    json_option,
    output_option,
    overwrite_option,
)
from reachmap.cli.terminal import print_answer

if TYPE_CHECKING:
    from reachmap.tools.new_cell import NewCell


def _pairs(
    ctx: click.Context, parameter: click.Parameter, values: tuple[str, ...]
) -> dict[str, str]:
    """Split ``NAME=VALUE``, or ``name:=value`` as ROS writes it."""
    pairs: dict[str, str] = {}
    for text in values:
        name, equals, value = text.partition("=")
        name = name.removesuffix(":")
        # Of a package both are names; an argument may be empty.
        is_package = parameter.name == "packages"
        if not equals or not name or (is_package and ("/" in name or not value)):
            usual = "NAME:=VALUE" if parameter.param_type_name == "argument" else None
            raise click.BadParameter(
                f"{text!r} is not {usual or parameter.metavar}", ctx, parameter
            )
        if pairs.setdefault(name, value) != value:
            raise click.BadParameter(f"{name!r} is given twice", ctx, parameter)
    return pairs


@click.command()
@click.argument("urdf")
@click.argument("arguments", nargs=-1, callback=_pairs, metavar="[NAME:=VALUE]...")
@click.option(
    "--package",
    "packages",
    multiple=True,
    callback=_pairs,
    metavar="NAME=FOLDER",
    help="Folder of package://NAME and $(find NAME). Repeatable; needed only for "
    "packages that are not found around the URDF.",
)
@click.option(
    "--xacro-arg",
    "xacro_args",
    multiple=True,
    callback=_pairs,
    metavar="NAME=VALUE",
    help="Argument of a xacro file. Repeatable; NAME:=VALUE after URDF is the same.",
)
@click.option(
    "--moveit-config",
    metavar="FOLDER",
    type=INPUT_FILE,
    help="Take SRDF, joint limits, named states and planning-scene bodies from a "
    "MoveIt configuration.",
)
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
    arguments: dict[str, str],
    packages: dict[str, str],
    xacro_args: dict[str, str],
    moveit_config: Path | None,
    base: str | None,
    tip: str | None,
    output: Path,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write a commented starter cell for a robot.

    URDF is the path of a .urdf or .xacro file, or package://NAME/PATH. Chain, joints,
    limits, a bin and a free scan configuration are filled in; what had to be guessed
    is marked GUESS. Packages and xacro arguments that are given here are written into
    the cell. If links touch in every position, an SRDF that allows it is written beside
    the cell. Exits with code 2 if the cell needs fixing: one that loads is written and
    its problems are listed; one that does not load is not written.

    Example: reachmap new-cell ur.urdf.xacro name:=ur ur_type:=ur10e -o cell.yaml
    """
    from reachmap.errors import SceneError
    from reachmap.tools.new_cell import new_cell

    for name in arguments.keys() & xacro_args.keys():
        raise click.UsageError(f"--xacro-arg {name}: given twice, also as {name}:=…")
    made = new_cell(
        urdf,
        output=output,
        base=base,
        tip=tip,
        packages=packages,
        xacro_args={**arguments, **xacro_args},
        moveit_config=moveit_config,
        overwrite=overwrite,
    )
    for note in made.notes:
        click.echo(f"note: {note}", err=True)
    print_answer(
        {
            "output": str(made.path),
            "srdf": None if made.srdf_path is None else str(made.srdf_path),
            "base": made.base,
            "tip": made.tip,
            "approach_axis": made.approach_axis,
            "joints": made.joints,
            "packages": dict(made.packages),
            "notes": made.notes,
            "problems": made.problems,
        },
        lambda: "\n".join(_lines(made)),
        as_json=as_json,
    )
    if made.problems:
        raise SceneError(
            f"{made.path}: to be fixed: {problem}" for problem in made.problems
        )


def _lines(made: NewCell) -> Iterator[str]:
    """What was written, and what comes next."""
    count = len(made.joints)
    joints = "joint" if count == 1 else "joints"
    yield f"{made.path}: {count} {joints} from {made.base} to {made.tip}"
    if made.srdf_path is not None:
        yield f"{made.srdf_path}: links that touch in every position"
    step = "fix the problems listed" if made.problems else "edit the lines marked GUESS"
    yield f"next: {step}, then reachmap check {made.path}"
