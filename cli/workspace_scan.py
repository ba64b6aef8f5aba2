"""``reachmap workspace-scan``: map what the arm reaches around its base."""

from __future__ import annotations

from pathlib import Path

import click

from reachmap.cli.options import (
    cell_argument,
    check_scan_options,
    output_option,
    scan_options,
)
from reachmap.cli.terminal import facts_text, print_answer
from reachmap.runtime.options import RunOptions


@click.command()
@cell_argument
@click.option(
    "--method",
    type=click.Choice(["roadmap", "per-frame"]),
    default="roadmap",
    show_default=True,
    help="roadmap connects the configurations of all frames and plans to what stays "
    "unconnected; per-frame plans to each frame from scratch, as in the paper.",
)
@click.option(
    "--with-bin",
    is_flag=True,
    help="Keep the cell's bin in the scene; by default it is yet to be placed.",
)
@output_option("workspace.h5")
@scan_options
def command(
    cell: str,
    method: str,
    with_bin: bool,
    output: Path,
    overrides: tuple[str, ...],
    seed: int | None,
    dry_run: bool,
    as_json: bool,
    run: RunOptions,
) -> None:
    """Map what the arm reaches around its base.

    CELL is a shipped cell by name or the path of a cell file. Every test frame of
    the cell's cubes gets a state with a cause: a path from the scan configuration, no
    inverse kinematics, a collision of two named bodies, or no path found.

    Example: reachmap workspace-scan ur5-eye-in-hand --seed 7
    """
    check_scan_options(run, dry_run=dry_run)
    from reachmap.tools.prologue import written_by
    from reachmap.tools.workspace_scan import (
        estimate_workspace_scan,
        summary_of_workspace,
        workspace_scan,
    )

    if dry_run:
        facts = estimate_workspace_scan(
            cell,
            method=method,
            with_bin=with_bin,
            overrides=overrides,
            seed=seed,
            run=run,
        )
    else:
        result = workspace_scan(
            cell,
            output,
            method=method,
            with_bin=with_bin,
            overrides=overrides,
            seed=seed,
            run=run,
        )
        facts = {"output": str(written_by(output, run))} | summary_of_workspace(result)
    print_answer(facts, lambda: facts_text(facts), as_json=as_json)
