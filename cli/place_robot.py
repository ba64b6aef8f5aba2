"""``reachmap place-robot``: where the arm should stand."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from reachmap.cli.options import (
    INPUT_FILE,
    OUTPUT_PATH,
    cell_argument,
    compose,
    keep_scan_option,
    output_option,
    run_options,
    seed_option,
    set_option,
    unused,
)
from reachmap.cli.place_bin import parse_fixed
from reachmap.cli.quantities import FINITE
from reachmap.cli.terminal import print_answer
from reachmap.runtime.options import RunOptions

places_options = compose(
    click.option(
        "--mount",
        "mountings",
        multiple=True,
        metavar="HOW",
        help="Mounting: floor, wall, ceiling, or the tilt of the base [deg]; default: "
        "as in the cell. Repeatable: all are compared.",
    ),
    click.option(
        "--rail",
        default="",
        metavar="JOINT",
        help="Optimise the position of this locked prismatic joint instead.",
    ),
    click.option(
        "--rail-range",
        nargs=2,
        type=FINITE,
        metavar="P0 P1",
        help="Keep the joint of --rail between these positions [m].",
    ),
    click.option(
        "--fix",
        "fixed",
        multiple=True,
        callback=parse_fixed,
        metavar="NAME=VALUE",
        help="Keep x, y or z [m] or yaw [deg] of the base in the world. Repeatable.",
    ),
    click.option(
        "--region",
        nargs=4,
        type=FINITE,
        metavar="X0 X1 Y0 Y1",
        help="Keep the base in this rectangle of the world [m].",
    ),
    click.option(
        "--heights",
        nargs=2,
        type=FINITE,
        metavar="Z0 Z1",
        help="Keep the base between these heights [m]; default: 0.3 m up and down.",
    ),
    click.option(
        "--moves",
        multiple=True,
        metavar="BODY",
        help="A body fixed to the world that moves with the base, besides those that "
        "may touch it. Repeatable.",
    ),
    click.option(
        "--stays",
        multiple=True,
        metavar="BODY",
        help="A body that may touch the base but stays where it is. Repeatable.",
    ),
)


@click.command()
@cell_argument
@places_options
@click.option(
    "--arm",
    "arms",
    multiple=True,
    type=INPUT_FILE,
    metavar="FRAGMENT",
    help="Another arm to compare: a YAML file with sections of a cell (robot, bodies, "
    "scan_configuration, …) that replace those of CELL. Repeatable.",
)
@click.option(
    "--top",
    type=click.IntRange(min=1, max=100),
    default=3,
    show_default=True,
    metavar="N",
    help="Number of distinct places to plan paths from.",
)
@keep_scan_option
@click.option(
    "--picture",
    type=OUTPUT_PATH,
    metavar="PATH",
    help="Also draw the places (.png or .svg).",
)
@output_option("robot.h5")
@set_option
@seed_option
@run_options
def command(
    cell: str,
    mountings: tuple[str, ...],
    rail: str,
    rail_range: tuple[float, float] | None,
    fixed: dict[str, float],
    region: tuple[float, float, float, float] | None,
    heights: tuple[float, float] | None,
    moves: tuple[str, ...],
    stays: tuple[str, ...],
    arms: tuple[Path, ...],
    top: int,
    keep_scan_configuration: bool,
    picture: Path | None,
    output: Path,
    overrides: tuple[str, ...],
    seed: int | None,
    as_json: bool,
    run: RunOptions,
) -> None:
    """Find where the robot should stand for a given bin.

    CELL is a shipped cell by name, or the path of a cell file. The bin and the bodies
    fixed to the world stay; bodies that may touch the robot's base, such as a pedestal,
    move with it. Every place is scored by inverse kinematics and collision checks;
    paths are planned from the best. The result holds the cell with its new base pose,
    ready for bin-scan.

    Example: reachmap place-robot ur5-eye-in-hand --heights -0.2 0.3 --picture robot.png
    """
    if not rail:
        unused("rail_range", because="needs --rail")
    from reachmap.cli.text.base import base_lines
    from reachmap.maps.summary.base import summarise_base
    from reachmap.tools.place_robot import RobotChoice, place_robot

    limits = {} if region is None else {"x": region[:2], "y": region[2:]}
    limits |= {} if heights is None else {"z": heights}
    limits |= {} if rail_range is None else {"x": rail_range}
    placement = place_robot(
        cell,
        output,
        choice=RobotChoice(
            mountings=mountings,
            rail=rail,
            limits=limits,
            fixed=fixed,
            moves=moves,
            stays=stays,
            arms=arms,
            top=top,
            keep_scan_configuration=keep_scan_configuration,
        ),
        overrides=overrides,
        seed=seed,
        picture=picture,
        run=run,
    )
    summary = summarise_base(placement)
    print_answer(
        {"output": str(output)} | asdict(summary),
        lambda: "\n".join([*base_lines(summary), str(output)]),
        as_json=as_json,
    )
