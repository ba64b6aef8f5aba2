"""``reachmap compare``: what changed from one map to another."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from reachmap.cli.options import (
    INPUT_FILE,
    OUTPUT_PATH,
    json_option,
    overwrite_option,
    unused,
)
from reachmap.cli.quantities import FINITE, FiniteRange
from reachmap.cli.terminal import print_answer


@click.command()
@click.argument("before", metavar="BEFORE", type=INPUT_FILE)
@click.argument("after", metavar="AFTER", type=INPUT_FILE)
@click.argument("others", metavar="[MORE]...", nargs=-1, type=INPUT_FILE)
@click.option(
    "--frame",
    type=click.Choice(["robot_base", "bin", "world"]),
    default="robot_base",
    show_default=True,
    help="Frame in which poses are matched; bin compares bins at different places, "
    "world compares robots at different places.",
)
@click.option(
    "--tolerance",
    type=(FiniteRange(min=0, min_open=True), FiniteRange(0, 90, True)),
    default=(0.1, 0.1),
    show_default=True,
    metavar="MM DEG",
    help="Poses closer than this match.",
)
@click.option(
    "--fail-under",
    type=FINITE,
    metavar="POINTS",
    help="Exit with 1 if path reachability changes by less than this many percentage "
    "points; -0.5 allows a loss of half a point.",
)
@click.option(
    "--picture",
    type=OUTPUT_PATH,
    metavar="PATH",
    help="Draw the change: a .png or .svg file for the level that changed most, or a "
    "folder for that and an overview.",
)
@overwrite_option
@json_option
def command(
    before: Path,
    after: Path,
    others: tuple[Path, ...],
    frame: Literal["robot_base", "bin", "world"],
    tolerance: tuple[float, float],
    fail_under: float | None,
    picture: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Compare two maps of the same kind, frame by frame.

    BEFORE and AFTER are two workspace maps or two bin maps, for example of a cell
    before and after its camera housing was made slimmer. Test frames are matched by
    pose, not by index. The answer says how reachability changed and whether the change
    is significant, which frames were gained and lost, why and where, and how the two
    cells differ. With MORE maps, each is compared with BEFORE, and all are drawn.

    Example: reachmap compare bin.h5 slim/bin.h5 --fail-under -0.5
    """
    if picture is None:
        unused("overwrite", because="needs --picture")
    from reachmap.cli.text.compare import compare_many_text, compare_text
    from reachmap.tools.compare import compare_many, draw, draw_many

    found = compare_many(
        before,
        [after, *others],
        frame=frame,
        tolerance_m=tolerance[0] / 1000.0,
        tolerance_deg=tolerance[1],
    )
    one = found.each[0]
    if picture is not None and others:
        draw_many(found, picture, overwrite=overwrite)
    elif picture is not None:
        draw(one, picture, overwrite=overwrite)
    print_answer(
        found.facts() if others else one.facts(),
        lambda: compare_many_text(found) if others else compare_text(one),
        as_json=as_json,
    )
    if fail_under is not None:
        found.require(fail_under)
