"""The append-only journal of a run: one writer, nothing lost, resumed by itself."""

from __future__ import annotations

import errno
import fcntl
import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from reachmap.errors import IncompleteError, MapFileError, OutputError
from reachmap.maps.bytes.publish import sync_folder
from reachmap.runtime.journal.entries import Entries
from reachmap.runtime.journal.format import (
    MAX_LINE,
    Header,
    Measure,
    differences,
    record_from_line,
    record_line,
)

NO_LOCKS = frozenset({errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS})

log = logging.getLogger(__name__)


def open_locked(path: Path) -> int:
    """Open or create a file that nobody else has open this way.

    Parameters
    ----------
    path : Path

    Returns
    -------
    int
        Descriptor for reading and writing; closing it gives the lock back, and so
        does the end of the process, however it ends.

    Raises
    ------
    OutputError
        When another process has it, or it cannot be opened.
    """
    while True:
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise OutputError(f"{path}: {error.strerror}") from error
        try:
            _lock(path, descriptor)
            # The run that held the lock may just have removed the file.
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        except FileNotFoundError:
            pass
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _lock(path: Path, descriptor: int) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OutputError(
            f"{path} is being written by another run: wait for it, or choose "
            "another output"
        ) from None
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise OutputError(f"{path}: {error.strerror}") from error
        log.warning("%s: this file system has no locks; run one scan at a time", path)


SYNC_INTERVAL_S = 1.0
SHOWN_DIFFERENCES = 8
NO_ROOM = frozenset({errno.ENOSPC, errno.EFBIG, errno.EDQUOT})


def journal_path(output: Path, shard: tuple[int, int] | None = None) -> Path:
    """Where the journal of an output is kept.

    Examples
    --------
    >>> str(journal_path(Path("bin.h5")))
    'bin.h5.journal'
    >>> str(journal_path(Path("bin.h5"), (2, 3)))
    'bin.shard-2-of-3.journal'
    """
    if shard is None:
        return output.parent / f"{output.name}.journal"
    return output.parent / f"{output.stem}.shard-{shard[0]}-of-{shard[1]}.journal"


