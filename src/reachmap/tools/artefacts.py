"""Reading whatever a user names: an artefact, or the journal of an unfinished run."""

from __future__ import annotations

import re
from pathlib import Path

from reachmap.disk import is_there
from reachmap.errors import MapFileError
from reachmap.maps.format.registry import Artefact, read_artefact
from reachmap.runtime.journal.journal import journal_path

_JOURNAL = re.compile(rb'[0-9a-f]{8} \{"format":"reachmap\.journal"')


def is_journal(path: Path) -> bool:
    """Whether a file begins as a journal does; never raises."""
    try:
        with path.open("rb") as stream:
            return _JOURNAL.match(stream.read(64)) is not None
    except OSError:
        return False


def read_artefact_or_journal(path: Path) -> tuple[Artefact, bool]:
    """Read an artefact, or what a journal holds so far.

    Returns
    -------
    record : WorkspaceMap, BinMap or BinPlacement
    finished : bool
        Whether it was an artefact.

    Raises
    ------
    MapFileError
        The file is missing, damaged, or neither.
    """
    if is_journal(path):
        # Assembling a journal needs the scan's own code, engines included.
        from reachmap.runtime.results import preview

        return preview(path), False
    journal = journal_path(path)
    if not is_there(path) and is_journal(journal):
        raise MapFileError(
            f"{path}: no such file, but a run towards it is not finished; "
            f"name {journal.name} to look at what is there"
        )
    return read_artefact(path), True
