"""The summary of a bin map as people read it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from reachmap.cli.text.cycle import cycle_lines
from reachmap.cli.text.evidence import cause_lines, verdict_text
from reachmap.cli.text.tables import fact_lines, table_lines
from reachmap.maps.summary.bin import (
    MEASURES,
    BinSummary,
    ClearanceShare,
    RefinementSummary,
    Spread,
)
from reachmap.maps.summary.directions import ReachedShares
from reachmap.maps.summary.emptying import Emptying
from reachmap.maps.summary.evidence import EvidenceSummary
from reachmap.maps.summary.reliability import Reliability
from reachmap.maps.summary.statistics import Saturation
from reachmap.text import count_text, percent_text, plural


def bin_lines(summary: BinSummary) -> list[str]:
    """Headline, shares, attempts, causes and quadrants of a bin map."""
    s = summary.saturation
    rows = [["attempts", "reached", "of", "%", "95 % interval"]]
    first = 0 if summary.independent else len(s.attempts) - 1
    rows += [
        [str(k), str(n), str(s.total), f"{share:.2f}", f"{low:.2f} to {high:.2f}"]
        for k, n, share, low, high in zip(
            *(v[first:] for v in (s.attempts, s.hits, s.share, s.low, s.high)),
            strict=True,
        )
    ]
    return [
        f"{plural(summary.grasps, 'test grasp')}, "
        f"{plural(summary.repeats, 'attempt')} each, "
        f"{plural(summary.layers, 'layer')}, {plural(summary.paths, 'stored path')}",
        "",
        "Path reachability",
        *share_lines(summary.shares),
        *_clearance_lines(summary.clearances),
        *_emptying_lines(summary.emptying),
        *cycle_lines(summary.cycle),
        "",
        "Reached after n attempts (Wilson interval)",
        *table_lines(rows, ">>>>>"),
        *_beyond_lines(summary),
        "",
        "Test grasps",
        *cause_lines(summary.causes),
        *_unreached_lines(summary.unreached),
        *_refinement_lines(summary.refinement),
        "",
        "Attempts that found a path",
        *_measure_lines(summary.measures),
        "",
        "Terms of J: share of the variance between grasps, as opposed to chance",
        *reliability_lines(summary.reliability),
        "",
        "Quadrants of the bin (N is +y, E is +x)",
        *_quadrant_lines(summary),
    ]


def share_lines(shares: ReachedShares) -> list[str]:
    """Reachability of frames, of directions and of points, with what each means."""
    rows = (
        ("frames", shares.frames, "test grasps with a path, as in the paper"),
        ("directions", shares.directions, "with a path for at least one roll"),
        ("points", shares.points, "with at least one such direction"),
    )
    return table_lines(
        [[name, f"{percent_text(share)} %", said] for name, share, said in rows], "<><"
    )


def _clearance_lines(shares: Sequence[ClearanceShare]) -> list[str]:
    """Reachability where paths must keep a clearance."""
    if not shares:
        return []
    rows = [
        [f"{1000.0 * share.clearance_m:.0f} mm", f"{percent_text(share.frames)} %"]
        for share in shares
    ]
    return [
        "",
        "Test grasps whose path keeps a clearance of",
        *table_lines(rows, ">>"),
    ]


def _emptying_lines(emptying: Emptying | None) -> list[str]:
    """Reachability by height, from the top down as a bin is emptied."""
    if emptying is None:
        return []
    rows = [["height [mm]", "fill %", "points %", "directions %", "frames %"]]
    with_cycle = emptying.levels[0].cycle is not None
    if with_cycle:
        rows[0].append("cycle %")
    for level in reversed(emptying.levels):
        values = [level.points, level.directions, level.frames]
        if level.cycle is not None:
            values.append(level.cycle)
        rows.append(
            [
                f"{1000.0 * level.height_m:.0f}",
                f"{100.0 * level.fill:.0f}",
                *(percent_text(value) for value in values),
            ]
        )
    below = "" if emptying.filled else " (parts below a layer are not obstacles)"
    return [
        "",
        f"Emptying: {emptying.sentence}{below}",
        *table_lines(rows, ">" * len(rows[0])),
    ]


def _unreached_lines(evidence: EvidenceSummary | None) -> list[str]:
    if evidence is None or not evidence.frames:
        return []
    return ["", "Evidence", *fact_lines([("no path", verdict_text(evidence))])]


def _refinement_lines(refinement: RefinementSummary | None) -> list[str]:
    """What is known between the test grasps, and who asks."""
    if refinement is None:
        return []
    reached = count_text(refinement.reachable, refinement.grasps)
    asked = "" if refinement.asked is None else f" ({refinement.asked} asked for)"
    return [
        "",
        "Between the test grasps, where the roll is free (bin_scan.refine)",
        *fact_lines(
            [
                ("further grasps", f"{refinement.grasps}{asked}"),
                ("reachable", reached),
                ("what for", "rank takes reachable and probability from them"),
            ]
        ),
    ]


def reliability_lines(reliability: Mapping[str, Reliability]) -> list[str]:
    """Share of each measure, with a warning where most of it is chance."""
    rows = []
    for name, found in reliability.items():
        if found.share != found.share:
            said = "unknown: no test grasp was reached twice, or all are equal"
        else:
            noise = "; mostly chance, not the grasp" if found.is_noise else ""
            said = f"{found.share:.2f} over {plural(found.repeated, 'grasp')}{noise}"
        rows.append((MEASURES[name].label, said))
    return fact_lines(rows)


def _beyond_lines(summary: BinSummary) -> list[str]:
    lines = []
    s = summary.saturation
    if s.missed:
        lines.append(
            f"  {plural(s.missed, 'test grasp')} proved connected but missed by every "
            f"attempt; with them {s.proved:.2f} %"
        )
    if summary.time_limit_hits:
        hits = plural(summary.time_limit_hits, "attempt")
        lines.append(f"  the limit on wall-clock time ended {hits}")
    return lines


def _measure_lines(measures: Mapping[str, Spread]) -> list[str]:
    rows = [["", "unit", "mean", "± spread", "least", "median", "most"]]
    for name, measure in measures.items():
        shown = MEASURES[name]
        spread = shown.of(measure)
        values = (spread.mean, spread.std, spread.low, spread.median, spread.high)
        rows.append([shown.label, shown.unit, *(_number(value) for value in values)])
    return table_lines(rows, "<<>>>>>")


def _quadrant_lines(summary: BinSummary) -> list[str]:
    last = f"after {summary.repeats} %"
    rows = [["", "grasps", "after 1 %", last, "path [rad]", "planning [ms]",
             "execution [s]"]]  # fmt: skip
    for quadrant in summary.quadrants:
        s: Saturation = quadrant.saturation
        spreads = (
            MEASURES[name].of(quadrant.measures[name])
            for name in ("path_length", "planning_cpu_time", "execution_time")
        )
        rows.append(
            [
                quadrant.name,
                str(s.total),
                percent_text(s.share[0]),
                percent_text(s.share[-1]),
                *(f"{_number(a.mean)} ± {_number(a.std)}" for a in spreads),
            ]
        )
    return table_lines(rows, "<>>>>>>")


def _number(value: float) -> str:
    return "-" if value != value else f"{value:.3g}"
