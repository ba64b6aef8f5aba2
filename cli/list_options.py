"""Options of the commands that rank grasp lists."""

from __future__ import annotations

import functools
from typing import Any

import click

from reachmap.cli.options import compose, unused
from reachmap.cli.quantities import FINITE, FiniteRange, GroupsOption

FORMATS = (
    "reachmap",
    "isaac_grasp",
    "graspgen",
    "graspnet",
    "suction",
    "suction-normal-first",
    "suction-point-first",
)


def into_settings(function: Any) -> Any:
    """Pass how grasps are ranked as ``settings: RankSettings, basis: CostBasis``."""

    @functools.wraps(function)
    def command(
        cost: Any, failure_cost_s: float | None, weights: Any, likeness: float,
        margins: Any, neighbours: int, roll: Any,
        max_angle: float | None, normalise: Any, planning_time: Any, **values: Any,
    ) -> Any:  # fmt: skip
        from reachmap.ranking.lookup.settings import CostBasis, RankSettings

        for name in (names := [name for name, _ in margins]):
            if names.count(name) > 1:
                raise click.UsageError(f"--margin {name}: given twice.")
        if cost == "cycle":
            unused(
                "weights", "likeness", "margins", "neighbours", "normalise",
                because="--cost cycle is in seconds and takes no weights",
            )  # fmt: skip
        else:
            unused("failure_cost_s", because="needs --cost cycle")
        settings = RankSettings(
            cost=cost,
            failure_cost_s=failure_cost_s,
            weights=weights,
            likeness=likeness,
            margins=dict(margins),
            neighbours=neighbours,
            roll=roll,
            max_angle_deg=max_angle,
        )
        basis = CostBasis(normalise=normalise, planning_time=planning_time)
        return function(**values, settings=settings, basis=basis)

    return command


list_options = compose(
    click.option(
        "--cost",
        type=click.Choice(["paper", "cycle"]),
        default="paper",
        show_default=True,
        help="paper: the weighted J of Algorithm 1; cycle: predicted seconds per pick, "
        "for maps with whole cycles.",
    ),
    click.option(
        "--failure-cost",
        "failure_cost_s",
        type=FiniteRange(min=0),
        metavar="SECONDS",
        help="What a failed pick costs with --cost cycle; default: the median cycle.",
    ),
    click.option(
        "--weights",
        nargs=3,
        type=FINITE,
        default=(1.0, 1.0, 1.0),
        show_default=True,
        metavar="α β δ",
        help="Weights of path length, planning time and execution time.",
    ),
    click.option(
        "--likeness",
        type=FINITE,
        default=0.0,
        show_default=True,
        metavar="ε",
        help="Weight of the distance between grasp and test grasp.",
    ),
    click.option(
        "--margin",
        "margins",
        type=(
            click.Choice(["clearance", "joint_margin", "singularity", "wind_up"]),
            FINITE,
        ),
        cls=GroupsOption,
        multiple=True,
        metavar="NAME μ",
        help="Weight of a margin of the path: clearance, joint_margin, singularity, or "
        "wind_up (how far the last joint turns). Repeatable.",
    ),
    click.option(
        "--normalise",
        type=click.Choice(["quantile", "max"]),
        default="quantile",
        show_default=True,
        help="What each term is divided by: its 95 % quantile over the reachable test "
        "grasps, or its maximum, as in the paper.",
    ),
    click.option(
        "--planning-time",
        type=click.Choice(["checks", "measured"]),
        default="checks",
        show_default=True,
        help="Measure of planning effort: state checks, identical in every run of a "
        "scan, or measured CPU time, as in the paper.",
    ),
    click.option(
        "--neighbours",
        type=click.IntRange(1, 64),
        default=1,
        show_default=True,
        help="Take the median cost of like orientations at the N nearest test "
        "points, near ones counting more; 1 is the nearest alone, as in the paper.",
    ),
    click.option(
        "--roll",
        type=click.Choice(["as-given", "free", "fixed"]),
        default="as-given",
        show_default=True,
        help="Whether the roll about the approach counts. As given: it is free for "
        "grasps with a direction and fixed for those with an orientation.",
    ),
    click.option(
        "--max-angle",
        type=FiniteRange(0, 180, min_open=True),
        metavar="DEG",
        help="Grasps turned further than this from every orientation of the map are "
        "unlike_map; default: 1.5 times the spacing of its orientations.",
    ),
    click.option(
        "--from",
        "format_name",
        type=click.Choice(FORMATS),
        help="Format of the lists; by default detected from their content.",
    ),
    click.option("--frame", metavar="NAME", help="Frame of imported lists."),
    into_settings,
)
