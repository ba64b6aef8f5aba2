"""The place of an arm as people read it."""

from __future__ import annotations

from reachmap.cli.text.tables import table_lines
from reachmap.maps.summary.base import (
    BaseCandidate,
    BaseSummary,
    margin_text,
    place_text,
    score_text,
)
from reachmap.text import plural

# A choice: the answer fits on a screen.
REASONS_SHOWN = 5


def base_lines(summary: BaseSummary) -> list[str]:
    """Chosen, runner-up and present place, arms compared, margin, causes."""
    rows = [_row("chosen", summary.chosen, summary.rail)]
    if summary.runner_up is not None:
        rows.append(_row("runner-up", summary.runner_up, summary.rail))
    if summary.present is not None:
        rows.append(_row("as the cell is", summary.present, summary.rail))
    lines = table_lines(rows, "<<><")
    if len(summary.best_of) > 1:
        best = [_row("", item, summary.rail) for item in summary.best_of]
        lines += ["", "Best of each arm and mounting", *table_lines(best, "<<><")]
    lines += ["", *_gain_lines(summary)]
    if summary.margin:
        margin = margin_text(summary.margin, summary.rail)
        lines.append(f"margin (score within 5 points): {margin}")
    lines.append(
        f"{plural(summary.candidates, 'place')} considered, {summary.exact} with "
        f"paths, {sum(summary.excluded.values())} excluded"
    )
    shown = list(summary.excluded.items())[:REASONS_SHOWN]
    return [*lines, *(f"  {count} × {reason}" for reason, count in shown)]


def _row(role: str, candidate: BaseCandidate, rail: str) -> list[str]:
    place = place_text(candidate, rail)
    who = f"{candidate.arm}, {candidate.mounting}"
    return [role, place, score_text(candidate), who]


def _gain_lines(summary: BaseSummary) -> list[str]:
    if summary.gain is None or summary.gain_error is None:
        present = summary.present
        why = "" if present is None or not present.reason else f" ({present.reason})"
        return [f"the cell as it is has no score to compare with{why}"]
    half = 1.96 * summary.gain_error
    said = f"{summary.gain:+.1f} ± {half:.1f} points against the cell as it is"
    if abs(summary.gain) <= half:
        said += ", not distinguishable"
    return [said]
