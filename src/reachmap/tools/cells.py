"""``reachmap cells``: what is shipped, and the cell of an artefact as YAML."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from reachmap.cell.loading import shipped_cells, stored_cell
from reachmap.cell.text.data import text_at
from reachmap.cell.text.yaml_reader import MAX_TEXT_BYTES, parse_yaml, read_text
from reachmap.cell.text.yaml_writer import cell_yaml
from reachmap.maps.bytes.publish import check_output, publish


@dataclass(frozen=True, slots=True, kw_only=True)
class CellSummary:
    """A shipped cell in one line."""

    name: str
    robot: str
    description: str
    path: Path


def list_cells() -> tuple[CellSummary, ...]:
    """Summarise the shipped cells; their robots need not be installed."""
    return tuple(_summary(name, path) for name, path in shipped_cells().items())


def _summary(name: str, path: Path) -> CellSummary:
    data = parse_yaml(read_text(path, limit=MAX_TEXT_BYTES), str(path)).data
    urdf = text_at(data, "robot", "urdf") or ""
    return CellSummary(
        name=name,
        robot=urdf.rsplit("/", 1)[-1].split(".")[0],
        description=text_at(data, "description") or "",
        path=path,
    )


def export_cell(
    source: str | Path, *, output: str | Path | None = None, overwrite: bool = False
) -> str:
    """Write a shipped cell, or the cell that an artefact was made from, as YAML.

    A shipped cell is written as it stands, with its comments, so that it can be edited;
    files beside it are named by their whole path. That of an artefact is the resolved
    one: overrides, a chosen bin pose and a chosen scan configuration are in it.

    Parameters
    ----------
    source : str or Path
        Name of a shipped cell, or any artefact.
    output : Path, optional
        Where to write; not written where omitted.
    overwrite : bool
        Replace ``output``.

    Returns
    -------
    str
        The YAML text.
    """
    shipped = shipped_cells().get(str(source))
    if output is not None:
        inputs = [shipped or source]
        check_output(Path(output), overwrite=overwrite, inputs=inputs)
    if shipped is not None and not Path(source).exists():
        text = _standing_alone(shipped)
    else:
        text = _cell_of(Path(source))
    if output is not None:
        publish(Path(output), [text.encode()], overwrite=overwrite)
    return text


def _standing_alone(path: Path) -> str:
    """Text of a shipped cell whose files are found from any folder."""
    text = read_text(path, limit=MAX_TEXT_BYTES)
    beside = f"{path.stem}/"
    if (path.parent / beside).is_dir():
        text = re.sub(rf"(?<=: ){re.escape(beside)}", f"{path.parent}/{beside}", text)
    return text


def _cell_of(artefact: Path) -> str:
    from reachmap.maps import read_provenance

    kept = read_provenance(artefact)
    cell = stored_cell(kept.cell_resolved_json, source=str(artefact)).cell
    return cell_yaml(cell, comment=f"Cell of {artefact.name}, as resolved by reachmap.")
