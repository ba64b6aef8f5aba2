"""The sections on the workspace, the placement and the bin map."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.records import BinMap, BinPlacement, WorkspaceMap
from reachmap.maps.summary.bin import MEASURES, BinSummary, summarise_bin
from reachmap.maps.summary.evidence import EvidenceSummary
from reachmap.maps.summary.placement import (
    CandidateSummary,
    PlacementSummary,
    summarise_placement,
)
from reachmap.maps.summary.statistics import are_independent
from reachmap.maps.summary.workspace import WorkspaceSummary, summarise_workspace
from reachmap.plots.approach import draw_approach
from reachmap.plots.bin_map import (
    draw_clearance,
    draw_costs,
    draw_directions,
    draw_reachability,
)
from reachmap.plots.curves.emptying import draw_emptying
from reachmap.plots.curves.saturation import draw_saturation
from reachmap.plots.heatmap import draw_level
from reachmap.plots.overview import draw_overview
from reachmap.plots.parts.levels import level_names
from reachmap.plots.parts.stack import stack_of
from reachmap.plots.placement import draw_placement
from reachmap.ranking.lookup.costs import columns_of
from reachmap.ranking.lookup.settings import RankSettings
from reachmap.ranking.lookup.table import table_from_bin_map
from reachmap.report.blocks import (
    Blocks,
    Heading,
    Picture,
    Section,
    Strong,
    Table,
    drawn,
    paragraph,
    section,
    table,
)
from reachmap.report.parts.cycle import cycle_blocks
from reachmap.text import MINUS, count, interval, number, percent, signed

# A choice: as many as a reader takes in.
REASONS_SHOWN = 6


def workspace_section(record: WorkspaceMap) -> Section:
    """Levels in numbers, the best one and all of them as pictures."""
    summary = summarise_workspace(record)
    stack = stack_of(record, "path")
    best = summary.best_level
    pictures = []
    if best is not None:
        pictures.append(
            drawn(
                draw_level(stack, best),
                "The best level from above: the share of tool orientations at each "
                "square that a collision-free path from the scan pose reaches.",
                record,
            )
        )
    pictures.append(
        drawn(draw_overview(stack), "All levels, and the mean of each.", record)
    )
    return section(
        "workspace",
        "What the arm reaches around its base",
        paragraph(
            f"{count(summary.frames, 'tool pose')} were tested. A pose counts as "
            "reached if a collision-free path leads to it that was verified at fine "
            "resolution from end to end. Inverse kinematics alone promises more; the "
            "difference is lost to camera, tool and surroundings."
        ),
        _level_table(summary),
        pictures,
    )


def _level_table(summary: WorkspaceSummary) -> Table:
    names = level_names(np.array([level.z for level in summary.levels]))
    rows = []
    for index in reversed(range(len(summary.levels))):
        level = summary.levels[index]
        name = names[index].replace("-", MINUS)
        mark = Strong(f"{name} (best)") if index == summary.best_level else name
        rows.append(
            (
                mark,
                percent(level.path_percent),
                percent(level.ik_free_percent),
                percent(level.ik_percent),
                f"{level.full_squares} of {level.squares}",
            )
        )
    head = ("z [m]", "path", "collision-free IK", "IK alone", "squares at 100 %")
    return table(head, rows, "<>>>>")


def placement_section(record: BinPlacement, workspace: WorkspaceMap | None) -> Section:
    """Chosen pose, its margin and its alternatives.

    Parameters
    ----------
    record : BinPlacement
    workspace : WorkspaceMap or None
        The map it was chosen from, if that is known.
    """
    summary = summarise_placement(record)
    return section(
        "placement",
        "Where the bin goes",
        paragraph(
            f"Considered: {count(summary.candidates, 'pose')} of the bin, "
            f"{summary.exact} with the bin in the scene (rule: {summary.rule}). The "
            "score is the mean path reachability over the pick volume. Positions are "
            f"in {summary.frame}."
        ),
        _candidate_table(summary),
        Heading("Margin"),
        paragraph(_margin_text(summary)),
        drawn(
            draw_placement(record, workspace),
            "The chosen bin, its alternatives, and every place considered.",
            record,
        ),
        _excluded(summary),
    )


def _candidate_table(summary: PlacementSummary) -> Blocks:
    named = (
        ("chosen", summary.chosen),
        ("runner-up", summary.runner_up),
        ("the paper's rule", summary.paper_choice),
    )
    rows = [_candidate_row(name, one) for name, one in named if one is not None]
    head = ("", "x [m]", "y [m]", "z [m]", "yaw", "score", "worst point", "reachable")
    words = table(head, rows, "<>>>>>>>")
    if summary.runner_up is not None:
        return words
    return [words, paragraph("There is no runner-up.", kind="muted")]


def _candidate_row(name: str, one: CandidateSummary) -> tuple[object, ...]:
    return (
        Strong(name) if name == "chosen" else name,
        *(signed(value, 3) for value in (one.x, one.y, one.z)),
        f"{number(one.yaw_deg, 0)}°",
        percent(one.score),
        percent(one.worst_point),
        percent(one.reachable_share),
    )


def _margin_text(summary: PlacementSummary) -> str:
    if not summary.margin:
        return "Not measured."
    words = [
        f"{name.replace('-', MINUS)} "
        + (f"{number(v, 0)}°" if "yaw" in name else number(1e3 * v, 0, "mm"))
        for name, v in summary.margin.items()
    ]
    return (
        "The score stays within 5 points of its best while the bin moves by "
        f"{', '.join(words)}."
    )


def _excluded(summary: PlacementSummary) -> Blocks:
    if not summary.excluded:
        return None
    rows = [(reason, number) for reason, number in summary.excluded.items()]
    return [
        Heading("Why other places are excluded"),
        table(("reason", "poses"), rows[:REASONS_SHOWN], "<>"),
    ]


def _layer_pictures(
    record: BinMap, cost: FloatArray, layer: int, where: str
) -> Iterator[Picture]:
    """Pictures of a layer; ``where`` names it in the captions of several."""
    if record.margins is not None:
        yield drawn(
            draw_clearance(record, layer),
            f"Clearance on the path to the grasp{where} [mm].",
            record,
        )
    yield drawn(
        draw_reachability(record, layer),
        f"Path reachability at each point{where}.",
        record,
    )
    yield drawn(
        draw_directions(record, layer),
        "A pick needs only one roll and one direction: the share of test "
        f"grasps, of directions and of points that are reached{where}.",
        record,
    )
    yield drawn(
        draw_approach(record, layer),
        f"Which approach directions and rolls work where{where}.",
        record,
    )
    yield drawn(
        draw_costs(record, cost, layer),
        f"Costs{where}: path length, planning and execution time, and J.",
        record,
    )


def bin_section(record: BinMap) -> Section:
    """Reachability, attempts, costs and approach directions inside the bin."""
    summary = summarise_bin(record)
    grasps = table_from_bin_map(record)
    cost = columns_of(grasps, RankSettings()).costs().reshape(grasps.shape)
    pictures = [
        picture
        for layer, name in enumerate(level_names(record.layer))
        for picture in _layer_pictures(
            record,
            cost,
            layer,
            f" in the layer {name} m above the bottom" if summary.layers > 1 else "",
        )
    ]
    return section(
        "bin",
        "What is reached inside the bin",
        paragraph(
            f"{count(summary.grasps, 'test grasp')}, "
            f"{count(summary.repeats, 'attempt')} at each: {summary.reachable} reached."
        ),
        _quadrant_table(summary),
        _emptying(record, summary),
        cycle_blocks(record),
        pictures,
        _shares_paragraph(summary),
        _saturation(record),
        _evidence_paragraph(summary.unreached),
        Heading("Cost of the path to a grasp"),
        _measure_table(summary),
    )


def _emptying(record: BinMap, summary: BinSummary) -> Blocks:
    if summary.emptying is None:
        return None
    return drawn(
        draw_emptying(record, summary.emptying),
        f"Emptying by height of the parts: {summary.emptying.sentence}.",
        record,
    )


def _shares_paragraph(summary: BinSummary) -> Blocks:
    shares = summary.shares
    return paragraph(
        f"Reached are {percent(shares.frames)} of the test grasps, "
        f"{percent(shares.directions)} of the approach directions (with at least one "
        f"roll of the tool) and {percent(shares.points)} of the points (from at least "
        "one direction)."
    )


def _saturation(record: BinMap) -> Blocks:
    """Only attempts of a planner that were repeated saturate."""
    if not are_independent(record):
        return None
    return drawn(
        draw_saturation(record),
        "How the share grows with the number of attempts; bars are 95 % intervals.",
        record,
    )


def _evidence_paragraph(evidence: EvidenceSummary | None) -> Blocks:
    """Evidence behind test grasps without a path."""
    if evidence is None or not evidence.frames or evidence.checks is None:
        return None
    methods = ", ".join(f"{n} {c:,}" for n, c in evidence.method_checks.items())
    sure = evidence.confidence
    least = "" if sure is None else f" Confidence: {100 * sure:.0f} % or more."
    return paragraph(
        f"No path was found to {count(evidence.frames, 'test grasp')} with a free "
        f"goal, after {evidence.checks:,} state checks ({methods}); an independent "
        f"method agrees on {evidence.agreed} of them.{least}"
    )


def _quadrant_table(summary: BinSummary) -> Table:
    rows = []
    parts = [(q.name, q.saturation, q.measures) for q in summary.quadrants]
    for name, found, measures in [
        *parts,
        (Strong("whole bin"), summary.saturation, summary.measures),
    ]:
        if found.total:
            planning = MEASURES["planning_cpu_time"].of(measures["planning_cpu_time"])
            rows.append(
                (
                    name,
                    f"{int(found.hits[-1])} of {found.total}",
                    percent(float(found.share[-1])),
                    interval(float(found.low[-1]), float(found.high[-1])),
                    number(measures["path_length"].mean, 2),
                    number(planning.mean, 2),
                    number(measures["execution_time"].mean, 2),
                )
            )
    head = ("quadrant", "reached", "share", "95 % interval", "path [rad]",
            "planning [ms]", "execution [s]")  # fmt: skip
    return table(head, rows, "<>>>>>>")


def _measure_table(summary: BinSummary) -> Table:
    rows = []
    for name, measure in summary.measures.items():
        shown = MEASURES[name]
        spread = shown.of(measure)
        if spread.count:
            values = (spread.mean, spread.std, spread.low, spread.median, spread.high)
            numbers = (number(value, 3) for value in values)
            rows.append((f"{shown.label} [{shown.unit}]", *numbers))
    return table(("", "mean", "std", "least", "median", "most"), rows, "<>>>>>")
