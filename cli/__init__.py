"""The ``reachmap`` command; one file per subcommand, each a thin client of a tool."""

from __future__ import annotations

import os
from typing import NoReturn

from reachmap.cli.group import group
from reachmap.cli.streams import prepare_streams

__all__ = ["group", "main"]


def main() -> NoReturn:
    """Run the command line and exit with the code of the table in ``diagnostics``."""
    prepare_streams()
    # Pictures are drawn to files; a notebook's backend may not even be installed here.
    os.environ["MPLBACKEND"] = "agg"
    group.main(prog_name="reachmap")
    raise AssertionError("unreachable")
