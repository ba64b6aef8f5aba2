"""``reachmap report``: the folder of a run in, one self-contained page out."""

from __future__ import annotations

from pathlib import Path

from reachmap.cell.loaded import LoadedCell
from reachmap.errors import CellError
from reachmap.maps.bytes.publish import check_outputs, publish
from reachmap.maps.provenance import cell_of_artefact
from reachmap.report.folder import RunFolder, read_run_folder, usual_files
from reachmap.report.page import report_page


def report(folder: str | Path, *, output: str | Path, overwrite: bool = False) -> Path:
    """Write the report of a run as one self-contained page.

    Parameters
    ----------
    folder : Path
        With ``workspace.h5``, ``placement.h5``, ``bin.h5``, ``study.h5``,
        ``ranked.json`` and ``validation.json``, as far as they exist; the page says
        what is missing.
    output : Path
        Such as ``report.html``.
    overwrite : bool
        Replace the page if it exists.

    Returns
    -------
    Path
        Where the page is.

    Raises
    ------
    MapFileError
        There is no artefact in the folder.
    OutputError
        The page exists or cannot be written.
    """
    folder, output = Path(folder), Path(output)
    check_outputs([output], overwrite=overwrite, inputs=usual_files(folder))
    run = read_run_folder(folder)
    page = report_page(run, _cell(run))
    # JSON can spell halves of letters, which UTF-8 cannot.
    publish(output, [page.encode(errors="backslashreplace")], overwrite=overwrite)
    return output


def _cell(run: RunFolder) -> LoadedCell | str:
    """Cell of the run, or why it cannot be loaded; the report is made anyway."""
    role = run.latest
    try:
        return cell_of_artefact(run.artefacts[role].provenance, run.files[role])
    except CellError as error:
        return error.lines[0]
