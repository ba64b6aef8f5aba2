"""The section on ranked grasps, from the ranked list alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.any_file import Artefact
from reachmap.plots.ranking import MAX_GROUPS, TERM_LABELS, CostGroup, ranking_chart
from reachmap.ranking.cost_groups import QUADRANT_ORDER
from reachmap.ranking.ranked_list import TERM_NAMES
from reachmap.report.drawing import drawn
from reachmap.report.markup import Html, element, joined, paragraph, section, table
from reachmap.report.numbers import count, number

TOP = 10


def ranking_section(documents: Sequence[Mapping[str, Any]], record: Artefact) -> Html:
    """First grasps of each list, and what ranking them saved.

    Parameters
    ----------
    documents : sequence of mapping
        Ranked grasp lists.
    record : WorkspaceMap, BinMap or BinPlacement
        Whose hash the chart keeps.
    """
    parts: list[Html] = []
    groups: list[CostGroup] = []
    for index, document in enumerate(documents):
        name = f"List {index + 1}" if len(documents) > 1 else ""
        if name:
            parts.append(element("h3", name))
        parts += [paragraph(_words(document)), _table(document)]
        groups += _groups(document, name)
    if groups:
        parts.append(
            drawn(
                ranking_chart(groups[:MAX_GROUPS], TOP),
                "Mean cost of the first grasps, as supplied and re-ranked; the map is "
                "all that was asked.",
                record,
            )
        )
    return section("ranking", "Which grasps come first", joined(parts))


def _results(document: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], Any]]:
    return [
        (grasp, grasp["reachmap"])
        for grasp in document["grasps"]
        if isinstance(grasp, dict) and isinstance(grasp.get("reachmap"), dict)
    ]


def _words(document: Mapping[str, Any]) -> str:
    results = _results(document)
    reached = sum(result.get("cost") is not None for _, result in results)
    weights = document["reachmap"].get("weights") or ()
    said = ", ".join(number(w, 2) for w in weights if isinstance(w, float | int))
    return (
        f"{count(len(results), 'grasp')}, {reached} of them reached. "
        f"J is the weighted sum of path length, planning time and execution time "
        f"of the nearest test grasp, each as a share of its maximum (weights {said})."
    )


def _table(document: Mapping[str, Any]) -> Html:
    rows = []
    for grasp, result in _results(document)[:TOP]:
        terms = result.get("terms") or {}
        rows.append(
            (
                result.get("rank", ""),
                result.get("original_rank", ""),
                str(grasp.get("id", "")),
                str(grasp.get("quadrant") or ""),
                number(result.get("cost"), 3),
                *(number(terms.get(name), 3) for name in TERM_NAMES[:3]),
                str(result.get("status", "")).replace("_", " "),
            )
        )
    head = ("rank", "was", "grasp", "quadrant", "J", *TERM_LABELS[:3], "state")
    return table(head, rows, ">><<>>>><")


def _groups(document: Mapping[str, Any], name: str) -> list[CostGroup]:
    """Costs by quadrant, or of the whole list if it names none."""
    results = _results(document)
    several = any(grasp.get("quadrant") for grasp, _ in results)
    rest = "other" if several else "" if name else "all"
    groups = []
    for quadrant in QUADRANT_ORDER:
        own = [r for g, r in results if (g.get("quadrant") or None) == quadrant]
        supplied = sorted(own, key=lambda result: int(result.get("original_rank", 0)))
        if own:
            label = f"{name} {quadrant or rest}".strip()
            groups.append(
                CostGroup(label=label, supplied=_terms(supplied), ranked=_terms(own))
            )
    return groups


def _terms(results: Sequence[Mapping[str, Any]]) -> FloatArray:
    """Terms of J, shape (n, 3) or (n, 4) with likeness; NaN where unreachable."""
    found = {name for result in results for name in result.get("terms") or {}}
    names = TERM_NAMES if TERM_NAMES[3] in found else TERM_NAMES[:3]
    return np.array(
        [
            [float((result.get("terms") or {}).get(name, np.nan)) for name in names]
            for result in results
        ]
    )
