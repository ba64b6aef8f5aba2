"""The text of a journal and its reader: sealed lines, a header, one line per unit.

::

    1c291ca3 {"format":"reachmap.journal","format_version":"2.0","kind":…}
    1c291ca3 {"format":"reachmap.journal","format_version":"2.0","kind":…}
    d6e6a9b1 {"phase":"units","unit":0,"ok":25,"frames":27,…,"result":…}
    04bb1a8c {"phase":"units","unit":7,"ok":0,"frames":27,…,"error":"…"}

Eight hexadecimal digits of CRC-32, a space, JSON, a newline, and an empty line, so
that a damaged newline costs one line and not two. The header is there twice, and the
CRC of a unit goes on from that of the header, so that a line moved here from another
store is damage like any other. Any beginning of a store is a store.
"""

from __future__ import annotations

import errno
import os
import re
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveInt, ValidationError

from reachmap.errors import MapFileError
from reachmap.maps.bytes.to_json import flat_json
from reachmap.runtime.encoding import Json, decode, encode
from reachmap.runtime.job import Measure

UNITS = "units"
"""Phase of the units that become the artefact."""
PUBLISHED = "published"
"""Phase of notes on what a run has put in place of its output."""
# Choices against damaged files: twice the frames of the largest scan, one to a unit;
# and far more bytes than a unit writes.
MAX_UNITS = 100_000_000
MAX_LINE = 256 * 1024 * 1024
PREFIX = 9  # eight digits and a space
# A choice: values in messages are cut, in characters.
SHOWN = 60
_START = re.compile(rb'[0-9a-f]{8} \{"format":"reachmap\.journal"')
_RECORD = re.compile(
    rb'\{"phase":"([a-z_0-9.%]{1,40})","unit":(\d{1,9}),"ok":(\d{1,18}),"frames":(\d{1,18}),'
    rb'"wall_s":(\d{1,12}\.\d{3}),"cpu_s":(\d{1,12}\.\d{3}),"(result|error)":'
)


