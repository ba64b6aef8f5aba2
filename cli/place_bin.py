"""``reachmap place-bin``: where the bin should stand."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from reachmap.cli.options import (
    INPUT_FILE,
    OUTPUT_PATH,
    bin_option,
    compose,
    output_option,
    run_options,
    seed_option,
    set_option,
    unused,
    with_bin,
)
from reachmap.runtime.options import RunOptions

if TYPE_CHECKING:
    from reachmap.maps import BinPlacement

AXES = ("x", "y", "z", "yaw")


def parse_fixed(
    ctx: click.Context, parameter: click.Parameter, values: tuple[str, ...]
) -> dict[str, float]:
    """Turn ``z=0`` into {"z": 0.0}."""
    fixed: dict[str, float] = {}
    for value in values:
        name, equals, number = value.partition("=")
        try:
            fixed[name.strip()] = float(number)
        except ValueError:
            equals = ""
        if not equals or name.strip() not in AXES:
            raise click.BadParameter(
                f"{value!r} is not NAME=NUMBER with NAME one of {', '.join(AXES)}, "
                "such as z=0 (metres) or yaw=90 (degrees)."
            )
    return fixed


region_options = compose(
    click.option(
        "--fix",
        "fixed",
        multiple=True,
        callback=parse_fixed,
        metavar="NAME=VALUE",
        help="Keep x, y or z [m] or yaw [deg] at a value, as in z=0. Repeatable.",
    ),
    click.option(
        "--region",
        nargs=4,
        type=float,
        metavar="X0 X1 Y0 Y1",
        help="Keep the bin's centre in this rectangle [m].",
    ),
    click.option(
        "--heights",
        nargs=2,
        type=float,
        metavar="Z0 Z1",
        help="Keep the inner bottom between these heights [m].",
    ),
    click.option(
        "--bin-pose",
        nargs=4,
        type=float,
        metavar="X Y Z YAW",
        help="Score this pose [m, m, m, deg] instead of searching for one.",
    ),
)


@click.command()
@click.argument(
    "workspace", metavar="[WORKSPACE]", type=INPUT_FILE, default="workspace.h5"
)
@click.option(
    "--rule",
    type=click.Choice(["search", "paper"]),
    default="search",
    show_default=True,
    help="search looks for the best of all poses; paper takes the best level and the "
    "100 % point in its densest patch.",
)
@region_options
@click.option(
    "--top",
    type=click.IntRange(min=1, max=100),
    default=5,
    show_default=True,
    metavar="N",
    help="Different places to map with the bin in the scene, and rows to print.",
)
@click.option(
    "--tolerance",
    nargs=2,
    type=click.FloatRange(min=0),
    metavar="SHIFT TURN",
    help="Choose for the worst case while the bin is off by this [m, deg]; 0 0 for the "
    "pose itself. Default: the cell's placement.tolerance.",
)
@click.option(
    "--keep-scan-configuration",
    is_flag=True,
    help="Leave the cell's own scan configuration.",
)
@click.option(
    "--picture",
    type=OUTPUT_PATH,
    metavar="PATH",
    help="Draw the decision there, too: .png or .svg.",
)
@bin_option
@output_option("placement.h5")
@set_option
@seed_option
@run_options
def command(
    workspace: Path,
    rule: str,
    fixed: dict[str, float],
    region: tuple[float, float, float, float] | None,
    heights: tuple[float, float] | None,
    bin_pose: tuple[float, float, float, float] | None,
    top: int,
    tolerance: tuple[float, float] | None,
    keep_scan_configuration: bool,
    picture: Path | None,
    bin_name: str | None,
    output: Path,
    overrides: tuple[str, ...],
    seed: int | None,
    as_json: bool,
    run: RunOptions,
) -> None:
    """Find where the bin should stand, and its scan configuration.

    WORKSPACE is what workspace-scan wrote; by default workspace.h5 in this folder.
    Poses are scored on the map; the best are mapped again with the bin in the scene.
    The result holds the cell with its new bin pose and scan configuration, so that
    bin-scan needs nothing else. The margin is how far the bin may be off before the
    score drops by 5 points.

    Several bins are placed together, each beside the others, and each gets a file of
    its own (placement-NAME.h5).

    Example: reachmap place-bin workspace.h5 --fix z=0 --region 0.2 0.8 -0.5 0.5
    """
    if bin_pose is not None:
        unused(
            "rule", "fixed", "region", "heights", because="--bin-pose is not searched"
        )
    from reachmap.tools.place_bin import PlacementChoice, place_bin, placement_facts
    from reachmap.tools.place_bins import bin_names, named_output, place_bins

    limits = {} if region is None else {"x": region[:2], "y": region[2:]}
    choice = PlacementChoice(
        rule=rule,
        bin_pose=bin_pose,
        limits=limits | ({} if heights is None else {"z": heights}),
        fixed=fixed,
        top=top,
        tolerance=tolerance,
        keep_scan_configuration=keep_scan_configuration,
    )
    if bin_name is None and len(bin_names(workspace)) > 1:
        placements = place_bins(
            workspace,
            output,
            choice=choice,
            overrides=overrides,
            seed=seed,
            picture=picture,
            run=run,
        )
        files = {name: named_output(output, name) for name in placements}
        if as_json:
            bins = {
                name: {"output": str(files[name])} | placement_facts(placement)
                for name, placement in placements.items()
            }
            click.echo(json.dumps({"bins": bins}))
            return
        for name, placement in placements.items():
            click.echo(f"bin {name}")
            for line in _lines(placement, files[name], top):
                click.echo(line)
        return
    placement = place_bin(
        workspace,
        output,
        choice=choice,
        overrides=with_bin(overrides, bin_name),
        seed=seed,
        picture=picture,
        run=run,
    )
    if as_json:
        click.echo(json.dumps({"output": str(output)} | placement_facts(placement)))
    else:
        for line in _lines(placement, output, top):
            click.echo(line)


def _lines(placement: BinPlacement, output: Path, top: int) -> Iterator[str]:
    """Lay the decision out for people."""
    from reachmap.tools.place_bin import best_rows, placement_facts, row_facts

    roles = {
        placement.paper_choice: "paper's rule",
        placement.runner_up: "runner-up",
        placement.chosen: "chosen",
    }
    rows = best_rows(placement, top)
    rows += [k for k in (placement.runner_up, placement.paper_choice) if k not in rows]
    yield "      x       y       z   yaw           score  worst case  worst point"
    for row in rows:
        facts = row_facts(placement, row)
        if facts is not None:
            yield _row_text(facts, roles.get(row, ""))
    facts = placement_facts(placement)
    if facts["figure"] == "directions":
        yield "score: reachability of directions, since the tool's roll does not matter"
    if placement.margin:
        yield "margin (score within 5 points): " + _margin_text(facts)
    yield from _stand(facts)
    limit = facts["tool_limit_percent"]
    if limit is not None and limit < 100:
        yield from _limit(facts)
    yield (
        f"{facts['candidates']} poses considered, {facts['mapped_with_bin']} mapped "
        f"with the bin in the scene, {facts['excluded']} excluded"
    )
    yield str(output)


def _stand(facts: dict[str, Any]) -> Iterator[str]:
    """What the bin stands on, and what the worst case is."""
    if facts["support"] is not None:
        stands = facts["support"]
        yield (
            f"the bin stands on {stands}"
            if stands
            else ("the bin floats: no body of the cell is under it")
        )
    tolerance = facts["tolerance"]
    if tolerance and any(tolerance.values()):
        yield (
            f"worst case: the bin off by {1000 * tolerance['shift_m']:.0f} mm and "
            f"{tolerance['turn_deg']:g}°"
        )


def _limit(facts: dict[str, Any]) -> Iterator[str]:
    """What the tool itself loses, and which dimension would move that."""
    body = facts["tool_limit_body"] or "the tool"
    yield (
        f"no pose can score more than {facts['tool_limit_percent']:.1f}%: the tool "
        f"itself meets the bin ({body} most)"
    )
    gains = [
        f"{name} +{points:.1f} points"
        for name, points in (facts["tool_limit_gains"] or {}).items()
        if points >= 0.05
    ]
    short = facts["tool_limit_percent"] - facts["chosen"]["score_percent"]
    error = facts["chosen"].get("score_error_points") or 0.0
    if gains and short <= error:
        yield "the tool is the limit here; 20 mm more would give: " + ", ".join(gains)


def _row_text(facts: dict[str, Any], role: str) -> str:
    x, y, z = facts["xyz_m"]
    pose = f"{x:+7.3f} {y:+7.3f} {z:+7.3f} {facts['yaw_deg']:4.0f}°"
    if facts["score_percent"] is None:
        return f"{pose}  {facts.get('reason', '')}  {role}".rstrip()
    return (
        f"{pose} {facts['score_percent']:6.1f}{_error(facts)}% {_worst(facts)} "
        f"{facts['worst_point_percent']:10.1f}%  {role}"
    ).rstrip()


def _error(facts: dict[str, Any]) -> str:
    error = facts.get("score_error_points")
    return " " * 7 if error is None else f" ± {error:4.2f}"


def _worst(facts: dict[str, Any]) -> str:
    worst = facts.get("worst_case_percent")
    return f"{'-':>11}" if worst is None else f"{worst:10.1f}%"


def _margin_text(facts: dict[str, Any]) -> str:
    shifts = [f"{k} {1000 * v:.0f} mm" for k, v in facts["margin_m"].items()]
    turns = [f"{k} {v:.0f}°" for k, v in facts["margin_deg"].items()]
    return ", ".join([*shifts, *turns])
