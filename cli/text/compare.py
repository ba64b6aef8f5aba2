"""A comparison of two maps as people read it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reachmap.cli.text.tables import fact_lines, table_lines
from reachmap.maps.comparison.comparison import Cause, Comparison, SquareChange
from reachmap.text import plural
from reachmap.tools.compare import MapComparison, MapComparisons

# Choices: the answer fits on a screen.
SQUARES_SHOWN = 10
CAUSES_SHOWN = 8
CHANGES_SHOWN = 12
# Above this a difference is called chance.
SIGNIFICANT = 0.05


def compare_text(comparison: MapComparison) -> str:
    """Headline, counts, causes, the squares that changed most, what differs."""
    r = comparison.result
    lines = [
        f"{comparison.names[0]} against {comparison.names[1]}: {comparison.headline}",
        verdict(comparison.names, r),
        *fact_lines(_count_facts(r)),
        *_cause_lines("Why frames were lost", r.losses),
        *_cause_lines("Why gained frames were not reached before", r.gains),
        *_square_lines(r.squares),
        *_cell_lines(r.cell_changes),
    ]
    return "\n".join(lines)


def compare_many_text(comparisons: MapComparisons) -> str:
    """A row for each map, then what differs between the cells of each pair."""
    head = ["against " + comparisons.each[0].names[0], "frames", "before %", "after %",
            "points", "gained", "lost", ""]  # fmt: skip
    rows = [head]
    for item, named in zip(comparisons.each, comparisons.significant, strict=True):
        r = item.result
        share = [100.0 * n / r.common for n in (r.reached_before, r.reached_after)]
        rows.append(
            [
                item.names[1],
                str(r.common),
                *(f"{value:.2f}" for value in share),
                f"{r.change:+.2f}",
                str(r.gained),
                str(r.lost),
                "" if named else "not significant",
            ]
        )
    lines = [
        *table_lines(rows, "<>>>>>><"),
        "paired test by place, false-discovery rate 5 % over all; comparing two maps "
        "also gives causes and squares",
    ]
    for item in comparisons.each:
        lines += ["", item.names[1], *_cell_lines(item.result.cell_changes)[1:]]
    return "\n".join(lines)


def verdict(names: tuple[str, str], r: Comparison) -> str:
    """Say in a sentence which map reaches more, and whether that is significant."""
    before, after = names
    counts = f"{plural(r.gained, 'test frame')} gained, {r.lost} lost"
    if not r.gained and not r.lost:
        return f"{after} reaches the same test frames as {before}."
    if r.p_value >= SIGNIFICANT:
        return f"No significant difference: {counts}."
    word = "more" if r.gained > r.lost else "less"
    return f"{after} reaches significantly {word} than {before}: {counts}."


def _count_facts(r: Comparison) -> list[tuple[str, str]]:
    poses = f"{r.common} of {r.frames_before} and {r.frames_after} test frames"
    facts = [
        (
            "compared",
            f"{poses}, by pose in {r.frame} within {1000 * r.tolerance_m:g} mm and "
            f"{r.tolerance_deg:g} deg",
        ),
        ("gained, lost", f"{r.gained}, {r.lost} ({p_text(r.p_value)} by place)"),
        (
            "change",
            f"{r.change:+.2f} points ({r.change_low:+.2f} … {r.change_high:+.2f})",
        ),
    ]
    if not np.isnan(r.path_length_before):
        facts.append(
            (
                "path length",
                f"{r.path_length_before:.3f} to {r.path_length_after:.3f} rad, mean "
                "over frames that both reach",
            )
        )
    return facts


def p_text(p_value: float) -> str:
    """A p-value: ``p = 0.031``, ``p < 0.0001``."""
    return "p < 0.0001" if p_value < 1e-4 else f"p = {p_value:.2g}"


def _cause_lines(title: str, causes: Sequence[Cause]) -> list[str]:
    if not causes:
        return []
    shown = [
        (str(cause.count), f"{cause.state}{cause.pair and ': '}{cause.pair}")
        for cause in causes[:CAUSES_SHOWN]
    ]
    rest = len(causes) - len(shown)
    more = [f"  and {plural(rest, 'more cause')}"] if rest else []
    return ["", title, *table_lines(shown, "><"), *more]


def _square_lines(squares: SquareChange) -> list[str]:
    """The squares whose change is more than chance, the largest change first."""
    change = squares.percent("after") - squares.percent("before")
    places = np.argwhere(squares.significant)
    total = int((squares.frames > 0).sum())
    named = f"{plural(len(places), 'square')} of {total} changed significantly"
    lines = ["", f"{named} (Fisher, false-discovery rate 5 %)"]
    if not len(places):
        return lines
    order = np.argsort([-abs(change[tuple(k)]) for k in places], kind="stable")
    rows = [["x [m]", "y [m]", "z [m]", "before %", "after %", "points", ""]]
    for k in places[order][:SQUARES_SHOWN]:
        iz, iy, ix = (int(i) for i in k)
        rows.append(
            [
                f"{squares.x[ix]:+.3f}",
                f"{squares.y[iy]:+.3f}",
                f"{squares.z[iz]:+.3f}",
                f"{squares.percent('before')[iz, iy, ix]:.1f}",
                f"{squares.percent('after')[iz, iy, ix]:.1f}",
                f"{change[iz, iy, ix]:+.1f}",
                p_text(float(squares.p_value[iz, iy, ix])),
            ]
        )
    rest = len(places) - len(rows) + 1
    more = [f"  and {plural(rest, 'more square')}"] if rest > 0 else []
    return [*lines, *table_lines(rows, ">>>>>><"), *more]


def _cell_lines(changes: Sequence[tuple[str, str, str]]) -> list[str]:
    if not changes:
        return ["", "The cells are the same"]
    shown = [(key, a, b) for key, a, b in changes[:CHANGES_SHOWN]]
    rest = len(changes) - len(shown)
    more = [f"  and {plural(rest, 'more difference')}"] if rest else []
    rows = [("", "before", "after"), *shown]
    return ["", "What differs between the cells", *table_lines(rows, "<<<"), *more]
