"""A ranking as a short table for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from reachmap.ranking.answers.ranked_list import RankedList, quadrant_ranks
from reachmap.ranking.lookup.order import status_name
from reachmap.text import printable

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
    head = ["rank", "was", "id", "J", "path", "plan", "exec", "status"]
    lines = [[*head[:3], "quadrant", *head[3:]] if with_quadrants else head]
    for place, row in enumerate(ranking.order[:rows].tolist(), start=1):
        line = [str(place), str(row + 1), printable(ranked.grasps.ids[row])]
        if with_quadrants:
            name = quadrants[row]
            line.append(f"{name} {after[row]}" if name else "-")
        cost = ranking.cost[row]
        numbers = [cost, *ranking.terms[row, :3]]
        reachable = bool(ranking.reachable[row])
        line += [f"{value:.3f}" if reachable else "-" for value in numbers]
        lines.append([*line, status_name(ranking.status[row])])
    return "\n".join([*_aligned(lines), summary(ranked)])


def summary(ranked: RankedList) -> str:
    """Count grasps by status, as ``50 grasps: 47 reachable, 2 no_ik, 1 error``."""
    counts = ranked.counts()
    parts = [f"{counts.pop('path_found', 0)} reachable"]
    parts += [f"{number} {name}" for name, number in counts.items()]
    return f"{len(ranked.grasps)} grasps: {', '.join(parts)}"


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
