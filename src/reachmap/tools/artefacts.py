"""Reading whatever a user names: an artefact, or the journal of an unfinished run."""

from __future__ import annotations

from pathlib import Path

from reachmap.disk import is_there
from reachmap.errors import MapFileError
from reachmap.maps.format.registry import Artefact, Result, read_artefact
from reachmap.runtime.journal import is_store
from reachmap.runtime.store import store_path


def read_artefact_or_journal(path: Path) -> tuple[Artefact | Result, bool]:
    """Read an artefact, or what a journal holds so far.

    Returns
    -------
    record : WorkspaceMap, BinMap, BinPlacement or another result
    finished : bool
        Whether it was an artefact.

    Raises
    ------
    MapFileError
        The file is missing, damaged, or neither.
    """
    if is_store(path):
        # Assembling a journal needs the scan's own code, engines included.
        from reachmap.runtime.results import preview

        return preview(path), False
    journal = store_path(path)
    if not is_there(path) and is_store(journal):
        raise MapFileError(
            f"{path}: no such file, but there is the journal of an unfinished run; "
            f"name {journal.name} to see what it holds"
        )
    return read_artefact(path), True
