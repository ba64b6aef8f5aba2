"""``reachmap schema``: JSON Schemas of the files people write."""

from __future__ import annotations

import json
from importlib import resources
from typing import Any, Literal

SchemaName = Literal["cell", "grasps", "ranked"]


def schema(name: SchemaName) -> dict[str, Any]:
    """JSON Schema of cell files, of grasp lists or of ranked ones.

    Parameters
    ----------
    name : {"cell", "grasps", "ranked"}
    """
    if name == "cell":
        # Imported here: an installation for ranking alone has no cells.
        from reachmap.cell.model.cell import cell_schema

        return cell_schema()
    folder = resources.files("reachmap.ranking")
    text = folder.joinpath(f"{name}-1.schema.json").read_text(encoding="utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded
