"""``reachmap run``: the whole pipeline, into one folder."""

from __future__ import annotations

from pathlib import Path

import click

from reachmap.cli import options
from reachmap.cli.terminal import print_answer
from reachmap.runtime.options import RunOptions


@click.command()
@options.cell_argument
@click.option(
    "--grasps",
    multiple=True,
    type=options.INPUT_FILE,
    metavar="FILE",
    help="A grasp list to rank. Repeatable.",
)
@options.output_option("run", holds=options.A_FOLDER, help="Folder for everything.")
@options.set_option
@options.seed_option
@options.restart_option
@options.run_options
def command(
    cell: str,
    grasps: tuple[Path, ...],
    output: Path,
    overrides: tuple[str, ...],
    seed: int | None,
    as_json: bool,
    run: RunOptions,
) -> None:
    """Run the pipeline: scan, place the bin, scan it, rank, report.

    CELL is a shipped cell by name or the path of a cell file. The folder gets
    workspace.h5, placement.h5, bin.h5, pictures, report.html and, with --grasps,
    ranked.json. Existing files are kept if they were made from this cell; after Ctrl-C
    the same command resumes.

    Example: reachmap run my-cell.yaml --grasps grasps.json -o run
    """
    from reachmap.tools.run import run_pipeline

    found = run_pipeline(
        cell,
        output,
        grasps=grasps,
        overrides=overrides,
        seed=seed,
        run=run,
    )
    lines = [f"{path}: kept" for path in found.kept]
    lines += [str(path) for path in (*found.made, found.report)]
    print_answer(found.facts(), lambda: "\n".join(lines), as_json=as_json)
