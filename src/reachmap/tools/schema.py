"""``reachmap schema``: JSON Schemas of the files people write."""

from __future__ import annotations

import json
from importlib import resources
from typing import Any, Literal

from reachmap.cell.model.cell import cell_schema

SchemaName = Literal["cell", "grasps"]


def schema(name: SchemaName) -> dict[str, Any]:
    """JSON Schema of cell files or of grasp lists.

    Parameters
    ----------
    name : {"cell", "grasps"}
    """
    if name == "cell":
        return cell_schema()
    folder = resources.files("reachmap.ranking")
    text = folder.joinpath("grasps-1.schema.json").read_text(encoding="utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded
