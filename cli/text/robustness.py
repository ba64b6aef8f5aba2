"""Robustness against errors of a cell as text."""

from __future__ import annotations

from reachmap.cli.text.evidence import PAIRS_SHOWN
from reachmap.cli.text.tables import table_lines
from reachmap.maps.robustness.summary import RobustnessSummary, errors_text
from reachmap.text import percent_text, plural


def robustness_lines(summary: RobustnessSummary) -> list[str]:
    """Headline, the curve as a table, and the bodies that come closest."""
    given = summary.given
    rows = [["errors", "certified %", "in every cell %", "mean %", "min %", "max %"]]
    for step in summary.steps:
        values = (
            step.certified,
            step.always,
            step.reachability,
            step.lowest,
            step.highest,
        )
        rows.append([f"x {step.scale:g}", *(percent_text(value) for value in values)])
    left = 1e3 * summary.margin_m
    kept = f"{left:g} mm of clearance required" if left else "no contact allowed"
    lines = [
        f"{errors_text(summary.errors)} off: {percent_text(given.reachability)} % of "
        f"{plural(summary.grasps, 'test grasp')} stay reachable on average, "
        f"{percent_text(given.certified)} % for certain "
        f"(without errors {percent_text(summary.steps[0].reachability)} %)",
        f"certified by the map's clearance: {summary.by_clearance}, by that of the "
        f"displaced bodies: {summary.by_pairs}; the rest replayed in "
        f"{plural(summary.samples, 'cell')} per row; {kept}",
        "",
        *table_lines(rows, ">" * len(rows[0])),
    ]
    if summary.closest:
        shown = [(str(n), pair) for pair, n in summary.closest[:PAIRS_SHOWN]]
        lines += [
            "",
            "Closest bodies where nothing is certified",
            *table_lines(shown, "><"),
        ]
    return lines
