"""The text of a journal: sealed lines, a header, one line per finished unit.

::

    1c291ca3 {"format":"reachmap.journal","format_version":"1.0","kind":…}
    d6e6a9b1 {"unit":0,"ok":25,"frames":27,"wall_s":0.41,"cpu_s":0.40,"result":…}
    04bb1a8c {"unit":7,"ok":0,"frames":27,"wall_s":0.02,"cpu_s":0.02,"error":"…"}

Eight hexadecimal digits of CRC-32, a space, JSON without line breaks, a newline. The
CRC of a unit's line goes on from the CRC of the header, so a line moved here from
another journal is damage like any other.
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeGuard

from reachmap.runtime.encoding import Json, compact
from reachmap.runtime.work import MAX_UNITS

FORMAT = "reachmap.journal"
FORMAT_VERSION = "1.0"
MAX_LINE = 256 * 1024 * 1024
PREFIX = 9  # eight digits and a space
MAX_DEPTH = 50
SHOWN = 60

_RECORD = re.compile(
    rb'\{"unit":(\d{1,9}),"ok":(\d{1,18}),"frames":(\d{1,18}),'
    rb'"wall_s":(\d{1,12}\.\d{3}),"cpu_s":(\d{1,12}\.\d{3}),"(result|error)":'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """First line of a journal.

    Attributes
    ----------
    kind : str
        Name of the kind of scan.
    units : int
        Units of the whole work, over all shards.
    shard : (int, int)
        (i, N): this journal holds the units k with k mod N = i - 1.
    settings : mapping
        All that determines the result.
    document : mapping
        What finishing the artefact needs besides; not compared.
    """

    kind: str
    units: int
    shard: tuple[int, int]
    settings: Mapping[str, Json]
    document: Mapping[str, Json]

    def line(self) -> bytes:
        """Return the sealed line, newline included."""
        body = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "kind": self.kind,
            "units": self.units,
            "shard": list(self.shard),
            "settings": dict(self.settings),
            "document": dict(self.document),
        }
        return seal(compact(body).encode("ascii"))

    def own_units(self) -> range:
        """Units of this shard."""
        index, count = self.shard
        return range(index - 1, self.units, count)

    def identity(self) -> dict[str, Json]:
        """Return what two journals of one work have in common, as JSON values."""
        own = {"kind": self.kind, "units": self.units, **self.settings}
        identity: dict[str, Json] = json.loads(compact(own))
        return identity


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """What a unit's line says before its payload.

    Attributes
    ----------
    ok, frames : int
        Tally of the unit.
    wall_s, cpu_s : float
        Time of the worker's thread on it [s].
    """

    ok: int = 0
    frames: int = 0
    wall_s: float = 0.0
    cpu_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """Where the line of a unit is, and what it begins with.

    ``offset`` and ``length`` are of the line in the file [bytes], ``start`` is where
    in the line the payload (or the text of the error) begins.
    """

    unit: int
    failed: bool
    measure: Measure
    offset: int
    length: int
    start: int


def seal(body: bytes, seed: int = 0) -> bytes:
    """Put the CRC before and the newline after a JSON text."""
    return b"%08x %b\n" % (zlib.crc32(body, seed), body)


def checksum(line: bytes) -> int:
    """CRC a sealed line claims."""
    return int(line[: PREFIX - 1], 16)


def unseal(line: bytes, seed: int = 0) -> bytes | None:
    """JSON text of a sealed line, None when the line is damaged."""
    body = line[PREFIX:-1]
    return body if line == seal(body, seed) else None


def record_line(
    unit: int, payload: str, *, failed: bool, measure: Measure, seed: int
) -> bytes:
    """Sealed line of a finished unit.

    Parameters
    ----------
    payload : str
        Compact JSON: the encoded result, or a string that describes the error.
    seed : int
        CRC of the journal's header.
    """
    body = (
        f'{{"unit":{unit},"ok":{measure.ok},"frames":{measure.frames},'
        f'"wall_s":{measure.wall_s:.3f},"cpu_s":{measure.cpu_s:.3f},'
        f'"{"error" if failed else "result"}":{payload}}}'
    )
    return seal(body.encode("ascii"), seed)


def record_from_line(line: bytes, *, offset: int, seed: int) -> Record | None:
    """Read the beginning of a unit's line; None when the line is damaged."""
    body = unseal(line, seed)
    match = None if body is None else _RECORD.match(body)
    if match is None:
        return None
    unit, ok, frames, wall_s, cpu_s, word = match.groups()
    return Record(
        unit=int(unit),
        failed=word == b"error",
        measure=Measure(
            ok=int(ok), frames=int(frames), wall_s=float(wall_s), cpu_s=float(cpu_s)
        ),
        offset=offset,
        length=len(line),
        start=PREFIX + match.end(),
    )


