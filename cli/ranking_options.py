"""Options of the commands that rank grasps: how costs are made, how lists are read."""

from __future__ import annotations

import click

from reachmap.cli.options import compose

FORMATS = (
    "reachmap",
    "isaac_grasp",
    "graspgen",
    "graspnet",
    "suction",
    "suction-normal-first",
    "suction-point-first",
)

list_options = compose(
    click.option(
        "--weights",
        nargs=3,
        type=float,
        default=(1.0, 1.0, 1.0),
        show_default=True,
        metavar="α β δ",
        help="Weights of path length, planning time and execution time.",
    ),
    click.option(
        "--likeness",
        type=float,
        default=0.0,
        show_default=True,
        metavar="ε",
        help="Weight of the distance between grasp and test grasp.",
    ),
    click.option(
        "--neighbours",
        type=click.IntRange(1, 64),
        default=1,
        show_default=True,
        help="Blend the costs of so many test points; 1 takes the nearest.",
    ),
    click.option(
        "--roll",
        type=click.Choice(["as-given", "free", "fixed"]),
        default="as-given",
        show_default=True,
        help="Whether the roll about the approach counts. As given: it is free for "
        "grasps with a direction and fixed for those with an orientation.",
    ),
    click.option(
        "--from",
        "format_name",
        type=click.Choice(FORMATS),
        help="Format of the lists; by default their content tells.",
    ),
    click.option("--frame", metavar="NAME", help="Frame of imported lists."),
)
