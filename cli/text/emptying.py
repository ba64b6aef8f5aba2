"""Simulated emptying of heaps as text."""

from __future__ import annotations

from reachmap.cli.text.tables import table_lines
from reachmap.text import plural
from reachmap.tools.empty import EmptyAnswer


def emptying_lines(answer: EmptyAnswer) -> list[str]:
    """Headline, and a row for each heap."""
    parts, picked = answer.total("parts"), answer.total("picked")
    sides = " x ".join(f"{1e3 * side:g}" for side in answer.part)
    head = (
        f"{plural(len(answer.heaps), 'heap')} of parts of {sides} mm, filled to "
        f"{100 * answer.fill:g} %, {answer.order} first: {picked} of "
        f"{plural(parts, 'part')} picked"
    )
    remain = "nothing remains"
    if picked < parts:
        outside = answer.total("outside_map")
        unknown = f" ({outside} of them outside the map)" if outside else ""
        remain = (
            f"{answer.left_percent:.1f} % remain: {answer.total('unreachable')} are "
            f"not reached{unknown}, {answer.total('covered')} lie below those"
        )
    rows = [["seed", "parts", "picked", "not reached", "below", "left %", "up to [mm]",
             "where"]]  # fmt: skip
    for one in answer.heaps:
        s = one.summary
        height = "" if s.highest_left_m is None else f"{1e3 * s.highest_left_m:.0f}"
        counts = (s.seed, s.parts, s.picked, s.unreachable, s.covered)
        rows.append(
            [*map(str, counts), f"{s.left_percent:.1f}", height, s.where or "-"]
        )
    return [head, remain, "", *table_lines(rows, ">>>>>>><")]
