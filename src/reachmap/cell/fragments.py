"""Cell fragments: another arm or tool, as overrides of a cell."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reachmap.cell.files.resources import SCHEME
from reachmap.cell.model.cell import Cell
from reachmap.cell.text.data import at
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.yaml_reader import MAX_TEXT_BYTES, parse_yaml, read_text
from reachmap.errors import CellError

NAMED = "bodies"
FILES = ("urdf", "srdf", "joint_limits")


def fragment_overrides(path: Path, cell_text: str, label: str) -> tuple[str, ...]:
    """Overrides that replace sections of a cell by those of a fragment.

    A fragment has sections of a cell file. Each key of a section replaces the cell's
    (``robot.urdf``, ``scan_configuration.q_deg``); bodies replace those of the same
    name, and others join them. Files are relative to the fragment.

    Parameters
    ----------
    path : Path
        A YAML file.
    cell_text : str
        The cell, whose bodies it changes.
    label : str
        Name of the cell in messages.

    Raises
    ------
    CellError
        It is not such a file; the values are checked with the cell.
    """
    data = parse_yaml(read_text(path, limit=MAX_TEXT_BYTES), str(path)).data
    if not isinstance(data, dict) or not data:
        raise CellError(
            f"{path}: expected sections of a cell file, such as 'robot:' and 'bodies:'"
        )
    sections = Cell.model_fields
    for name in data:
        if name not in sections or name in ("format", "format_version"):
            hint = did_you_mean(str(name), tuple(sections))
            raise CellError(f"{path}: {name}: not a section of an arm; {hint}")
    overrides = []
    for name, value in data.items():
        if name == NAMED and isinstance(value, list):
            own = at(parse_yaml(cell_text, label).data, NAMED) or []
            overrides.append(f"{NAMED}={_text(_joined(own, value))}")
        elif isinstance(value, dict):
            for key, entry in value.items():
                if name == "robot" and key in FILES:
                    entry = _absolute(entry, path)
                overrides.append(f"{name}.{key}={_text(entry)}")
        else:
            overrides.append(f"{name}={_text(value)}")
    return tuple(overrides)


def _joined(own: Sequence[Any], new: Sequence[Any]) -> list[Any]:
    """Entries of both lists; a new entry replaces the old one of the same name."""
    entries = {at(item, "name"): item for item in own}
    return [*(entries | {at(item, "name"): item for item in new}).values()]


def _absolute(reference: Any, path: Path) -> Any:
    if not isinstance(reference, str) or reference.startswith(SCHEME):
        return reference
    return str((path.parent / reference).absolute())


def _text(value: Any) -> str:
    return json.dumps(value)
