"""A ranking as a short table for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cli.text.cycle import throughput_text
from reachmap.maps.cycle.seconds import TO_GRASP, throughput_of
from reachmap.ranking.answers.ranked_list import RankedList, quadrant_ranks
from reachmap.ranking.lookup.costs import status_name
from reachmap.ranking.lookup.table import TERMS
from reachmap.ranking.terms import FAILURE, PLANNING
from reachmap.text import printable

# A choice: the answer fits on a screen.
TABLE_ROWS = 10


def ranking_tables(ranked: Sequence[RankedList], rows: int | None = None) -> str:
    """Return one table for each list, under its name where there are several."""
    tables = [ranking_table(one, rows or TABLE_ROWS) for one in ranked]
    if len(ranked) == 1:
        return tables[0]
    return "\n\n".join(
        f"{one.grasps.source}\n{table}"
        for one, table in zip(ranked, tables, strict=True)
    )


def ranking_table(ranked: RankedList, rows: int = TABLE_ROWS) -> str:
    """Return the best grasps as a table, and a line that counts them all.

    Parameters
    ----------
    ranked : RankedList
    rows : int
        How many of the best are listed.
    """
    ranking, quadrants = ranked.ranking, ranked.grasps.quadrants
    with_quadrants = any(quadrants)
    after = quadrant_ranks(ranking.order.tolist(), quadrants)
    terms = _shown_terms(ranked)
    head = ["rank", "was", "id", *terms, "status"]
    lines = [[*head[:3], "quadrant", *head[3:]] if with_quadrants else head]
    for place, row in enumerate(ranking.order[:rows].tolist(), start=1):
        line = [str(place), str(row + 1), printable(ranked.grasps.ids[row])]
        if with_quadrants:
            name = quadrants[row]
            line.append(f"{name} {after[row]}" if name else "-")
        reachable = bool(ranking.reachable[row])
        line += [f"{v[row]:.3f}" if reachable else "-" for v in terms.values()]
        lines.append([*line, status_name(ranking.status[row])])
    return "\n".join([*_aligned(lines), summary(ranked)])


def _shown_terms(ranked: RankedList) -> dict[str, FloatArray]:
    """Columns of the table: the cost, and what it is made of."""
    ranking, terms = ranked.ranking, ranked.terms()
    if not ranked.in_seconds:
        short = zip(("path", "plan", "exec"), TERMS, strict=True)
        return {"J": ranking.cost, **{name: terms[key] for name, key in short}}
    ends = {TO_GRASP: "grasp", PLANNING: "plan", FAILURE: "failure"}
    shown = {ends[key]: terms[key] for key in ends}
    after = [values for key, values in terms.items() if key not in ends]
    rest = np.sum(after, axis=0)
    return {"seconds": ranking.cost, "grasp": shown.pop("grasp"), "after": rest} | shown


def summary(ranked: RankedList) -> str:
    """Count grasps by status, as ``50 grasps: 47 reachable, 2 no_ik, 1 error``."""
    counts = ranked.counts()
    parts = [f"{counts.pop('path_found', 0)} reachable"]
    parts += [f"{number} {name}" for name, number in counts.items()]
    return f"{len(ranked.grasps)} grasps: {', '.join(parts)}{_rate(ranked)}"


def _rate(ranked: RankedList) -> str:
    """Picks per hour, where the cost is in seconds."""
    made = throughput_of(ranked.ranking.cost) if ranked.in_seconds else None
    return "" if made is None else f"; {throughput_text(made)}"


def _aligned(lines: list[list[str]]) -> list[str]:
    """Columns as wide as their widest entry; the last is ragged."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    names = {lines[0].index("id"), len(lines[0]) - 1}
    return [
        "  ".join(
            text.ljust(width) if column in names else text.rjust(width)
            for column, (text, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
