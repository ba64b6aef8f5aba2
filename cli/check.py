"""``reachmap check``: load a cell and summarise it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from reachmap.cli.diagnostics import RunState
from reachmap.cli.options import cell_argument, json_option, set_option
from reachmap.cli.terminal import print_answer

if TYPE_CHECKING:
    from reachmap.tools.check import CellCheck


@click.command()
@cell_argument
@set_option
@json_option
@click.pass_context
def command(
    ctx: click.Context, cell: str, overrides: tuple[str, ...], as_json: bool
) -> None:
    """Check a cell: joints, bodies, limits, scan configuration.

    CELL is the name of a shipped cell or the path of a cell file. Nothing is planned.
    With -v the collision pairs are listed. Exits with code 2 if the cell is invalid or
    its scan configuration is out of limits or in collision; the joint or the two
    bodies are named.

    Example: reachmap check my-cell.yaml --set bin.pose.xyz=[0.6,0,-0.1]
    """
    from reachmap.errors import SceneError
    from reachmap.tools.check import check

    answer = check(cell, overrides)
    state = ctx.find_object(RunState)
    verbose = state is not None and state.verbosity > 0
    print_answer(
        dataclasses.asdict(answer),
        lambda: "\n".join(_lines(answer, verbose=verbose)),
        as_json=as_json,
    )
    if answer.problems:
        raise SceneError(answer.problems)


def _lines(answer: CellCheck, *, verbose: bool) -> Iterator[str]:
    """Lay the answer out for people."""
    exact = "all branches" if answer.ik_complete else "not proved complete"
    point = ", ".join(f"{v:.3f}" for v in answer.tcp_at_scan_m)
    direction = ", ".join(f"{v:.3f}" for v in answer.approach_at_scan)
    yield f"cell    {answer.name}  (sha256 {answer.sha256[:12]})"
    yield f"robot   {answer.robot}"
    tilt = answer.base_tilt_deg
    tilted = f", tilted {tilt:g} deg from the world's vertical" if tilt else ""
    yield f"base    {answer.base_frame}{tilted}"
    yield f"tcp     on {answer.tcp_parent}, approach {answer.approach_axis}"
    yield f"        at the scan configuration ({point}) m, approaching ({direction})"
    yield f"ik      {answer.ik_method}, {exact}"
    if answer.ik_approximation:
        yield f"        {answer.ik_approximation}"
    yield ""
    yield from _joint_table(answer)
    yield ""
    yield "bodies"
    width = max(len(row.name) for row in answer.bodies)
    for row in answer.bodies:
        touch = f", may touch {', '.join(row.touch)}" if row.touch else ""
        yield f"  {row.name:<{width}}  on {row.attach_to}: {row.shape}{touch}"
    yield ""
    left_out = f"{len(answer.proved_pairs)} more can never collide"
    yield f"collision pairs  {len(answer.pairs)} checked, {left_out}"
    if verbose:
        yield from (f"  {pair}" for pair in answer.pairs)
        yield from (f"  {pair} (never collide)" for pair in answer.proved_pairs)
    yield (
        f"resolution  planning step {answer.planning_step_rad:g} rad, verification "
        f"{answer.verification_distance_m * 1e3:g} mm, margin "
        f"{answer.safety_margin_m * 1e3:g} mm"
    )
    frames, grasps = f"{answer.test_frames:,}", f"{answer.test_grasps:,}"
    yield f"scans   {frames} test frames, {grasps} test grasps"
    if answer.below_rim_m > 0:
        yield (
            f"approach  {answer.approach_m:g} m, starts up to {answer.below_rim_m:.3g} "
            "m below the rim (bin_scan.approach_distance_m: clear_rim starts above it)"
        )
    else:
        yield f"approach  {answer.approach_m:g} m, starts above the rim"
    yield from (f"warning: {warning}" for warning in answer.warnings)
    yield f"scan configuration  {'INVALID' if answer.problems else 'valid'}"
    yield from (f"  {problem}" for problem in answer.problems)


def _joint_table(answer: CellCheck) -> Iterator[str]:
    width = max(len("joint"), *(len(row.name) for row in answer.joints))
    yield (
        f"{'joint':<{width}}  unit     lower     upper  velocity/s  "
        f"acceleration/s²      scan"
    )
    for row in answer.joints:
        mark = "" if row.within_limits else "  outside its limits"
        yield (
            f"{row.name:<{width}}  {row.unit:<4} {row.lower:>9.4g} {row.upper:>9.4g}  "
            f"{row.velocity:>10.4g}  {row.acceleration:>15.4g} {row.scan:>9.4g}{mark}"
        )
