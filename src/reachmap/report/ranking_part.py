"""The section on ranked grasps, from the ranked list alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.format.registry import Artefact
from reachmap.plots.ranking import MAX_GROUPS, CostGroup, ranking_chart, term_label
from reachmap.ranking.answers.ranked_list import QUADRANT_ORDER, TERM_NAMES
from reachmap.ranking.lookup.table import TERMS
from reachmap.report.blocks import (
    Blocks,
    Heading,
    Section,
    Table,
    drawn,
    paragraph,
    section,
    table,
)
from reachmap.report.numbers import NONE, count, number
from reachmap.report.ranked_rows import RankedRow, ranked_rows, weights_of

TOP = 10


def ranking_section(
    documents: Sequence[Mapping[str, Any]], record: Artefact
) -> Section:
    """First grasps of each list, and what ranking them saved.

    Parameters
    ----------
    documents : sequence of mapping
        Ranked grasp lists.
    record : WorkspaceMap, BinMap or BinPlacement
        Whose hash the chart keeps.
    """
    parts: list[Blocks] = []
    groups: list[CostGroup] = []
    names = _terms_of(documents)
    for index, document in enumerate(documents):
        name = f"List {index + 1}" if len(documents) > 1 else ""
        if name:
            parts.append(Heading(name))
        parts += [paragraph(_words(document)), _table(document)]
        groups += _groups(document, name, names)
    if groups:
        parts.append(
            drawn(
                ranking_chart(groups[:MAX_GROUPS], names, TOP),
                "Mean cost of the first grasps, as supplied and re-ranked; the map is "
                "all that was asked.",
                record,
            )
        )
    return section("ranking", "Which grasps come first", parts)


def _words(document: Mapping[str, Any]) -> str:
    rows = ranked_rows(document)
    reached = sum(row.cost is not None for row in rows)
    weights = ", ".join(number(weight, 2) for weight in weights_of(document))
    return (
        f"{count(len(rows), 'grasp')}, {reached} of them reached. "
        "J is the weighted sum of path length, planning time and execution time "
        "of the nearest test grasp, each as a share of its maximum "
        f"(weights {weights or NONE})."
    )


def _table(document: Mapping[str, Any]) -> Table:
    rows = [
        (
            NONE if row.rank is None else row.rank,
            NONE if row.original_rank is None else row.original_rank,
            row.name,
            row.quadrant,
            number(row.cost, 3),
            *(number(row.terms.get(name), 3) for name in TERMS),
            row.status,
        )
        for row in ranked_rows(document)[:TOP]
    ]
    head = ("rank", "was", "grasp", "quadrant", "J", *map(term_label, TERMS), "state")
    return table(head, rows, ">><<>>>><")


def _terms_of(documents: Sequence[Mapping[str, Any]]) -> list[str]:
    """Terms of the cost that any of the lists was ranked by."""
    known = {name for d in documents for row in ranked_rows(d) for name in row.terms}
    return [name for name in TERM_NAMES if name in known or name in TERMS]


def _groups(
    document: Mapping[str, Any], name: str, names: Sequence[str]
) -> list[CostGroup]:
    """Costs by quadrant, or of the whole list if it names none."""
    rows = ranked_rows(document)
    several = any(row.quadrant for row in rows)
    rest = "other" if several else "" if name else "all"
    groups = []
    for quadrant in QUADRANT_ORDER:
        own = [row for row in rows if row.quadrant == (quadrant or "")]
        supplied = sorted(own, key=lambda row: row.original_rank or 0)
        if own:
            label = f"{name} {quadrant or rest}".strip()
            groups.append(
                CostGroup(
                    label=label,
                    supplied=_terms(supplied, names),
                    ranked=_terms(own, names),
                )
            )
    return groups


def _terms(rows: Sequence[RankedRow], names: Sequence[str]) -> FloatArray:
    """Terms of the cost, shape (n, k); NaN where unreachable, 0 where left out."""
    return np.array(
        [
            [row.terms.get(name, 0.0 if row.terms else np.nan) for name in names]
            for row in rows
        ]
    )
