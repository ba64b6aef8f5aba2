"""``reachmap bin-scan``: plan to every test grasp inside the bin."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import click

from reachmap.cli.completing import DEFAULT_CELL
from reachmap.cli.options import (
    INPUT_FILE,
    NameType,
    bin_option,
    cell_option,
    check_scan_options,
    output_option,
    scan_options,
    unused,
    with_bin,
)
from reachmap.cli.terminal import facts_text, print_answer
from reachmap.runtime.options import RunOptions

log = logging.getLogger(__name__)


@click.command()
@click.argument(
    "placement", metavar="[PLACEMENT]", type=INPUT_FILE, required=False, default=None
)
@cell_option
@bin_option
@output_option("bin.h5")
@click.option(
    "--attempts",
    type=click.Choice(["roadmap", "planner"]),
    default=None,
    help="roadmap: paths that branch off one shared roadmap; planner: the cell's "
    "planner from scratch each time, as in the paper. Default: bin_scan.attempts.",
)
@click.option(
    "--part",
    type=NameType(),
    metavar="NAME",
    help="Which of the cell's parts to pick; default: the cell's part, or the first "
    "of its parts.",
)
@scan_options
def command(
    placement: Path | None,
    cell: str | None,
    bin_name: str | None,
    output: Path,
    attempts: str | None,
    part: str | None,
    overrides: tuple[str, ...],
    seed: int | None,
    dry_run: bool,
    as_json: bool,
    run: RunOptions,
) -> None:
    """Plan to every test grasp inside the bin.

    PLACEMENT is the output of place-bin, by default placement.h5 in this folder. It
    holds the cell with its bin pose and scan configuration, so nothing else is needed.
    With --cell, or without a placement.h5, the bin stays where the cell has it: the
    given cell, the one stored in workspace.h5, or the shipped UR5 cell. Each test
    grasp is attempted several times and every attempt is kept. After Ctrl-C the same
    command resumes the scan.

    Example: reachmap bin-scan placement.h5 --set bin_scan.repeats=1
    """
    from reachmap.cell.text.overrides import given_as
    from reachmap.tools.bin_scan import bin_scan, estimate_bin_scan, summary_of_bin
    from reachmap.tools.prologue import written_by

    overrides = with_bin(overrides, bin_name)
    if attempts is not None:
        overrides = (*overrides, f"bin_scan.attempts={attempts}")
    if part is not None:
        overrides = (*overrides, f"part={part}")
    check_scan_options(run, dry_run=dry_run)
    if placement is not None:
        unused("cell", because="PLACEMENT holds the cell; leave one of them out")
        cell = None
    workspace = None
    if placement is None and cell is None:
        placement, workspace = _found_here()
    asked: dict[str, Any] = {
        "cell": cell,
        "workspace": workspace,
        "overrides": overrides,
        "seed": seed,
        "run": run,
    }
    with given_as(
        {f"pick_from={bin_name}": f"--bin {bin_name}", f"part={part}": f"--part {part}"}
    ):
        if dry_run:
            facts = estimate_bin_scan(placement, **asked)
        else:
            result = bin_scan(placement, output, **asked)
            facts = {"output": str(written_by(output, run))} | summary_of_bin(result)
    print_answer(facts, lambda: facts_text(facts), as_json=as_json)


def _found_here() -> tuple[Path | None, Path | None]:
    """Placement to scan, or else the workspace map whose cell to scan."""
    placement, workspace = Path("placement.h5"), Path("workspace.h5")
    if placement.exists():
        return placement, None
    if workspace.exists():
        log.warning("no placement.h5 here: using the bin pose of workspace.h5")
        return None, workspace
    log.warning("no placement.h5 here: using the bin pose of %s", DEFAULT_CELL)
    return None, None