class Header(BaseModel):
    """Whose units a store holds.

    Attributes
    ----------
    kind : str
        Name of the kind of scan.
    units : int
        Units of the whole work, over all shards.
    shard : (int, int)
        (i, N): this store holds the units k with k mod N = i - 1.
    settings : mapping
        All that determines the result.
    document : mapping
        What finishing the artefact needs besides; not compared.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    format: Literal["reachmap.journal"] = "reachmap.journal"
    format_version: Literal["2.0"] = "2.0"
    kind: str
    units: Annotated[int, Field(ge=1, le=MAX_UNITS)]
    shard: tuple[PositiveInt, PositiveInt]
    settings: dict[str, Json]
    document: dict[str, Json]

    def line(self) -> bytes:
        """Return the sealed line, newline included."""
        return seal(encode(self.model_dump()).encode("ascii"))

    def own_units(self) -> range:
        """Units of this shard."""
        index, count = self.shard
        return range(index - 1, self.units, count)

    def identity(self) -> Json:
        """Return what two stores of one work have in common, as JSON values."""
        return decode(encode({"kind": self.kind, "units": self.units, **self.settings}))


def header_of_line(line: bytes) -> Header:
    """Undo :meth:`Header.line`.

    Raises
    ------
    ValueError
        One sentence that says what is wrong with it.
    """
    try:
        return Header.model_validate_json(line[PREFIX:-1])
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        if where == "format_version":
            raise ValueError(
                f"it was started by a version of reachmap with format "
                f"{first['input']!r} (this one has 2.0), and only that can finish it"
            ) from None
        raise ValueError(f"its header: {where}: {first['msg']}") from None


def differences(old: Header, new: Header) -> list[str]:
    """Name what differs between two headers: ``seed 1 → 2``."""
    if encode(old.identity()) == encode(new.identity()):
        return []
    before, after = dict(flat_json(old.identity())), dict(flat_json(new.identity()))
    keys = [*before, *(key for key in after if key not in before)]
    return [
        f"{key} {_shown(before, key)} → {_shown(after, key)}"
        for key in keys
        if before.get(key) != after.get(key)
    ] or ["order of settings"]


def _shown(values: dict[str, str], key: str) -> str:
    text = values.get(key, "absent")
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 1]}…"


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """Where the line of a unit is, and what it begins with.

    ``offset`` and ``length`` are of the line in the file [bytes], ``start`` is where
    in the line the payload (or the text of the error) begins.
    """

    failed: bool
    measure: Measure
    offset: int
    length: int
    start: int


class Entries:
    """The units of an open store.

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
    damaged : int
        Number of complete lines that were skipped.
    end : int
        Length of the file up to the last complete line [bytes].

    Raises
    ------
    MapFileError
        When the file holds no header.
    """

    def __init__(self, path: Path, descriptor: int) -> None:
        self.path = path
        self._descriptor = descriptor
        self._records: dict[tuple[str, int], Record] = {}
        try:
            self._header_line = _header_line(descriptor)
            self.header = header_of_line(self._header_line)
        except ValueError as error:
            raise MapFileError(f"{path} cannot be used as a journal: {error}") from None
        self._seed = int(self._header_line[: PREFIX - 1], 16)
        self._own = frozenset(self.header.own_units())
        self.damaged = self.end = 0
        copies = 0
        for offset, line in _lines(descriptor):
            if line == self._header_line and copies < 2:
                copies += 1
            elif line != b"\n" and not self._take(line, offset):
                self.damaged += 1
            self.end = offset + len(line)
        self.copies = copies

    def results(self, phase: str = UNITS) -> dict[int, Measure]:
        """Units of a phase that have a result, and how they went."""
        return {
            unit: record.measure
            for (name, unit), record in self._records.items()
            if name == phase and not record.failed
        }

    def failed(self, phase: str = UNITS) -> dict[int, str]:
        """Units of a phase that have no result, and the text of their error."""
        return {
            unit: str(self._read(record))
            for (name, unit), record in self._records.items()
            if name == phase and record.failed
        }

    def payload(self, unit: int, phase: str = UNITS) -> Any:
        """Payload of a unit that has a result.

        Raises
        ------
        MapFileError
            The file has changed since it was opened.
        """
        return self._read(self._records[phase, unit])

    def _take(self, line: bytes, offset: int) -> bool:
        """Take in a line of a unit; False when it is damaged."""
        body = unseal(line, self._seed)
        match = None if body is None else _RECORD.match(body)
        if match is None:
            return False
        phase, unit, ok, frames, wall_s, cpu_s, word = match.groups()
        key = phase.decode(), int(unit)
        if key[0] == UNITS and key[1] not in self._own:
            return False
        record = Record(
            failed=word == b"error",
            measure=Measure(
                ok=int(ok), frames=int(frames), wall_s=float(wall_s), cpu_s=float(cpu_s)
            ),
            offset=offset,
            length=len(line),
            start=PREFIX + match.end(),
        )
        known = self._records.get(key)
        if known is None or (known.failed and not record.failed):
            self._records[key] = record
        return True

    def _read(self, record: Record) -> Any:
        line = os.pread(self._descriptor, record.length, record.offset)
        if unseal(line, self._seed) is None:
            raise MapFileError(f"{self.path} was damaged while it was in use")
        try:
            return decode(line[record.start : -2])
        except ValueError as error:
            raise MapFileError(f"{self.path}: {error}") from error


def is_store(path: Path) -> bool:
    """Whether a file begins as a store does, or is named like one; never raises."""
    try:
        with path.open("rb") as stream:
            begin = stream.read(64)
    except OSError:
        return False
    return bool(_START.match(begin)) or (path.suffix == ".journal" and bool(begin))


@contextmanager
def read_store(path: Path) -> Iterator[Entries]:
    """Look into a store, also while a run is writing it.

    Raises
    ------
    MapFileError
        When it cannot be read or is not a store.
    """
    try:
        descriptor = open_regular(path, os.O_RDONLY)
    except OSError as error:
        raise MapFileError(f"{path}: {error.strerror}") from error
    try:
        yield Entries(path, descriptor)
    finally:
        os.close(descriptor)


def open_regular(path: Path, flags: int) -> int:
    """Open a file that is none of pipe, device and folder; links are followed."""
    with suppress(FileNotFoundError):
        if not stat.S_ISREG(path.stat().st_mode):  # opening one may wait for ever
            raise OSError(errno.EINVAL, "not a regular file, as a journal must be")
    return os.open(path, flags | os.O_CLOEXEC, 0o666)


def _header_line(descriptor: int) -> bytes:
    """First whole copy of the header.

    Raises
    ------
    ValueError
        There is none.
    """
    # Four lines, as damage may have made a line break in the first copy.
    begin = b"".join(line for _, line in islice(_lines(descriptor), 4))
    for match in _START.finditer(begin):
        line = begin[match.start() : begin.find(b"\n", match.start()) + 1]
        if unseal(line) is not None:
            return line
    raise ValueError("it does not begin with a whole journal header")


def _lines(descriptor: int) -> Iterator[tuple[int, bytes]]:
    """Offset and bytes of each complete line."""
    offset = 0
    os.lseek(descriptor, 0, os.SEEK_SET)
    with open(descriptor, "rb", closefd=False) as file:
        while (line := file.readline(MAX_LINE)).endswith(b"\n") or (
            len(line) == MAX_LINE
        ):
            yield offset, line
            offset += len(line)


def seal(body: bytes, seed: int = 0) -> bytes:
    """Put the CRC before and the newline after a JSON text."""
    return b"%08x %b\n" % (zlib.crc32(body, seed), body)


def unseal(line: bytes, seed: int = 0) -> bytes | None:
    """JSON text of a sealed line, None when the line is damaged."""
    body = line[PREFIX:-1]
    return body if line == seal(body, seed) else None
