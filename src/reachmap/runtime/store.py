"""Writing the finished units of a run: one writer, nothing lost, resumable.

docs/decisions/journal-engine.md says why this is a file of lines and no database.
"""

from __future__ import annotations

import errno
import fcntl
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from reachmap.errors import IncompleteError, MapFileError, OutputError
from reachmap.maps.bytes.publish import NO_ROOM, sync_folder
from reachmap.runtime.job import Reply
from reachmap.runtime.journal import (
    MAX_LINE,
    PUBLISHED,
    UNITS,
    Entries,
    Header,
    differences,
    open_regular,
    seal,
)

# A choice: one message, not a page.
SHOWN_DIFFERENCES = 8
NO_LOCKS = frozenset({errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS})

log = logging.getLogger(__name__)


def store_path(output: Path, shard: tuple[int, int] | None = None) -> Path:
    """Where the store of an output is kept.

    Examples
    --------
    >>> str(store_path(Path("bin.h5")))
    'bin.h5.journal'
    >>> str(store_path(Path("bin.h5"), (2, 3)))
    'bin.shard-2-of-3.journal'
    """
    if shard is None:
        return output.parent / f"{output.name}.journal"
    return output.parent / f"{output.stem}.shard-{shard[0]}-of-{shard[1]}.journal"


class Store(Entries):
    """A store that is open for writing and locked against a second run.

    Use :func:`open_store`.

    Attributes
    ----------
    resumed : int
        Units that earlier runs did.
    """

    def __init__(self, path: Path, descriptor: int) -> None:
        super().__init__(path, descriptor)
        self.resumed = len(self.results())
        self._unsynced = False

    def put(self, reply: Reply, phase: str = UNITS) -> None:
        """Write the line of a finished unit; it survives a kill from here on.

        Raises
        ------
        IncompleteError
            When there is no room for the line; what was there stays intact.
        """
        measure, word = reply.measure, "error" if reply.failed else "result"
        body = (
            f'{{"phase":"{phase}","unit":{reply.index},"ok":{measure.ok},'
            f'"frames":{measure.frames},"wall_s":{measure.wall_s:.3f},'
            f'"cpu_s":{measure.cpu_s:.3f},"{word}":{reply.text}}}'
        )
        line = seal(body.encode("ascii"), self._seed)
        if len(line) > MAX_LINE:
            raise ValueError(
                f"unit {reply.index}: its result is too large for a line of the journal"
            )
        try:
            _write_all(self._descriptor, line + b"\n", self.end)
        except OSError as error:
            with suppress(OSError):  # a torn line is cut off when it is next read
                os.ftruncate(self._descriptor, self.end)
            raise self._failure(error) from error
        self._unsynced = True
        self._take(line, self.end)
        self.end += len(line) + 1

    def sync(self) -> None:
        """Push every line to the disk; it survives a power cut from here on."""
        if not self._unsynced:
            return
        try:
            os.fsync(self._descriptor)
        except OSError as error:
            raise self._failure(error) from error
        self._unsynced = False

    def remove(self) -> None:
        """Delete the store: its artefact has been published."""
        self.path.unlink(missing_ok=True)

    def safe_text(self, where: str = "") -> str:
        """Say what is in it: ``12 of 40 units and 9 before are safe in b.journal``."""
        done, all_units = len(self.results()), len(self._own)
        first = sum(1 for phase, _ in self._records if phase not in (UNITS, PUBLISHED))
        units = f"{done} of {all_units} units" + (
            f" and {first} before" if first else ""
        )
        return f"{units} are safe {where or f'in {self.path}'}"

    def _failure(self, error: OSError) -> IncompleteError:
        remedy = "free some space" if error.errno in NO_ROOM else "fix the cause"
        return IncompleteError(
            f"{self.path}: {error.strerror}; {self.safe_text('there')}; {remedy}, then "
            "run the same command again to resume"
        )

    def repair(self) -> None:
        """Cut off a torn last line, and restore a damaged copy of the header."""
        os.ftruncate(self._descriptor, self.end)
        if self.damaged or self.copies < 2:
            log.warning(
                "%s: %d damaged lines; their work is repeated",
                *(self.path, self.damaged),
            )
        line = self._header_line + b"\n"
        size = len(line)
        if any(record.offset < 2 * size for record in self._records.values()):
            return  # something has moved; there is no place for a copy
        for here, other in ((0, size), (size, 0)):
            is_good = os.pread(self._descriptor, size, other) == line
            if is_good and os.pread(self._descriptor, size, here) != line:
                _write_all(self._descriptor, line, here)
                self.end = max(self.end, 2 * size)


@contextmanager
def open_store(path: Path, header: Header, *, restart: bool = False) -> Iterator[Store]:
    """Create a store, or open it to resume it.

    Parameters
    ----------
    path : Path
    header : Header
        Of the work to be done; an existing store must agree with it.
    restart : bool
        Discard what an existing store holds.

    Raises
    ------
    OutputError
        When it cannot be written, is not a regular file, or another run is writing it.
    MapFileError
        When it belongs to other settings, or is not a store.
    """
    descriptor = _open_locked(path)
    try:
        begin = 2 * (header.line() + b"\n")
        if restart or _is_torn_start(descriptor, begin):
            _begin(path, descriptor, begin)
        try:
            store = Store(path, descriptor)
        except MapFileError as error:
            raise MapFileError(f"{error}; --restart discards it") from None
        _check_same_work(path, store.header, header)
        store.repair()
        try:
            yield store
        except BaseException:
            with suppress(IncompleteError):  # the first error is what matters
                store.sync()
            raise
        store.sync()
    finally:
        os.close(descriptor)


def _open_locked(path: Path) -> int:
    """Open or create a file that nobody else has open this way.

    Closing the descriptor gives the lock back, and so does the end of the process,
    however it ends.
    """
    while True:
        try:
            descriptor = open_regular(path, os.O_RDWR | os.O_CREAT)
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


def _is_torn_start(descriptor: int, begin: bytes) -> bool:
    """Whether the file is empty or a part of the header a killed run was writing."""
    there = os.pread(descriptor, len(begin) + 1, 0)
    return begin.startswith(there) and len(there) < len(begin)


def _begin(path: Path, descriptor: int, begin: bytes) -> None:
    os.ftruncate(descriptor, 0)
    try:
        _write_all(descriptor, begin, 0)
        os.fsync(descriptor)
    except OSError as error:
        os.ftruncate(descriptor, 0)
        raise OutputError(f"{path}: {error.strerror}") from error
    sync_folder(path.parent)


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
        "settings to resume it, another output to keep it, or --restart to "
        "discard it"
    )


def _write_all(descriptor: int, data: bytes, offset: int) -> None:
    view = memoryview(data)
    while view:
        written = os.pwrite(descriptor, view, offset)
        view, offset = view[written:], offset + written
