"""From a YAML file, or from an artefact, to a :class:`LoadedCell`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from reachmap.cell.bins.carriers import write_out_carriers
from reachmap.cell.bins.shorthand import gather_bins, write_out_bins, write_out_fill
from reachmap.cell.bins.support import with_standing_bins
from reachmap.cell.files.files import compare_hashes, read_files, stored_files
from reachmap.cell.files.resources import shipped_folder
from reachmap.cell.loaded import SUFFIXES, LoadedCell, fingerprint
from reachmap.cell.model.cell import Cell
from reachmap.cell.pick_cycle import check_part_choice
from reachmap.cell.references import check_names, find_warnings
from reachmap.cell.resolution import (
    leaning_levels,
    resolved_cell,
    validated,
    write_out_mount,
)
from reachmap.cell.text.expressions import resolve_expressions, restore_expressions
from reachmap.cell.text.messages import did_you_mean
from reachmap.cell.text.overrides import apply_overrides
from reachmap.cell.text.yaml_reader import (
    MAX_TEXT_BYTES,
    Document,
    Place,
    parse_yaml,
    read_text,
)
from reachmap.disk import is_file, is_hdf5, is_text, one_or_more, recorded_name
from reachmap.errors import CellError

__all__ = [
    "LoadedCell",
    "cell_from_json",
    "cell_from_text",
    "cell_path",
    "read_cell",
    "shipped_cells",
    "stored_cell",
]

# A choice against hostile input: the shipped cells have up to 6,400 bytes.
MAX_JSON_BYTES = 4_000_000


def shipped_cells() -> dict[str, Path]:
    """Name to file of the cells shipped with reachmap, sorted by name."""
    return {path.stem: path for path in sorted(shipped_folder().glob("*.yaml"))}


def check_storable(path: Path) -> None:
    """Raise CellError where a path could not be written down."""
    if not is_text(str(path.absolute())):
        name = recorded_name(str(path.absolute()))
        raise CellError(f"{name}: the path is not UTF-8 text, and could not be stored")


def read_cell(name_or_path: str | Path, overrides: Sequence[str] = ()) -> LoadedCell:
    """Read a cell, with everything it refers to.

    Parameters
    ----------
    name_or_path : str
        Name of a shipped cell (``ur5-eye-in-hand``) or path of a YAML file.
    overrides : sequence of str
        ``key.path=value`` assignments, applied in order.

    Raises
    ------
    CellError
        Every mistake is a line ``file:line:column: key.path: …``.
    """
    name_or_path, overrides = str(name_or_path), one_or_more(overrides)
    path = cell_path(str(name_or_path))
    check_storable(path)
    if is_hdf5(path):
        raise CellError(
            f"{path}: this is an HDF5 file, a map perhaps; not a cell (`reachmap cells "
            "--export` writes the cell of a map)"
        )
    text = read_text(path, limit=MAX_TEXT_BYTES)
    return cell_from_text(
        text,
        label=str(path),
        source=str(name_or_path),
        directory=path.parent.absolute(),
        overrides=overrides,
    )


def cell_from_text(
    text: str,
    *,
    label: str,
    directory: Path,
    source: str | None = None,
    overrides: Sequence[str] = (),
) -> LoadedCell:
    """Load a cell from YAML text.

    Parameters
    ----------
    text : str
    label : str
        Name of the text in error messages.
    directory : Path
        Folder that relative references start from.
    """
    document = parse_yaml(text, label)
    if not isinstance(document.data, dict):
        raise CellError(f"{label}:1:1: expected a mapping with format: reachmap.cell")
    cell = _validated(document, overrides)
    files = read_files(document, directory)
    if files.robot is not None:
        check_names(document, files.robot, files.srdf_description)
    warnings = find_warnings(document, cell, files) if cell is not None else ()
    warnings += tuple(line for e in files.expansions for line in e.warnings)
    warnings = (*files.notes, *warnings)
    document.raise_mistakes()
    if cell is None or files.robot is None:
        raise CellError(f"{label}: cannot be loaded")
    resolved = resolved_cell(document, cell, files, directory)
    leaning = leaning_levels(resolved)
    if leaning:
        warnings = (*warnings, f"{label}: {leaning}")
    return LoadedCell(
        cell=resolved,
        source=source or label,
        directory=directory,
        text=text,
        overrides=tuple(overrides),
        resolved_json=resolved.model_dump_json(),
        sha256=fingerprint(resolved, files.urdf, files.srdf, files.files_sha256),
        urdf=files.urdf,
        srdf=files.srdf,
        files_sha256=files.files_sha256,
        mesh_paths=files.mesh_paths,
        joint_limits=files.joint_limits,
        warnings=warnings,
    )


def _validated(document: Document, overrides: Sequence[str]) -> Cell | None:
    """Apply overrides, write out shorthand, and validate; None where that fails."""
    gather_bins(document)
    restore_expressions(document)
    if overrides:
        apply_overrides(document, overrides, Cell)
    resolve_expressions(document)
    write_out_mount(document)
    write_out_bins(document)
    write_out_carriers(document)
    write_out_fill(document)
    check_part_choice(document)
    return validated(document)


def cell_path(name_or_path: str) -> Path:
    """Path of a cell file, or of the shipped cell of that name.

    Raises
    ------
    CellError
        There is neither.
    """
    path = Path(name_or_path)
    if path.suffix in SUFFIXES or len(path.parts) > 1:
        return path
    cells = shipped_cells()
    if name_or_path in cells:
        return cells[name_or_path]
    if is_file(path):
        return path
    hint = did_you_mean(name_or_path, tuple(cells))
    raise CellError(
        f"{name_or_path!r:.120} is neither a shipped cell nor a file; {hint}"
    )


def cell_from_json(
    resolved_json: str,
    *,
    urdf: str,
    srdf: str = "",
    text: str = "",
    overrides: Sequence[str] = (),
    changes: Sequence[str] = (),
    files_sha256: Mapping[str, str] | None = None,
    source: str = "artefact",
) -> LoadedCell:
    """Load a cell from what an artefact keeps in ``/provenance``.

    The robot description comes from the arguments; only meshes are looked for on
    this machine, and they must be the ones that were used.

    Parameters
    ----------
    resolved_json : str
        ``cell_resolved_json``.
    urdf, srdf, text : str
        ``urdf``, ``srdf`` and ``cell_yaml``.
    overrides : sequence of str
        Those that are in ``resolved_json`` already.
    changes : sequence of str
        ``key.path=value`` to be made now; they join the overrides.
    files_sha256 : mapping, optional
        Mesh to expected sha256; not compared where omitted.
    source : str
        Name in error messages.

    Raises
    ------
    CellError
        The JSON is no cell, or a mesh is missing or has changed.
    """
    document, cell = stored_cell(resolved_json, source=source, changes=changes)
    files = stored_files(document, urdf=urdf, srdf=srdf)
    if files.robot is not None:
        check_names(document, files.robot, files.srdf_description)
    compare_hashes(document, files, files_sha256 or {})
    if changes:
        cell = with_standing_bins(document, cell)
    document.raise_mistakes()
    return LoadedCell(
        cell=cell,
        source=source,
        directory=files.resolver.directory,
        text=text,
        overrides=(*overrides, *changes),
        resolved_json=cell.model_dump_json(),
        sha256=fingerprint(cell, urdf, srdf, files.files_sha256),
        urdf=urdf,
        srdf=srdf,
        files_sha256=files.files_sha256,
        mesh_paths=files.mesh_paths,
    )


class StoredCell(NamedTuple):
    """A cell as an artefact keeps it, before any file is looked for."""

    document: Document
    cell: Cell


def stored_cell(
    resolved_json: str, *, source: str = "artefact", changes: Sequence[str] = ()
) -> StoredCell:
    """Validate the ``cell_resolved_json`` of an artefact; needs no other file.

    Raises
    ------
    CellError
        The JSON is no cell.
    """
    document = Document(source=source)
    document.places[()] = Place(source=source)
    if len(resolved_json) > MAX_JSON_BYTES:
        raise CellError(f"{source}: the cell is larger than {MAX_JSON_BYTES:,} bytes")
    try:
        document.data = json.loads(resolved_json)
    except (ValueError, RecursionError) as error:
        raise CellError(f"{source}: the cell is not JSON: {error}") from None
    if not isinstance(document.data, dict):
        raise CellError(f"{source}: the cell is not a JSON object")
    cell = _validated(document, changes)
    document.raise_mistakes()
    if cell is None:
        raise CellError(f"{source}: cannot be loaded")
    return StoredCell(document, cell)
