"""``reachmap validate``: predictions of a bin map against real planning."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from reachmap.cli import options
from reachmap.cli.list_options import list_options
from reachmap.cli.terminal import print_answer
from reachmap.runtime.options import RunOptions

if TYPE_CHECKING:
    from reachmap.ranking.lookup.settings import CostBasis, RankSettings


@click.command("validate")
@click.argument("map_path", metavar="MAP", type=options.INPUT_FILE)
@click.argument("grasps", nargs=-1, metavar="[GRASPS]...")
@click.option(
    "--random",
    type=click.IntRange(min=1),
    metavar="N",
    help="Add a list of N grasps drawn uniformly between the test points and their "
    "approach directions.",
)
@click.option(
    "--repeats",
    type=click.IntRange(1, 255),
    metavar="N",
    help="Attempts at each grasp; by default as many as the map has.",
)
@click.option(
    "--attempts",
    type=click.Choice(["roadmap", "planner"]),
    help="roadmap: over two roadmaps made for the grasps, with other seeds; planner: "
    "from scratch each time with the cell's planner, as in the paper; default: the "
    "map's.",
)
@click.option(
    "--rolls",
    type=click.IntRange(1, 360),
    default=24,
    show_default=True,
    help="Tool rolls tried about the approach, where the roll is free.",
)
@click.option(
    "--top",
    type=click.IntRange(min=1),
    default=10,
    show_default=True,
    metavar="N",
    help="How many of the first grasps of each order to compare.",
)
@list_options
@click.option(
    "--chart",
    type=options.OUTPUT_PATH,
    metavar="PATH",
    help="Draw predicted against measured cost, and the first grasps of each order.",
)
@click.option(
    "--calibrate",
    is_flag=True,
    help="Write MAP.calibration.json beside the map, which makes the probabilities of "
    "`rank` calibrated.",
)
@options.output_option(
    holds=".json", help="Write the results of every grasp here, as JSON."
)
@options.set_option
@options.seed_option
@options.run_options
def command(
    map_path: Path,
    grasps: tuple[str, ...],
    random: int | None,
    repeats: int | None,
    attempts: str | None,
    rolls: int,
    top: int,
    format_name: str | None,
    frame: str | None,
    chart: Path | None,
    calibrate: bool,
    output: Path | None,
    overrides: tuple[str, ...],
    seed: int | None,
    as_json: bool,
    settings: RankSettings,
    basis: CostBasis,
    run: RunOptions,
) -> None:
    """Test a bin map by planning to real grasps.

    Every grasp is ranked with MAP and then planned to in the map's own cell, bin
    included, as a picking loop would: to the recommended tool orientation first, then
    to every other roll. The answer says how often the map was right, how its costs
    compare with measured ones, and what the first grasps of each order cost.

    \b
    Example:
      reachmap validate bin.h5 grasps.json --chart validation.png
      reachmap validate bin.h5 --random 500 -o results.json
      reachmap validate bin.h5 --random 1000 --calibrate
    """
    if not grasps:
        options.unused("format_name", "frame", because="needs GRASPS")
    if output is None and chart is None and not calibrate:
        options.unused("overwrite", because="needs --output, --chart or --calibrate")
    if attempts is not None:
        overrides = (*overrides, f"bin_scan.attempts={attempts}")
    from reachmap.cli.text.validate import validation_text
    from reachmap.tools.rank import ListFormat
    from reachmap.tools.validate import PickOptions, validate

    answer = validate(
        map_path,
        grasps,
        random=random,
        settings=settings,
        basis=basis,
        list_format=ListFormat(name=format_name, frame=frame),
        pick=PickOptions(rolls=rolls, repeats=repeats, seed=seed, overrides=overrides),
        top=top,
        output=output,
        chart=chart,
        calibrate=calibrate,
        run=run,
    )
    print_answer(
        answer.facts, lambda: validation_text(answer.validation), as_json=as_json
    )