class Journal:
    """A journal that is open for writing and locked against a second run.

    Use :func:`open_journal`.

    Parameters
    ----------
    path : Path
    descriptor : int
        Open for reading and writing, locked.
    entries : Entries
    sync_interval_s : float
        Longest time a line may wait for the disk [s].
    clock : callable
    """

    def __init__(
        self,
        path: Path,
        descriptor: int,
        entries: Entries,
        *,
        sync_interval_s: float = SYNC_INTERVAL_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.path = path
        self.entries = entries
        self._descriptor = descriptor
        self._interval_s = sync_interval_s
        self._clock = clock
        self._synced_s = clock()
        self._dirty = False

    def append(
        self,
        unit: int,
        payload: str,
        *,
        failed: bool = False,
        measure: Measure | None = None,
    ) -> None:
        """Write the line of a finished unit; it survives a kill from here on.

        Parameters
        ----------
        unit : int
        payload : str
            Compact JSON of the result, or of a string that describes the error.
        failed : bool
        measure : Measure

        Raises
        ------
        IncompleteError
            When there is no room for the line; what was there stays intact.
        """
        entries = self.entries
        line = record_line(
            unit,
            payload,
            failed=failed,
            measure=measure or Measure(),
            seed=entries.seed,
        )
        record = record_from_line(line, offset=entries.end, seed=entries.seed)
        if record is None or len(line) > MAX_LINE:
            raise ValueError(f"unit {unit}: no journal line can hold its result")
        self._write(line)
        entries.end += len(line)
        entries.add(record)
        self._dirty = True
        self.sync_if_due()

    def sync_if_due(self) -> None:
        """Push the lines to the disk when the last time is long enough ago."""
        if self._dirty and self._clock() - self._synced_s >= self._interval_s:
            self.sync()

    def sync(self) -> None:
        """Push every line to the disk."""
        try:
            os.fsync(self._descriptor)
        except OSError as error:
            raise self._failure(error) from error
        self._synced_s = self._clock()
        self._dirty = False

    def remove(self) -> None:
        """Delete the journal: its artefact has been published."""
        self.path.unlink(missing_ok=True)

    def _write(self, line: bytes) -> None:
        start = self.entries.end
        try:
            _write_all(self._descriptor, line, start)
        except OSError as error:
            with suppress(OSError):  # a torn line is cut off when it is next read
                os.ftruncate(self._descriptor, start)
            raise self._failure(error) from error

    def _failure(self, error: OSError) -> IncompleteError:
        done = len(self.entries.results)
        remedy = "free some space" if error.errno in NO_ROOM else "see to that"
        return IncompleteError(
            f"{self.path}: {error.strerror}; {done} of {self.entries.header.units} "
            f"units are safe there; {remedy}, then the same command goes on from them"
        )


@contextmanager
def open_journal(
    path: Path,
    header: Header,
    *,
    restart: bool = False,
    sync_interval_s: float = SYNC_INTERVAL_S,
) -> Iterator[Journal]:
    """Create a journal, or open it to go on with it.

    Parameters
    ----------
    path : Path
    header : Header
        Of the work to be done; an existing journal must agree with it.
    restart : bool
        Discard what an existing journal holds.
    sync_interval_s : float
        Longest time a line may wait for the disk [s].

    Yields
    ------
    Journal

    Raises
    ------
    OutputError
        When it cannot be written, or another run is writing it.
    MapFileError
        When it belongs to other settings, or is not a journal.
    """
    descriptor = open_locked(path)
    try:
        entries = _prepared(path, descriptor, header, restart=restart)
        journal = Journal(path, descriptor, entries, sync_interval_s=sync_interval_s)
        try:
            yield journal
        except BaseException:
            with suppress(IncompleteError):  # what went wrong first is the news
                journal.sync()
            raise
        journal.sync()
    finally:
        os.close(descriptor)


def _prepared(path: Path, descriptor: int, header: Header, *, restart: bool) -> Entries:
    first = header.line()
    if restart or _is_torn_start(descriptor, first):
        os.ftruncate(descriptor, 0)
        try:
            _write_all(descriptor, first, 0)
            os.fsync(descriptor)
        except OSError as error:
            os.ftruncate(descriptor, 0)
            raise OutputError(f"{path}: {error.strerror}") from error
        sync_folder(path.parent)
    try:
        entries = Entries(path, descriptor)
    except MapFileError as error:
        raise MapFileError(f"{error}; --restart discards it") from None
    _check_same_work(path, entries.header, header)
    os.ftruncate(descriptor, entries.end)
    if entries.damaged:
        log.warning(
            "%s: %d damaged lines; their units are done again", path, entries.damaged
        )
    return entries


def _is_torn_start(descriptor: int, first: bytes) -> bool:
    """Whether the file is empty or a part of the header a killed run was writing."""
    return first.startswith(os.pread(descriptor, len(first) + 1, 0)) and (
        os.fstat(descriptor).st_size < len(first)
    )


def _check_same_work(path: Path, old: Header, new: Header) -> None:
    changed = differences(old, new)
    if old.shard != new.shard:
        changed.append(f"shard {old.shard} → {new.shard}")
    if not changed:
        return
    shown = changed[:SHOWN_DIFFERENCES]
    if len(changed) > len(shown):
        shown.append(f"and {len(changed) - len(shown)} more")
    raise MapFileError(
        f"{path} belongs to other settings ({', '.join(shown)}): give the same "
        "settings to go on with it, another output to keep it, or --restart to "
        "discard it"
    )


def _write_all(descriptor: int, data: bytes, offset: int) -> None:
    view = memoryview(data)
    while view:
        written = os.pwrite(descriptor, view, offset)
        view, offset = view[written:], offset + written
