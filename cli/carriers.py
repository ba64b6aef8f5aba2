"""``reachmap carriers``: load carriers by name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import click

from reachmap.cli.options import json_option
from reachmap.cli.terminal import print_answer


@click.command()
@json_option
def command(as_json: bool) -> None:
    """List the load carriers that `bin.carrier` takes.

    Name, outer and inner length x width x height [mm], and what it is. With --json
    also walls, bottom, rim, where the figures are published, and which of them are
    derived.

    \b
    Example:
      reachmap carriers
      reachmap check ur10-eye-in-hand --set bin.carrier=KLT-6147
    """
    from reachmap.tools.carriers import list_carriers

    rows = list_carriers()
    print_answer({"carriers": rows}, lambda: "\n".join(_lines(rows)), as_json=as_json)


def _lines(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    def size(values: tuple[float, ...]) -> str:
        return " x ".join(f"{value:g}" for value in values)

    table = [
        (row["name"], size(row["outer_mm"]), size(row["inner_mm"]), row["description"])
        for row in rows
    ]
    table.insert(0, ("name", "outer [mm]", "inner [mm]", "what it is"))
    widths = [max(map(len, column)) for column in list(zip(*table, strict=True))[:3]]
    for *cells, what in table:
        padded = (cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
        yield "  ".join([*padded, what])
