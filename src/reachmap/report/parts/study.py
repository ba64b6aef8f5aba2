"""The section on a study: which change helps most, and what it trades off."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from reachmap.maps.study.record import LOWER_IS_BETTER, Study
from reachmap.maps.study.words import no_best_text
from reachmap.maps.summary.study import (
    StudySummary,
    VariantSummary,
    summarise_study,
)
from reachmap.plots.albums import study_album
from reachmap.plots.parts.files import Picture as Item
from reachmap.report.blocks import (
    Block,
    Bullets,
    Heading,
    Section,
    Strong,
    Table,
    drawn,
    paragraph,
    section,
    table,
)
from reachmap.text import NONE, count

# A page is read, a file is searched: what is beyond this stands in study.h5.
ROWS, SENTENCES, CAUSES = 40, 12, 8
DESIGNS = {
    "grid": "every combination",
    "latin_hypercube": "a Latin hypercube",
    "optimised": "proposed by an optimiser",
}
BINS = {
    "kept": "The bin stands where each variant's cell has it.",
    "placed": "The bin is placed again for each variant.",
}


def study_section(study: Study) -> Section:
    """Tell and draw what the variants of a cell reach, and whether that is chance."""
    summary = summarise_study(study)
    return section(
        "study",
        "What changes would bring",
        _words(summary),
        Heading("Changes from the base"),
        paragraph(
            "Paired tests over the same test grasps, at a false-discovery rate of 5 % "
            "across the study; intervals of 95 %."
        ),
        _sentences(summary),
        list(_pictures(study)),
        Heading("Variants"),
        _table(study, summary),
        _causes(summary),
    )


def _words(summary: StudySummary) -> list[Block]:
    outcomes = (
        (summary.failed, "failed"),
        (summary.left_out, "left out after a coarse map"),
    )
    rest = "".join(f", {many} {word}" for many, word in outcomes if many)
    required = ""
    if summary.requirements:
        required = f" Required: {', '.join(summary.requirements)}."
    variants = count(len(summary.variants), "variant")
    design = DESIGNS[summary.design]
    lead = (
        f"{variants}, {design}: {summary.done} mapped{rest}. "
        f"{BINS[summary.bin_mode]}{required}"
    )
    named = [
        (Strong(f"{word}: "), _told(summary.variants[row]))
        for word, row in (
            ("Base", summary.base),
            ("Best", summary.best),
            ("Runner-up", summary.runner_up),
        )
        if row >= 0
    ]
    if summary.best < 0:
        why = no_best_text(summary.done, summary.requirements)
        named.append((Strong("Best: "), f"none, {why}"))
    return [paragraph(lead), Bullets(tuple(named))]


def _told(variant: VariantSummary) -> str:
    name, said = next(iter(variant.objectives)), variant.estimates()[0]
    return f"{variant.assignment}: {name} {said}"


def _sentences(summary: StudySummary) -> Block:
    found = summary.sentences()
    items: list[tuple[object, ...]] = [(text,) for text in found[:SENTENCES]]
    if len(found) > SENTENCES:
        items.append((f"and {len(found) - SENTENCES} more in the study's file",))
    return Bullets(tuple(items)) if items else paragraph("None can be compared.")


def _pictures(study: Study) -> Iterator[Block]:
    album = study_album(study, effects_on=study.objective_names[:1])
    for item in album:
        if isinstance(item, Item):
            yield drawn(item.draw(), f"{item.title}.", study)


def _table(study: Study, summary: StudySummary) -> list[Block]:
    """Variants, the best of the first objective first; what failed comes last."""
    names = study.objective_names
    sign = 1.0 if names[0] in LOWER_IS_BETTER else -1.0

    def rank(variant: VariantSummary) -> tuple[bool, bool, float]:
        value = variant.objectives[names[0]].value
        return value != value, not variant.feasible, sign * value

    rows = sorted(summary.variants, key=rank)
    shown: Table = table(
        ("variant", *names, ""),
        [
            (
                variant.assignment,
                *variant.estimates(),
                summary.role(variant) or NONE,
            )
            for variant in rows[:ROWS]
        ],
        "<" + ">" * len(names) + "<",
    )
    rest = len(rows) - ROWS
    if rest <= 0:
        return [shown]
    return [shown, paragraph(f"and {rest} more in the study's file")]


def _causes(summary: StudySummary) -> list[Block]:
    found = Counter(v.cause for v in summary.variants if v.cause)
    if not found:
        return []
    rows = found.most_common(CAUSES)
    if (rest := len(found) - len(rows)) > 0:
        shown = sum(number for _, number in rows)
        rows.append((f"and {count(rest, 'more cause')}", found.total() - shown))
    return [
        Heading("Why variants have no map"),
        table(("cause", "variants"), rows, "<>"),
    ]
