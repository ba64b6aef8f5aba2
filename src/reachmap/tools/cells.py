"""``reachmap cells``: what is shipped, and the cell of an artefact as YAML."""

from __future__ import annotations

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
    artefact: Path, *, output: Path | None = None, overwrite: bool = False
) -> str:
    """Write the cell that an artefact was made from as YAML.

    The cell is the resolved one: overrides, a chosen bin pose and a chosen scan
    configuration are in it.

    Parameters
    ----------
    artefact : Path
        Any artefact.
    output : Path, optional
        Where to write; not written where omitted.
    overwrite : bool
        Replace ``output``.

    Returns
    -------
    str
        The YAML text.
    """
    from reachmap.maps import read_provenance

    if output is not None:
        check_output(output, overwrite=overwrite, inputs=[artefact])
    kept = read_provenance(artefact)
    cell = stored_cell(kept.cell_resolved_json, source=str(artefact)).cell
    text = cell_yaml(cell, comment=f"Cell of {artefact.name}, as resolved by reachmap.")
    if output is not None:
        publish(output, [text.encode()], overwrite=overwrite)
    return text
