"""``reachmap study``: which change of a cell helps most, and is it significant."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from reachmap.cli.options import (
    cell_argument,
    executor_option,
    into_run,
    json_option,
    output_option,
    overwrite_option,
    progress_option,
    restart_option,
    seed_option,
    set_option,
    workers_option,
)
from reachmap.cli.terminal import print_answer
from reachmap.runtime.options import RunOptions

OBJECTIVES = (
    "level_average",
    "bin_reachability",
    "directions",
    "points",
    "path_length_rad",
    "motion_time_s",
    "robust_reachability",
    "emptied",
    "cycle_reachability",
    "cycle_time_s",
)


@click.command()
@cell_argument
@click.option(
    "--vary",
    multiple=True,
    required=True,
    metavar="NAME=VALUES",
    help="What to vary: a parameter of the cell, or a key as in --set; NAME=LOW:HIGH:N "
    "for N evenly spaced values, NAME=a,b,c for a list. Repeatable.",
)
@click.option(
    "--latin-hypercube",
    "samples",
    type=click.IntRange(min=2),
    metavar="N",
    help="N samples of the ranges (NAME=LOW:HIGH) instead of every combination.",
)
@click.option(
    "--optimise",
    type=click.IntRange(min=2),
    metavar="N",
    help="Let an optimiser propose N variants in turn, from values, NAME=LOW:HIGH:N or "
    "NAME=LOW:HIGH, each based on the results so far.",
)
@click.option(
    "--halving",
    is_flag=True,
    help="Map all variants on coarse grids first and drop those of the worse half that "
    "are surely below the best; rows say so.",
)
@click.option(
    "--place/--keep-bin",
    default=False,
    show_default=True,
    help="Place the bin for each variant, or keep it where the cell has it.",
)
@click.option(
    "--objective",
    "objectives",
    type=click.Choice(OBJECTIVES),
    multiple=True,
    help="Objectives to compute; the first decides which variant is best. Repeatable; "
    "default: the five that every cell has, bin_reachability first.",
)
@click.option(
    "--require",
    multiple=True,
    metavar="'NAME >= NUMBER'",
    help="What the best variant must meet; exit with 1 if none does. Repeatable.",
)
@output_option("study.h5")
@set_option
@seed_option
@workers_option
@executor_option
@restart_option
@overwrite_option
@progress_option
@json_option
@into_run
def command(
    cell: str,
    output: Path,
    as_json: bool,
    run: RunOptions,
    **settings: Any,
) -> None:
    """Map variants of a cell; find which changes are significant.

    CELL is a shipped cell by name, or the path of a cell file. Each variant is mapped
    with the same seed and compared frame by frame with the variant that is closest to
    the cell as it is. A variant that fails is a row with its cause; if all fail, the
    exit code is 2. After Ctrl-C the same command resumes.

    Example: reachmap study ur5-eye-in-hand --vary tube_length=0.119,0.219,0.319
    """
    from reachmap.cli.text.study import study_lines
    from reachmap.maps.summary.study import summarise_study
    from reachmap.tools.study import require_feasible, require_mapped, study

    result = study(cell, output, run=run, **settings)
    summary = summarise_study(result)
    print_answer(
        {"output": str(output)} | asdict(summary),
        lambda: "\n".join([*study_lines(summary), str(output)]),
        as_json=as_json,
    )
    require_mapped(result)
    require_feasible(result)
