"""``reachmap place-bin``: where the bin should stand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from reachmap.cli.options import (
    INPUT_FILE,
    OUTPUT_PATH,
    bin_option,
    compose,
    keep_scan_option,
    output_option,
    run_options,
    seed_option,
    set_option,
    unused,
    with_bin,
)
from reachmap.cli.quantities import FINITE, FiniteRange
from reachmap.cli.terminal import print_answer
from reachmap.runtime.options import RunOptions

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reachmap.maps.records import BinPlacement

AXES = ("x", "y", "z", "yaw")


def parse_fixed(
    ctx: click.Context, parameter: click.Parameter, values: tuple[str, ...]
) -> dict[str, float]:
    """Turn ``z=0`` into {"z": 0.0}."""
    fixed: dict[str, float] = {}
    for value in values:
        name, equals, text = (part.strip() for part in value.partition("="))
        if name in fixed:
            raise click.BadParameter(f"{name} is given twice.")
        try:
            fixed[name] = FINITE.convert(text, parameter, ctx)
        except click.BadParameter:
            equals = ""
        if not equals or name not in AXES:
            raise click.BadParameter(
                f"{value!r} is not NAME=NUMBER with NAME one of {', '.join(AXES)}, "
                "such as z=0 (metres) or yaw=90 (degrees)."
            )
    return fixed


region_options = compose(
    click.option(
        "--fix",
        "fixed",
        multiple=True,
        callback=parse_fixed,
        metavar="NAME=VALUE",
        help="Keep x, y or z [m] or yaw [deg] at a value, as in z=0. Repeatable.",
    ),
    click.option(
        "--region",
        nargs=4,
        type=FINITE,
        metavar="X0 X1 Y0 Y1",
        help="Keep the bin's centre in this rectangle [m].",
    ),
    click.option(
        "--heights",
        nargs=2,
        type=FINITE,
        metavar="Z0 Z1",
        help="Keep the inner bottom between these heights [m].",
    ),
    click.option(
        "--bin-pose",
        nargs=4,
        type=FINITE,
        metavar="X Y Z YAW",
        help="Score this pose [m, m, m, deg] instead of searching for one.",
    ),
)


@click.command()
@click.argument(
    "workspace", metavar="[WORKSPACE]", type=INPUT_FILE, default="workspace.h5"
)
@click.option(
    "--rule",
    type=click.Choice(["search", "paper"]),
    default="search",
    show_default=True,
    help="search optimises over all poses; paper takes the best level and the 100 % "
    "point in its densest patch.",
)
@region_options
@click.option(
    "--top",
    type=click.IntRange(min=1, max=100),
    default=5,
    show_default=True,
    metavar="N",
    help="Number of distinct places to map with the bin in the scene and to print.",
)
@click.option(
    "--tolerance",
    type=(FiniteRange(0, 1), FiniteRange(0, 90)),
    metavar="SHIFT TURN",
    help="Optimise the worst case while the bin is off by up to this [m, deg]; 0 0 for "
    "the exact pose. Default: the cell's placement.tolerance.",
)
@keep_scan_option
@click.option(
    "--picture",
    type=OUTPUT_PATH,
    metavar="PATH",
    help="Also draw the decision (.png or .svg).",
)
@bin_option
@output_option("placement.h5")
@set_option
@seed_option
@run_options
def command(
    workspace: Path,
    rule: str,
    fixed: dict[str, float],
    region: tuple[float, float, float, float] | None,
    heights: tuple[float, float] | None,
    bin_pose: tuple[float, float, float, float] | None,
    top: int,
    tolerance: tuple[float, float] | None,
    keep_scan_configuration: bool,
    picture: Path | None,
    bin_name: str | None,
    output: Path,
    overrides: tuple[str, ...],
    seed: int | None,
    as_json: bool,
    run: RunOptions,
) -> None:
    """Find where the bin should stand, and its scan configuration.

    WORKSPACE is the output of workspace-scan, by default workspace.h5 in this folder.
    Poses are scored on the map; the best are mapped again with the bin in the scene.
    The result holds the cell with its new bin pose and scan configuration, so that
    bin-scan needs nothing else. The margin is how far the bin may be off before the
    score drops by 5 points.

    Several bins are placed together so that they do not overlap; each gets its own
    file (placement-NAME.h5).

    Example: reachmap place-bin workspace.h5 --fix z=0 --region 0.2 0.8 -0.5 0.5
    """
    if bin_pose is not None:
        unused("rule", "fixed", "region", "heights", because="not used with --bin-pose")
    from reachmap.cell.text.overrides import given_as
    from reachmap.cli.text.placement import placement_lines
    from reachmap.tools.place_bin import PlacementChoice, place_bin, placement_facts
    from reachmap.tools.place_bins import bin_names, place_bins

    limits = {} if region is None else {"x": region[:2], "y": region[2:]}
    choice = PlacementChoice(
        rule=rule,
        bin_pose=bin_pose,
        limits=limits | ({} if heights is None else {"z": heights}),
        fixed=fixed,
        top=top,
        tolerance=tolerance,
        keep_scan_configuration=keep_scan_configuration,
    )
    how: dict[str, Any] = {"seed": seed, "picture": picture, "run": run}
    if bin_name is None and len(bin_names(workspace)) > 1:
        several = place_bins(
            workspace, output, choice=choice, overrides=overrides, **how
        )
        _print_several(several, output, top, as_json=as_json)
        return
    with given_as({f"pick_from={bin_name}": f"--bin {bin_name}"}):
        placement = place_bin(
            workspace,
            output,
            choice=choice,
            overrides=with_bin(overrides, bin_name),
            **how,
        )
    print_answer(
        {"output": str(output)} | placement_facts(placement),
        lambda: "\n".join(placement_lines(placement, output, top)),
        as_json=as_json,
    )


def _print_several(
    placements: Mapping[str, BinPlacement], output: Path, top: int, *, as_json: bool
) -> None:
    """Answer with the place of each bin, and the file that it went to."""
    from reachmap.cli.text.placement import placement_lines
    from reachmap.tools.place_bin import placement_facts
    from reachmap.tools.place_bins import named_output

    files = {name: named_output(output, name) for name in placements}
    facts = {
        name: {"output": str(files[name])} | placement_facts(placement)
        for name, placement in placements.items()
    }
    lines = [
        line
        for name, placement in placements.items()
        for line in (f"bin {name}", *placement_lines(placement, files[name], top))
    ]
    print_answer({"bins": facts}, lambda: "\n".join(lines), as_json=as_json)
