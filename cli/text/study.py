"""A study as people read it."""

from __future__ import annotations

import textwrap

from reachmap.cli.text.tables import WIDTH, table_lines
from reachmap.maps.study.words import estimate_text, no_best_text
from reachmap.maps.summary.study import (
    MainEffect,
    StudySummary,
    VariantSummary,
)
from reachmap.text import plural

# Choices: the answer fits on a screen or two.
VARIANTS_SHOWN = 40
SENTENCES_SHOWN = 12
LEVELS_SHOWN = 12


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


def _best_lines(summary: StudySummary) -> list[str]:
    lines = [f"base: {summary.variants[summary.base].assignment}"]
    if summary.requirements:
        lines.append(f"required: {', '.join(summary.requirements)}")
    for word, row in (("best", summary.best), ("runner-up", summary.runner_up)):
        if row >= 0:
            variant = summary.variants[row]
            name, said = next(iter(variant.objectives)), variant.estimates()[0]
            lines.append(f"{word}: {variant.assignment}: {name} {said}")
    if summary.best < 0:
        why = no_best_text(summary.done, summary.requirements)
        lines.append(f"best: none, {why}")
    return [
        line
        for text in lines
        for line in textwrap.wrap(text, WIDTH, subsequent_indent="  ")
    ]


def _sentence_lines(summary: StudySummary) -> list[str]:
    """Changes from the base."""
    found = summary.sentences()
    if not found:
        return []
    rest = len(found) - SENTENCES_SHOWN
    shown = [
        line
        for text in found[:SENTENCES_SHOWN]
        for line in textwrap.wrap(
            text, WIDTH, initial_indent="  ", subsequent_indent="    "
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
                effect.objective, effect.mean[k], effect.low[k], effect.high[k]
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
            *variant.estimates(),
            summary.role(variant),
        ]
        for variant in summary.variants[:VARIANTS_SHOWN]
    ]
    rest = len(summary.variants) - VARIANTS_SHOWN
    more = [f"  and {rest} more (--json has all)"] if rest > 0 else []
    return ["", "Variants", *table_lines(rows, "<" + ">" * len(names) + "<"), *more]


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
            WIDTH,
            initial_indent="  ",
            subsequent_indent="    ",
        )
    ]
    rest = len(rows) - SENTENCES_SHOWN
    more = [f"  and {rest} more (--json has all)"] if rest > 0 else []
    return ["", title, *lines, *more]
