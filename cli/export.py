"""``reachmap export``."""

from __future__ import annotations

from pathlib import Path

import click

from reachmap.cli import options
from reachmap.cli.terminal import print_answer

FORMATS = ("csv", "json", "joint-trajectory", "moveit", "urscript", "krl", "rapid")


@click.command("export")
@click.argument("map_path", metavar="[MAP]", default="bin.h5", type=options.INPUT_FILE)
@click.option(
    "--grasp",
    "grasps",
    multiple=True,
    metavar="Y,X,O",
    help="A test grasp by its indices, with the layer first if there are several. "
    "Repeatable.",
)
@click.option("--all", "every", is_flag=True, help="Every test grasp with a path.")
@click.option(
    "--to",
    type=click.Choice(FORMATS),
    default="csv",
    show_default=True,
    help="Waypoints with times (csv, json), sampled trajectories for ROS "
    "(joint-trajectory, moveit), or a program for a controller.",
)
@options.output_option(help="File to write; without it, or with -, print to stdout.")
@options.overwrite_option
@options.json_option
def command(
    map_path: Path,
    grasps: tuple[str, ...],
    every: bool,
    to: str,
    output: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write verified motions of a bin map for controllers.

    MAP is a bin map, bin.h5 by default. Each motion is the best stored path from the
    scan configuration to a test grasp: straight joint motions that were verified, with
    exact stops at their ends, then the straight approach. Robot languages get joint
    motions without blending, since a blend would leave the verified path.

    \b
    Example:
      reachmap export bin.h5 --grasp 3,7,12 --to urscript -o pick.script
      reachmap export bin.h5 --all --to csv -o motions.csv
    """
    from reachmap.tools.export import export

    to_stdout = output is None or str(output) == "-"
    exported = export(
        map_path,
        grasps=grasps,
        every=every,
        to=to,
        output=None if to_stdout else output,
        overwrite=overwrite,
    )
    facts = {"format": to, "motions": len(exported.motions)}
    facts |= {"text": exported.text} if to_stdout else {"output": str(output)}
    print_answer(
        facts, lambda: exported.text if to_stdout else str(output), as_json=as_json
    )
