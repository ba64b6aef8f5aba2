"""``reachmap heatmap``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from reachmap.cli import options
from reachmap.cli.quantities import FINITE
from reachmap.cli.terminal import print_answer


@click.command("heatmap")
@click.argument(
    "artefact", metavar="[FILE]", default="workspace.h5", type=options.INPUT_FILE
)
@click.option(
    "--quantity",
    type=click.Choice(["path", "ik", "ik-free", "difference", "all"]),
    help="What to draw of a workspace map: path reachability (the default), IK, "
    "collision-free IK, or the difference between IK and path reachability.",
)
@click.option(
    "--level",
    "levels",
    type=FINITE,
    multiple=True,
    metavar="Z",
    help="Draw the level at this height [m] only. Repeatable.",
)
@click.option(
    "--cmap",
    "percent_map",
    type=click.Choice(["RdYlGn", "viridis", "cividis"]),
    default="RdYlGn",
    show_default=True,
    help="Colours of 0 to 100 %; viridis and cividis suit every colour vision.",
)
@click.option(
    "--format",
    "kind",
    type=click.Choice(["png", "svg"]),
    default="png",
    show_default=True,
    help="Format of the pictures.",
)
@click.option(
    "--workspace",
    type=options.INPUT_FILE,
    metavar="PATH",
    help="The map to draw a placement on; by default workspace.h5 beside it.",
)
@click.option(
    "--csv", "tables", is_flag=True, help="Also write the numbers as CSV files."
)
@options.output_option(
    "heatmaps", holds=options.A_FOLDER, help="Folder for the pictures."
)
@options.overwrite_option
@options.json_option
def command(artefact: Path, as_json: bool, **settings: Any) -> None:
    """Draw a workspace map, one picture per level.

    FILE is a workspace map (by default workspace.h5), a bin map, a placement or a
    study. A workspace map gives a picture of every level, seen from above, and one of
    all levels; a bin map gives its reachability after one and after all attempts, the
    saturation, the costs and the approach directions. Both also show why test frames
    are not reached. A placement gives the bin on its level, the runner-up and the
    places considered; a study its main effects and, for two parameters, their grid.
    The names of the files are printed.

    Example: reachmap heatmap workspace.h5 --quantity all -o heatmaps
    """
    from reachmap.tools.heatmap import heatmap

    names = [str(path) for path in heatmap(artefact, **settings)]
    print_answer({"pictures": names}, lambda: "\n".join(names), as_json=as_json)
