"""``reachmap schema``: JSON Schemas for editors and other programs."""

from __future__ import annotations

import json
from typing import Any

import click


@click.command()
@click.argument("name", type=click.Choice(["cell", "grasps", "ranked"]))
def command(name: Any) -> None:
    """Print the JSON Schema of cells, grasp lists or ranked lists.

    Editors that know JSON Schema complete keys and mark mistakes while one types; a
    first line "# yaml-language-server: $schema=cell-1.schema.json" connects the two.

    Example: reachmap schema cell > cell-1.schema.json
    """
    from reachmap.tools.schema import schema

    click.echo(json.dumps(schema(name), indent=2, ensure_ascii=False))
