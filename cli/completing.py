"""What a shell offers when Tab is pressed: cells by name, keys of ``--set``."""

from __future__ import annotations

import click
from click.shell_completion import CompletionItem

from reachmap.cli.diagnostics import ARGUMENTS

DEFAULT_CELL = "ur5-eye-in-hand"


def complete_cells(
    ctx: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Shipped cells whose names start with the incomplete word, or else files."""
    from reachmap.cell.loading import shipped_cells

    names = [name for name in shipped_cells() if name.startswith(incomplete)]
    files = CompletionItem(incomplete, type="file")
    return [*map(CompletionItem, names), *([] if names and incomplete else [files])]


def complete_keys(
    ctx: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Keys of the cell on the command line up to the next dot, ``=`` after a value.

    Of a cell that cannot be read, and where none is named, those of the shipped cell.
    """
    from reachmap.cell.loading import read_cell, shipped_cells
    from reachmap.errors import ReachmapError
    from reachmap.maps.bytes.to_json import flat_json

    # Not ctx.params: the parser stops at the option that still lacks its value.
    words = ctx.meta.get(ARGUMENTS, ())
    cells = [w for w in words if w in shipped_cells() or w.endswith((".yaml", ".yml"))]
    try:
        cell = read_cell(cells[0] if cells else DEFAULT_CELL).cell
    except ReachmapError:
        cell = read_cell(DEFAULT_CELL).cell
    found: dict[str, None] = {}
    for key, _ in flat_json(cell.model_dump(mode="json")):
        key = key.partition("[")[0]
        if key.startswith(incomplete):
            rest, dot, _ = key[len(incomplete) :].partition(".")
            found[incomplete + rest + (dot or "=")] = None
    return [CompletionItem(key) for key in found]
