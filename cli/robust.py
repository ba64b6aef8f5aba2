"""``reachmap robust``: what stays reachable despite errors of bin, camera and tool."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from reachmap.cli.options import (
    INPUT_FILE,
    OUTPUT_PATH,
    Decorator,
    output_option,
    run_options,
    seed_option,
)
from reachmap.cli.quantities import ERROR_SIZE, QuantityCommand
from reachmap.cli.terminal import print_answer
from reachmap.runtime.options import RunOptions

NONE = (0.0, 0.0)


def _size_option(name: str, help: str) -> Decorator[Any]:
    return click.option(
        f"--{name}",
        f"{name}_size",
        type=ERROR_SIZE,
        default=NONE,
        metavar="SIZE",
        help=help,
    )


@click.command(cls=QuantityCommand)
@click.argument("bin_map", metavar="BIN_MAP", type=INPUT_FILE)
@_size_option("bin", "Error of the bin's pose: 5mm, 1deg, or both as in 5mm 1deg.")
@_size_option(
    "camera", "Error of the camera's calibration, and so of the grasps it detects."
)
@_size_option("tool", "Error of the tool's mounting.")
@click.option(
    "--samples",
    type=int,
    default=24,
    show_default=True,
    metavar="N",
    help="Perturbed cells per multiple of the errors.",
)
@click.option(
    "--margin",
    type=ERROR_SIZE,
    default=NONE,
    metavar="LENGTH",
    help="Clearance required in a perturbed cell; default: no contact.",
)
@output_option("robustness.h5")
@click.option(
    "--picture",
    type=OUTPUT_PATH,
    metavar="PATH",
    help="Also draw the curve (.png or .svg).",
)
@seed_option
@run_options
def command(
    bin_map: Path,
    bin_size: tuple[float, float],
    camera_size: tuple[float, float],
    tool_size: tuple[float, float],
    samples: int,
    margin: tuple[float, float],
    output: Path,
    picture: Path | None,
    seed: int | None,
    as_json: bool,
    run: RunOptions,
) -> None:
    """Find which grasps survive errors of bin, camera and tool.

    The best path of each test grasp of BIN_MAP is executed as stored. Where its
    clearance exceeds any displacement that errors of this size can cause, it is
    certified; elsewhere it is replayed in cells perturbed by errors of this size in
    random directions. The curve goes up to twice the errors.

    Example: reachmap robust bin.h5 --bin 5mm 1deg --tool 2mm
    """
    from reachmap.cli.text.robustness import robustness_lines
    from reachmap.maps.robustness.summary import summarise_robustness
    from reachmap.robustness.errors import Errors, ErrorSize
    from reachmap.tools.robust import robust

    if margin[1]:
        raise click.BadParameter("expected a length.", param_hint="'--margin'")
    sizes = [
        ErrorSize(shift_m=shift_m, turn_rad=turn_rad)
        for shift_m, turn_rad in (bin_size, camera_size, tool_size)
    ]
    found = robust(
        bin_map,
        output,
        errors=Errors(bin=sizes[0], camera=sizes[1], tool=sizes[2]),
        samples=samples,
        margin_m=margin[0],
        seed=seed,
        picture=picture,
        run=run,
    )
    summary = summarise_robustness(found)
    print_answer(
        {"output": str(output)} | asdict(summary),
        lambda: "\n".join([*robustness_lines(summary), str(output)]),
        as_json=as_json,
    )
