"""The section on ranked grasps, from the ranked list alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.cycle.seconds import TO_GRASP
from reachmap.maps.format.registry import Artefact, Result
from reachmap.plots.ranking import (
    MAX_GROUPS,
    CostGroup,
    ranking_chart,
    term_label,
)
from reachmap.ranking.answers.ranked_list import QUADRANT_ORDER, TERM_NAMES
from reachmap.ranking.lookup.table import TERMS
from reachmap.ranking.terms import FAILURE, PLANNING
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
from reachmap.report.ranked_rows import (
    RankedRow,
    cost_of_list,
    known_number,
    ranked_rows,
    weights_of,
)
from reachmap.text import NONE, count, number

# A choice: a line hardly ever tries more.
TOP = 10


def ranking_section(
    documents: Sequence[Mapping[str, Any]], record: Artefact | Result
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
    groups: dict[str, list[CostGroup]] = {"paper": [], "cycle": []}
    names = {cost: _terms_of(documents, cost) for cost in groups}
    for index, document in enumerate(documents):
        name = f"List {index + 1}" if len(documents) > 1 else ""
        if name:
            parts.append(Heading(name))
        cost = cost_of_list(document)
        said = _seconds_text if cost == "cycle" else _sentences
        parts += [paragraph(said(document)), _table(document)]
        groups[cost] += _groups(document, name, names[cost])
    for cost, own in groups.items():
        if own:
            what = "time per pick" if cost == "cycle" else "cost"
            parts.append(
                drawn(
                    ranking_chart(own[:MAX_GROUPS], names[cost], TOP),
                    f"Mean {what} of the first grasps, as supplied and re-ranked, "
                    "according to the map.",
                    record,
                )
            )
    return section("ranking", "Which grasps come first", parts)


def _sentences(document: Mapping[str, Any]) -> str:
    weights = ", ".join(number(weight, 2) for weight in weights_of(document))
    return (
        f"{_counted(document)} "
        "J is the weighted sum of path length, planning time and execution time "
        "of the nearest test grasp, each as a share of its maximum "
        f"(weights {weights or NONE})."
    )


def _seconds_text(document: Mapping[str, Any]) -> str:
    own = document["reachmap"]
    failure_s = number(known_number(own.get("failure_cost_s")), 1)
    made = own.get("picks_per_hour")
    rate = made if isinstance(made, dict) else {}
    each, low, high = (
        number(known_number(rate.get(key)), 0)
        for key in ("picks_per_hour", "low", "high")
    )
    return (
        f"{_counted(document)} The cost is the predicted time of a pick: the cycle of "
        "the nearest test grasp, the planning effort, and what a failure costs "
        f"({failure_s} s) times its probability. The list makes {each} picks per hour "
        f"(95 % interval {low} to {high})."
    )


def _counted(document: Mapping[str, Any]) -> str:
    rows = ranked_rows(document)
    reached = sum(row.cost is not None for row in rows)
    return f"{count(len(rows), 'grasp')}, {reached} of them reached."


def _table(document: Mapping[str, Any]) -> Table:
    names, unit = TERMS, "J"
    if cost_of_list(document) == "cycle":
        names, unit = (TO_GRASP, PLANNING, FAILURE), "seconds"
    rows = [
        (
            NONE if row.rank is None else row.rank,
            NONE if row.original_rank is None else row.original_rank,
            row.name,
            row.quadrant,
            number(row.cost, 3),
            *(number(row.terms.get(name), 3) for name in names),
            row.status,
        )
        for row in ranked_rows(document)[:TOP]
    ]
    head = ("rank", "was", "grasp", "quadrant", unit, *map(term_label, names), "state")
    return table(head, rows, ">><<>>>><")


def _terms_of(documents: Sequence[Mapping[str, Any]], cost: str) -> list[str]:
    """Terms that any of the lists with this cost was ranked by."""
    own = [document for document in documents if cost_of_list(document) == cost]
    known = dict.fromkeys(k for d in own for row in ranked_rows(d) for k in row.terms)
    if cost == "cycle":
        return [name for name in known if name not in TERM_NAMES]
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
