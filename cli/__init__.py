"""The ``reachmap`` command; one file per subcommand, each a thin client of a tool."""

from __future__ import annotations

import os
from typing import NoReturn

import click

from reachmap.cli.group import PipelineGroup
from reachmap.cli.streams import prepare_streams
from reachmap.cli.verbosity import show_version

__all__ = ["group", "main"]


@click.group(
    cls=PipelineGroup,
    name="reachmap",
    context_settings={
        "auto_envvar_prefix": "REACHMAP",
        "help_option_names": ["-h", "--help"],
        "max_content_width": 88,
    },
)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=show_version,
    help="Show the version and exit; with -v, also those of the engines.",
)
def group() -> None:
    """Path-reachability maps for bin-picking cells.

    A robot cell goes in, maps come out, and every later question is answered from a
    map: where the bin goes, which grasps the arm really reaches, and which to pick
    first. Each command of the pipeline writes one file that the next one reads.

    \b
    Example:
      reachmap workspace-scan
      reachmap heatmap
      reachmap place-bin
      reachmap bin-scan
      reachmap rank grasps.json
    """


def main() -> NoReturn:
    """Run the command line and exit with the code of the table in ``failures``."""
    prepare_streams()
    # Pictures are drawn to files; a notebook's backend may not even be installed here.
    os.environ["MPLBACKEND"] = "agg"
    group.main(prog_name="reachmap")
    raise AssertionError("unreachable")