def header_from_line(line: bytes) -> Header:
    """Read the first line of a journal.

    Raises
    ------
    ValueError
        One sentence that says what is wrong with it.
    """
    body = unseal(line)
    if body is None:
        raise ValueError("its first line is not a whole journal header")
    try:
        data = json.loads(body)
        compact(data)  # refuses NaN and infinities, which json.loads does not
    except (ValueError, RecursionError) as error:
        raise ValueError("its header is not JSON") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise ValueError(f"its header does not say format {FORMAT!r}")
    if not _is_shallow(data, MAX_DEPTH):
        raise ValueError(f"its header is nested deeper than {MAX_DEPTH} levels")
    version = str(data.get("format_version"))
    if version.partition(".")[0] != FORMAT_VERSION.partition(".")[0]:
        raise ValueError(
            f"it has format version {version}, this program reads {FORMAT_VERSION}"
        )
    return _checked_header(data)


def _checked_header(data: Mapping[str, Any]) -> Header:
    units, shard = data.get("units"), data.get("shard")
    if not (_is_count(units) and units <= MAX_UNITS):
        raise ValueError(f"its header says {units!r} units")
    if not (isinstance(shard, list) and len(shard) == 2 and all(map(_is_count, shard))):
        raise ValueError(f"its header says shard {shard!r}")
    if shard[0] > shard[1]:
        raise ValueError(f"its header says shard {shard[0]} of {shard[1]}")
    settings, document = data.get("settings"), data.get("document")
    if not (isinstance(settings, dict) and isinstance(document, dict)):
        raise ValueError("its header has no settings")  # noqa: TRY004
    return Header(
        kind=str(data.get("kind")),
        units=units,
        shard=(shard[0], shard[1]),
        settings=settings,
        document=document,
    )


def differences(old: Header, new: Header) -> list[str]:
    """Name what differs between two headers: ``seed 1 → 2``."""
    before, after = dict(_leaves(old.identity())), dict(_leaves(new.identity()))
    keys = [*before, *(key for key in after if key not in before)]
    return [
        f"{key} {_shown(before.get(key))} → {_shown(after.get(key))}"
        for key in keys
        if before.get(key) != after.get(key) or (key in before) != (key in after)
    ]


def _leaves(data: Json, name: str = "") -> Iterator[tuple[str, Json]]:
    if isinstance(data, dict) and data:
        for key, value in data.items():
            yield from _leaves(value, f"{name}.{key}" if name else key)
    elif isinstance(data, list) and data:
        for index, value in enumerate(data):
            yield from _leaves(value, f"{name}[{index}]")
    else:
        yield name, data


def _shown(value: Json) -> str:
    text = "absent" if value is None else compact(value)
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 1]}…"


def _is_shallow(data: Json, depth: int) -> bool:
    inner = data.values() if isinstance(data, dict) else data
    if not isinstance(data, dict | list):
        return True
    return depth > 0 and all(_is_shallow(item, depth - 1) for item in inner)


def _is_count(value: Any) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 1
