"""``reachmap rank``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from reachmap.cli import options
from reachmap.cli.list_options import list_options
from reachmap.cli.quantities import FINITE
from reachmap.cli.terminal import print_answer

if TYPE_CHECKING:
    from reachmap.ranking.lookup.settings import CostBasis, Invalid, RankSettings
    from reachmap.tools.rank import RankAnswer

AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


class ShareType(click.ParamType):  # type: ignore[type-arg, unused-ignore]
    """A number, or a percentage: (20, False) for ``20``, (20, True) for ``20%``."""

    name = "share"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, bool]:
        """Parse a value; click reports what is not one."""
        if isinstance(value, tuple):
            return value
        text = str(value).strip()
        percent = text.endswith("%")
        try:
            number = float(text.removesuffix("%"))
        except ValueError:
            number = -1.0
        if not 0 <= number < (100.1 if percent else 1e9):
            self.fail(f"{value!r} is neither a number of grasps nor a percentage")
        return number, percent


@click.command("rank")
@click.argument("grasps", nargs=-1, required=True, metavar="GRASPS...")
@click.option(
    "--map",
    "map_path",
    type=options.INPUT_FILE,
    default="bin.h5",
    show_default=True,
    help="The bin map to look costs up in.",
)
@options.output_option(
    holds=".json",
    help="Write the ranked list here and print a table; a folder gets one file per "
    "list. Without it, or with -, the JSON is printed.",
)
@list_options
@click.option(
    "--frame-pose",
    nargs=7,
    type=FINITE,
    metavar="X Y Z QW QX QY QZ",
    help="Pose of the lists' frame in robot_base, where the cell does not define it: a "
    "camera on the wrist, an object.",
)
@click.option(
    "--approach-axis",
    type=click.Choice(AXES),
    help="Approach axis of imported orientations, instead of their format's.",
)
@click.option(
    "--invalid",
    type=click.Choice(["raise", "mark"]),
    default="raise",
    show_default=True,
    help="How to treat grasps without a valid position or orientation (NaN, zero "
    "length, not a rotation): refuse the list, or rank them last as invalid.",
)
@options.cell_option
@options.set_option
@click.option(
    "--force", is_flag=True, help="Rank even if the map was made for another cell."
)
@click.option(
    "--top", type=click.IntRange(min=1), metavar="N", help="Keep only the N best."
)
@click.option("--explain", metavar="ID", help="Explain the rank of one grasp instead.")
@click.option(
    "--chart",
    type=options.OUTPUT_PATH,
    metavar="PATH",
    help="Draw the costs of the first grasps, as supplied and re-ranked.",
)
@click.option(
    "--chart-top",
    type=click.IntRange(min=1),
    default=10,
    show_default=True,
    help="How many of the first grasps the chart averages.",
)
@click.option(
    "--min-reachable",
    type=ShareType(),
    metavar="N|P%",
    help="Exit with 1 if a list has fewer reachable grasps: a number, or a percentage.",
)
@click.option(
    "--fail-if-none-reachable",
    is_flag=True,
    help="Exit with 1 if a list has no reachable grasp.",
)
@options.overwrite_option
@options.json_option
def command(
    grasps: tuple[str, ...],
    map_path: Path,
    output: Path | None,
    format_name: str | None,
    frame: str | None,
    frame_pose: tuple[float, ...] | None,
    approach_axis: str | None,
    invalid: Invalid,
    cell: str | None,
    overrides: tuple[str, ...],
    force: bool,
    top: int | None,
    explain: str | None,
    chart: Path | None,
    chart_top: int,
    min_reachable: tuple[float, bool] | None,
    fail_if_none_reachable: bool,
    overwrite: bool,
    settings: RankSettings,
    basis: CostBasis,
    as_json: bool,
) -> None:
    """Re-order grasp lists by cost, using the bin map alone.

    Each grasp gets the cost of the nearest test grasp: mean path length, planning time
    and execution time, normalised and weighted. Unreachable grasps come last, with the
    cause. GRASPS are files, or - for standard input; the answer is JSON.

    \b
    Example:
      reachmap rank grasps.json -o ranked.json --chart ranking.png
      network | reachmap rank - --top 10 | robot
      reachmap rank grasps.json --explain NW-12
      reachmap rank grasps.json --cost cycle -o ranked.json
    """
    _check_options(cell, output, chart, explain)
    from reachmap.cli.text.rank import ranking_tables
    from reachmap.tools.rank import ListFormat, rank

    to_stdout = output is None or str(output) == "-"
    answer = rank(
        grasps,
        map_path=map_path,
        output=None if to_stdout else output,
        settings=settings,
        basis=basis,
        list_format=ListFormat(
            name=format_name,
            frame=frame,
            frame_pose=frame_pose,
            approach_axis=approach_axis,
            invalid=invalid,
        ),
        cell=cell,
        overrides=overrides,
        force=force,
        top=top,
        explain=explain,
        chart=chart,
        chart_top=chart_top,
        overwrite=overwrite,
    )
    print_answer(
        _facts(answer, to_stdout=to_stdout),
        lambda: (
            answer.explanation
            or (answer.text if to_stdout else ranking_tables(answer.ranked, top))
        ),
        as_json=as_json,
    )
    _check_gates(answer, min_reachable, fail_if_none=fail_if_none_reachable)


def _check_gates(
    answer: RankAnswer,
    min_reachable: tuple[float, bool] | None,
    *,
    fail_if_none: bool,
) -> None:
    """Fail where fewer grasps are reachable than were asked for."""
    if min_reachable is not None:
        number, percent = min_reachable
        answer.require_reachable(number, percent=percent)
    if fail_if_none:
        answer.require_reachable(1)


def _facts(answer: RankAnswer, *, to_stdout: bool) -> Any:
    """Answer as one JSON value: an explanation, the lists, or the files written."""
    if answer.explanation:
        return {"explanation": answer.explanation}
    if to_stdout:
        return answer.documents[0] if len(answer.documents) == 1 else answer.documents
    lists = [
        {
            "list": str(one.grasps.source),
            "grasps": len(one.grasps),
            "counts": one.counts(),
            "doubts": one.doubts,
        }
        for one in answer.ranked
    ]
    return {"output": [str(path) for path in answer.written], "lists": lists}


def _check_options(
    cell: str | None, output: Path | None, chart: Path | None, explain: str | None
) -> None:
    """Refuse options that would have no effect."""
    if cell is None:
        options.unused("overrides", "force", because="needs --cell")
    if chart is None:
        options.unused("chart_top", because="needs --chart")
    if chart is None and (output is None or str(output) == "-"):
        options.unused("overwrite", because="needs --output or --chart")
    if explain is not None and output is None:
        options.unused("top", because="--explain is about one grasp")
