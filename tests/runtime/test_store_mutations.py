"""Stores that were cut, flipped, spliced and shuffled are never read wrongly."""

from __future__ import annotations

import json
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reachmap.errors import MapFileError
from reachmap.runtime.job import Measure, Reply
from reachmap.runtime.journal import PREFIX, Header, read_store, seal
from reachmap.runtime.store import open_store

UNITS = 12
HEADER = Header(
    kind="toy",
    units=UNITS,
    shard=(1, 1),
    settings={"seed": 1, "name": "a cell"},
    document={"title": "a toy"},
)
OTHER = Header(kind="toy", units=UNITS, shard=(1, 1), settings={"seed": 2}, document={})


def checksum(line):
    """CRC that a line claims."""
    return int(line[: PREFIX - 1], 16)


def record_line(unit, text, *, word, measure, seed):
    """Sealed line of a unit, as the module of the format says."""
    return seal(
        f'{{"phase":"units","unit":{unit},"ok":{measure.ok},'
        f'"frames":{measure.frames},"wall_s":{measure.wall_s:.3f},'
        f'"cpu_s":{measure.cpu_s:.3f},"{word}":{text}}}'.encode(),
        seed,
    )


def body(header):
    """A whole store, with a unit that failed."""
    seed = checksum(header.line())
    lines = [header.line(), b"\n", header.line(), b"\n"]
    for unit in (3, 0, 1, 2, 7, 5, 4, 11, 6):
        lines.append(
            record_line(
                unit,
                json.dumps(meaning(unit), separators=(",", ":")),
                word="result",
                measure=Measure(ok=unit, frames=27, wall_s=0.5, cpu_s=0.25),
                seed=seed,
            )
        )
        lines.append(b"\n")
    error = record_line(8, '"broke"', word="error", measure=Measure(), seed=seed)
    return b"".join([*lines, error])


def meaning(unit):
    """What the payload of a unit must say."""
    return {"unit": unit, "values": [unit / 3, -unit, None]}


WHOLE, FOREIGN = body(HEADER), body(OTHER)


def check_reading(path, data):
    """Read a mutated journal: what is read is right, or the refusal is clean."""
    path.write_bytes(data)
    try:
        with read_store(path) as entries:
            assert entries.header in (HEADER, OTHER)
            for unit, measure in entries.results().items():
                assert entries.payload(unit) == meaning(unit)
                assert measure == Measure(ok=unit, frames=27, wall_s=0.5, cpu_s=0.25)
            assert entries.failed() in ({}, {8: "broke"})
    except MapFileError:
        return "refused"
    return "read"


def check_resuming(path, data):
    """Resume a mutated journal: afterwards every unit is there and right."""
    path.write_bytes(data)
    try:
        with open_store(path, HEADER) as journal:
            for unit in range(UNITS):
                if unit not in journal.results():
                    journal.put(Reply(index=unit, text=json.dumps(meaning(unit))))
    except MapFileError:
        assert path.read_bytes() == data
        return "refused"
    with read_store(path) as entries:
        found = {unit: entries.payload(unit) for unit in entries.results()}
    assert found == {unit: meaning(unit) for unit in range(UNITS)}
    return "resumed"


def mutate(data, rng):
    """One to four random injuries."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        if not data:
            break
        at = int(rng.integers(len(data)))
        size = int(rng.integers(1, 40))
        match rng.integers(9):
            case 0:
                data[at] ^= 1 << int(rng.integers(8))
            case 1:
                data[at] = int(rng.integers(256))
            case 2:
                del data[at:]
            case 3:
                del data[at : at + size]
            case 4:
                data[at:at] = rng.bytes(size)
            case 5:
                data[at:at] = data[at : at + size]
            case 6:
                data[at : at + size] = bytes(size)
            case 7:
                lines = data.splitlines(keepends=True)
                rng.shuffle(lines)
                data = bytearray(b"".join(lines))
            case 8:
                stray = FOREIGN.splitlines(keepends=True)
                data += stray[int(rng.integers(len(stray)))]
    return bytes(data)


@pytest.mark.parametrize("count", [400, pytest.param(6000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("check", [check_reading, check_resuming])
def test_mutated_journals(tmp_path, count, check):
    """Random injuries end in right data or a clean refusal; both happen."""
    path, seen = tmp_path / "out.journal", set()
    for seed in range(count):
        rng = np.random.default_rng(seed)
        seen.add(check(path, mutate(WHOLE, rng)))
    assert len(seen) == 2


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    """A file that one property uses over and over."""
    return tmp_path_factory.mktemp("journals") / "out.journal"


@settings(max_examples=200)
@given(data=st.binary(max_size=400))
def test_arbitrary_bytes(scratch, data):
    """Bytes that never were a journal are refused."""
    assert check_reading(scratch, data) == "refused"


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=8,
)


@settings(max_examples=200)
@given(
    changes=st.dictionaries(
        st.sampled_from(
            [
                "format",
                "format_version",
                "kind",
                "units",
                "shard",
                "settings",
                "document",
            ]
        ),
        JSON,
        min_size=1,
        max_size=3,
    )
)
def test_hostile_headers(scratch, changes):
    """A header with right sum and wrong contents is refused, or is well formed."""
    data = json.loads(HEADER.line()[9:]) | changes
    scratch.write_bytes(seal(json.dumps(data).encode()))
    with suppress(MapFileError), read_store(scratch) as entries:
        header = entries.header
        assert header.units >= 1
        assert 1 <= header.shard[0] <= header.shard[1]
        assert header.line()


@settings(max_examples=200)
@given(line=st.binary(max_size=120), unit=st.integers(-5, 10**12))
def test_hostile_lines(scratch, line, unit):
    """A line with a right sum and wrong contents is passed over."""
    seed = checksum(HEADER.line())
    forged = [
        seal(line.replace(b"\n", b""), seed),
        seal(b'{"phase":"units","unit":%d,"ok":1,"frames":1,"result":1}' % unit, seed),
        seal(
            b'{"phase":"units","unit":%d,"ok":1,"frames":1,"wall_s":0.000,"cpu_s":0.000,"result":1}'
            % (unit + UNITS if unit >= 0 else unit),
            seed,
        ),
    ]
    assert check_reading(scratch, WHOLE + b"".join(forged)) == "read"
