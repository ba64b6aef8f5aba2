"""Causes of test frames, and the evidence behind verdicts, as people read them."""

from __future__ import annotations

from reachmap.cli.text.tables import fact_lines, table_lines
from reachmap.maps.records import Status
from reachmap.maps.summary.evidence import EvidenceSummary
from reachmap.maps.summary.statistics import STATUS_NAMES, Causes
from reachmap.text import count_text, plural

# A choice: the answer fits on a screen.
PAIRS_SHOWN = 5


def evidence_text(evidence: EvidenceSummary) -> str:
    """Frames, components, attempts and state checks."""
    where = f" in {plural(evidence.components, 'component')}"
    return (
        f"{plural(evidence.frames, 'frame')}"
        f"{where if evidence.components else ''}, "
        f"{plural(evidence.attempts, 'attempt')}"
        f"{_checks_text(evidence)}"
    )


def _checks_text(evidence: EvidenceSummary) -> str:
    """State checks, by method."""
    if evidence.checks is None:
        return ""
    methods = ", ".join(f"{n} {count:,}" for n, count in evidence.method_checks.items())
    return f", {evidence.checks:,} state checks" + (f" ({methods})" if methods else "")


def verdict_text(evidence: EvidenceSummary) -> str:
    """Evidence of frames without a path, and how often another method agreed."""
    text = evidence_text(evidence)
    if evidence.checks is None or not evidence.frames:
        return text
    agreed = f"{evidence.agreed} of {plural(evidence.frames, 'frame')}"
    sure = evidence.confidence
    least = "" if sure is None else f"; confidence {100 * sure:.0f} % or more"
    return f"{text}; an independent method agrees on {agreed}{least}"


def cause_lines(causes: Causes) -> list[str]:
    """States with counts; the leading pairs of bodies below those they explain."""
    rows = []
    for status, count in causes.states.items():
        tried = 0 if status == Status.NOT_ATTEMPTED else causes.total
        rows.append((STATUS_NAMES[status], count_text(count, tried)))
    lines = fact_lines(rows)
    if causes.pairs:
        shown = [(str(n), pair) for pair, n in causes.pairs[:PAIRS_SHOWN]]
        rest = len(causes.pairs) - len(shown)
        lines += ["", "Bodies in the way", *table_lines(shown, "><")]
        lines += [f"  and {plural(rest, 'more pair')}"] if rest else []
    return lines
