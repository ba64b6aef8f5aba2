"""Reading a journal: which units it holds, and their payloads on request.

Only complete lines with the right checksum count. A torn last line is what a killed
run leaves; a damaged line in the middle costs that one unit.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

from reachmap.errors import MapFileError
from reachmap.runtime.encoding import Json
from reachmap.runtime.journal.format import (
    MAX_LINE,
    Header,
    Record,
    checksum,
    header_from_line,
    record_from_line,
    unseal,
)


class Entries:
    """The units of an open journal.

    A unit that was recorded twice keeps its first result; a result wins over an
    error. Payloads stay in the file until they are asked for.

    Parameters
    ----------
    path : Path
        For messages.
    descriptor : int
        Of the open file; not closed here.

    Attributes
    ----------
    header : Header
    seed : int
        CRC of the header line, from which the CRCs of the units go on.
    damaged : int
        Number of complete lines that were passed over.
    end : int
        Length of the file up to the last complete line [bytes].

    Raises
    ------
    MapFileError
        When the first line is not the header of a journal.
    """

    def __init__(self, path: Path, descriptor: int) -> None:
        self._path = path
        self._descriptor = descriptor
        self._results: dict[int, Record] = {}
        self._failed: dict[int, Record] = {}
        self.damaged = 0
        self.end = 0
        lines = _lines(descriptor)
        first = next(lines, b"")
        try:
            self.header: Header = header_from_line(first)
        except ValueError as error:
            raise MapFileError(f"{path} cannot be used as a journal: {error}") from None
        self.seed = checksum(first)
        self.end = offset = len(first)
        for line in lines:
            self._take(line, offset)
            offset += len(line)

    @property
    def results(self) -> Mapping[int, Record]:
        """Units that have a result."""
        return MappingProxyType(self._results)

    @property
    def failed(self) -> Mapping[int, Record]:
        """Units that have an error and no result."""
        return MappingProxyType(self._failed)

    def add(self, record: Record) -> None:
        """Take in the record of one more line."""
        if record.unit in self._results:
            return
        if record.failed:
            self._failed.setdefault(record.unit, record)
        else:
            self._results[record.unit] = record
            self._failed.pop(record.unit, None)

    def payload(self, unit: int) -> Json:
        """Payload of a unit in :attr:`results`, as JSON values."""
        return self._read(self._results[unit])

    def error(self, unit: int) -> str:
        """Text of the error of a unit in :attr:`failed`."""
        return str(self._read(self._failed[unit]))

    def _take(self, line: bytes, offset: int) -> None:
        if not line.endswith(b"\n"):
            return
        record = record_from_line(line, offset=offset, seed=self.seed)
        self.end = offset + len(line)
        if record is None or record.unit not in self.header.own_units():
            self.damaged += 1
        else:
            self.add(record)

    def _read(self, record: Record) -> Json:
        line = os.pread(self._descriptor, record.length, record.offset)
        if unseal(line, self.seed) is None:
            raise MapFileError(f"{self._path} was damaged while it was in use")
        try:
            return json.loads(line[record.start : -2])
        except (ValueError, RecursionError) as error:
            raise MapFileError(f"{self._path}: unit {record.unit}: {error}") from error


def _lines(descriptor: int) -> Iterator[bytes]:
    os.lseek(descriptor, 0, os.SEEK_SET)
    with open(descriptor, "rb", closefd=False) as file:
        while line := file.readline(MAX_LINE):
            yield line


@contextmanager
def read_journal(path: Path) -> Iterator[Entries]:
    """Look into a journal, also while a run is writing it.

    Parameters
    ----------
    path : Path

    Yields
    ------
    Entries

    Raises
    ------
    MapFileError
        When it cannot be read or is not a journal.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise MapFileError(f"{path}: {error.strerror}") from error
    try:
        try:
            entries = Entries(path, descriptor)
        except IsADirectoryError as error:  # it opens, and cannot be read
            raise MapFileError(f"{path}: {error.strerror}") from error
        yield entries
    finally:
        os.close(descriptor)
