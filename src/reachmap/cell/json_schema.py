"""JSON Schema of the cell file, for editors and other programs."""

from __future__ import annotations

from typing import Any

from reachmap.cell.model import Cell

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def cell_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a cell, generated from the model."""
    schema = Cell.model_json_schema()
    head = {
        "$schema": DIALECT,
        "$id": "reachmap/cell-1.schema.json",
        "title": "reachmap cell 1.x",
    }
    return {**head, **{key: schema[key] for key in schema if key not in head}}
