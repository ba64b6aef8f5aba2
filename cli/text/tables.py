"""Tables and paragraphs for a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

# A choice: the width of our code, so that answers fit into documents as well.
WIDTH = 88


def table_lines(rows: Sequence[Sequence[str]], align: str) -> list[str]:
    r"""Lay out rows in columns, two spaces apart and two from the margin.

    Parameters
    ----------
    rows : sequence of rows of texts
    align : str
        ``<`` or ``>`` for each column.

    Examples
    --------
    >>> print("\n".join(table_lines([["z", "percent"], ["+0.1", "53.5"]], "<>")))
      z     percent
      +0.1     53.5
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  "
        + "  ".join(
            f"{text:{side}{width}}"
            for text, side, width in zip(row, align, widths, strict=True)
        ).rstrip()
        for row in rows
    ]


def fact_lines(facts: Sequence[tuple[str, str]]) -> list[str]:
    """Names in one column, what is said of them in another, wrapped to the width."""
    column = max((len(name) for name, _ in facts), default=0) + 4
    lines = []
    for name, text in facts:
        lines += textwrap.wrap(
            text or "-",
            WIDTH,
            initial_indent=f"  {name:{column - 2}}",
            subsequent_indent=" " * column,
            break_long_words=False,
            break_on_hyphens=False,
        )
    return lines
