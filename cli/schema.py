"""``reachmap schema``: JSON Schemas for editors and other programs."""

from __future__ import annotations

import json
from typing import Any

import click

from reachmap.cli.options import json_option
from reachmap.cli.terminal import print_answer


@click.command()
@click.argument("name", type=click.Choice(["cell", "grasps", "ranked"]))
@json_option
def command(name: Any, as_json: bool) -> None:
    """Print the JSON Schema of cells, grasp lists or ranked lists.

    Editors that support JSON Schema complete keys and mark mistakes as you type; start
    the file with "# yaml-language-server: $schema=cell-1.schema.json".

    Example: reachmap schema cell > cell-1.schema.json
    """
    from reachmap.tools.schema import schema

    found = schema(name)
    print_answer(
        found,
        lambda: json.dumps(found, indent=2, ensure_ascii=False),
        as_json=as_json,
    )
