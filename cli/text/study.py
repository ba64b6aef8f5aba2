"""A study as people read it."""

from __future__ import annotations

import textwrap

from reachmap.cli.text.tables import table_lines
from reachmap.maps.study.record import OBJECTIVES
from reachmap.maps.summary.study import (
    UNIT_WORDS,
    Estimate,
    MainEffect,
    StudySummary,
    VariantSummary,
)
from reachmap.text import plural

VARIANTS_SHOWN = 40
SENTENCES_SHOWN = 12
LEVELS_SHOWN = 12
LINE = 88


def study_lines(summary: StudySummary) -> list[str]:
    """Best variant, sentences, main effects, and the table of all variants."""
    failed = f", {summary.failed} failed" if summary.failed else ""
    left = f", {summary.left_out} left out" if summary.left_out else ""
    done = f"{summary.done} done{failed}{left}"
    count = f"{plural(len(summary.variants), 'variant')} ({done})"
    head = f"{count}, {summary.design.replace('_', ' ')}, bin {summary.bin_mode}"
    return [
        head,
        *_best_lines(summary),
        *_sentence_lines(summary),
        *_effect_lines(summary),
        *_table(summary),
        *_cause_lines(summary),
    ]


def estimate_text(name: str, item: Estimate) -> str:
    """A value with its interval: ``69.1 % (66.2 … 71.8)``."""
    if item.value != item.value:
        return "-"
    digits = 1 if OBJECTIVES[name] == "percent" else 3
    text = f"{item.value:.{digits}f} {UNIT_WORDS[OBJECTIVES[name]]}"
    if item.low != item.low:
        return text
    return f"{text} ({item.low:.{digits}f} … {item.high:.{digits}f})"


def _best_lines(summary: StudySummary) -> list[str]:
    lines = [f"base: {summary.variants[summary.base].assignment}"]
    if summary.requirements:
        lines.append(f"required: {', '.join(summary.requirements)}")
    for word, row in (("best", summary.best), ("runner-up", summary.runner_up)):
        if row >= 0:
            variant = summary.variants[row]
            name, item = next(iter(variant.objectives.items()))
            said = estimate_text(name, item)
            lines.append(f"{word}: {variant.assignment}: {name} {said}")
    if summary.best < 0:
        lines.append("best: none, no variant meets the requirements")
    return [
        line
        for text in lines
        for line in textwrap.wrap(text, LINE, subsequent_indent="  ")
    ]


def _sentence_lines(summary: StudySummary) -> list[str]:
    """Changes from the base, those of a single parameter first."""
    found = [
        text for variant in summary.variants for text in variant.sentences.values()
    ]
    found.sort(key=lambda text: text.count(" → "))
    if not found:
        return []
    rest = len(found) - SENTENCES_SHOWN
    shown = [
        line
        for text in found[:SENTENCES_SHOWN]
        for line in textwrap.wrap(
            text, LINE, initial_indent="  ", subsequent_indent="    "
        )
    ]
    more = [f"  and {rest} more (--json has all)"] if rest > 0 else []
    title = "Changes from the base (paired tests, false-discovery rate 5 %)"
    return ["", title, *shown, *more]


def _effect_lines(summary: StudySummary) -> list[str]:
    name = next(iter(summary.variants[0].objectives))
    effects = [item for item in summary.main_effects if item.objective == name]
    rows = [row for effect in effects for row in _effect_rows(effect)]
    if not rows or summary.design != "grid":
        return []
    return [
        "",
        f"Main effects on {name}: means over all other parameters",
        *table_lines(rows, "<>>"),
    ]


def _effect_rows(effect: MainEffect) -> list[list[str]]:
    unit = f" [{effect.unit}]" if effect.unit else ""
    rows = [
        [
            f"{effect.parameter}{unit}" if k == 0 else "",
            effect.labels[k],
            estimate_text(
                effect.objective,
                Estimate(
                    value=float(effect.mean[k]),
                    low=float(effect.low[k]),
                    high=float(effect.high[k]),
                ),
            ),
        ]
        for k in range(min(len(effect.values), LEVELS_SHOWN))
    ]
    rest = len(effect.values) - len(rows)
    return [*rows, *([["", f"and {rest} more", ""]] if rest > 0 else [])]


def _table(summary: StudySummary) -> list[str]:
    names = list(summary.variants[0].objectives)
    rows = [["variant", *names, ""]]
    rows += [
        [
            variant.assignment,
            *(estimate_text(name, variant.objectives[name]) for name in names),
            _role(summary, variant),
        ]
        for variant in summary.variants[:VARIANTS_SHOWN]
    ]
    rest = len(summary.variants) - VARIANTS_SHOWN
    more = [f"  and {rest} more (--json has all)"] if rest > 0 else []
    return ["", "Variants", *table_lines(rows, "<" + ">" * len(names) + "<"), *more]


def _role(summary: StudySummary, variant: VariantSummary) -> str:
    roles = {"runner_up": "runner-up", "base": "base", "best": "best"}
    found = [w for k, w in roles.items() if getattr(summary, k) == variant.variant]
    if variant.status != "done":
        found.append(variant.status.replace("_", " "))
    elif not variant.feasible:
        found.append("below the requirements")
    return ", ".join(found)


def _cause_lines(summary: StudySummary) -> list[str]:
    found = []
    for state, title in (
        ("failed", "Variants that failed"),
        ("left_out", "Variants that were left out"),
    ):
        rows = [variant for variant in summary.variants if variant.status == state]
        found += _causes_of(title, rows)
    return found


def _causes_of(title: str, rows: list[VariantSummary]) -> list[str]:
    if not rows:
        return []
    lines = [
        line
        for variant in rows[:SENTENCES_SHOWN]
        for line in textwrap.wrap(
            f"{variant.assignment}: {variant.cause}",
            LINE,
            initial_indent="  ",
            subsequent_indent="    ",
        )
    ]
    rest = len(rows) - SENTENCES_SHOWN
    more = [f"  and {rest} more (--json has all)"] if rest > 0 else []
    return ["", title, *lines, *more]
