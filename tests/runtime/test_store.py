from __future__ import annotations

import errno
import fcntl
import json
import os
import random
from pathlib import Path

import pytest

from reachmap.errors import IncompleteError, MapFileError, OutputError
from reachmap.runtime import store as store_module
from reachmap.runtime.job import Measure, Reply
from reachmap.runtime.journal import Header, read_store, seal
from reachmap.runtime.store import open_store, store_path

SETTINGS = {"seed": 1, "cell": {"bin": {"xyz": [0.5, 0.0, -0.2]}}, "method": "roadmap"}


def header(*, units=20, shard=(1, 1), **settings):
    """A header of a small work."""
    return Header(
        kind="toy",
        units=units,
        shard=shard,
        settings={**SETTINGS, **settings},
        document={"title": "a toy"},
    )


@pytest.fixture
def path(tmp_path):
    """Where the journal goes."""
    return tmp_path / "out.h5.journal"


def fill(path, units, head=None):
    """Write some units; the payload of unit k says k."""
    with open_store(path, head or header()) as journal:
        for unit in units:
            put(journal, unit, measure=Measure(ok=unit, frames=27))


def put(store, unit, text=None, **settings):
    """Write one unit."""
    store.put(Reply(index=unit, text=text or payload(unit), **settings))


def payload(unit):
    """Compact JSON of a unit."""
    return json.dumps({"value": unit * unit}, separators=(",", ":"))


def contents(path):
    """Payload of each unit with a result."""
    with read_store(path) as entries:
        return {unit: entries.payload(unit) for unit in entries.results()}


def test_what_was_written_is_read(path):
    """Units, payloads, tallies and header come back."""
    fill(path, [3, 0, 7])
    assert contents(path) == {3: {"value": 9}, 0: {"value": 0}, 7: {"value": 49}}
    with read_store(path) as entries:
        assert entries.header == header()
        assert entries.results()[7] == Measure(ok=7, frames=27)


def test_a_second_run_goes_on_where_the_first_ended(path):
    """Opening again keeps the units and appends behind them."""
    fill(path, [0, 1])
    fill(path, [2])
    assert sorted(contents(path)) == [0, 1, 2]


def test_every_cut_leaves_the_units_before_it(path):
    """A file cut at any byte resumes with all lines that were complete."""
    fill(path, range(3))
    whole = path.read_bytes()
    ends = [k + 1 for k in range(len(whole)) if whole[k : k + 2] == b"\n\n"]
    for cut in range(len(whole) + 1):
        path.write_bytes(whole[:cut])
        with open_store(path, header()) as journal:
            complete = sum(cut >= end for end in ends[2:])
            assert sorted(journal.results()) == list(range(complete))
            put(journal, 9)
        assert contents(path)[9] == {"value": 81}


def test_a_damaged_line_costs_its_own_unit_only(path, caplog):
    """A flipped bit loses one unit, says so, and what follows is kept."""
    fill(path, range(5))
    lines = path.read_bytes().splitlines(keepends=True)
    lines[8] = lines[8].replace(b'"value":4', b'"value":5')
    path.write_bytes(b"".join(lines))
    with open_store(path, header()) as journal:
        assert sorted(journal.results()) == [0, 1, 3, 4]
        assert journal.damaged == 1
    assert "1 damaged lines" in caplog.text


def damaged(data, rng):
    """A store with one byte changed or the end cut off, anywhere."""
    where = rng.randrange(len(data))
    if rng.random() < 0.2:
        return data[:where]
    flipped = bytes([data[where] ^ 1 << rng.randrange(8)])
    return data[:where] + flipped + data[where + 1 :]


@pytest.mark.parametrize("tries", [400, pytest.param(20_000, marks=pytest.mark.slow)])
def test_any_damage_costs_a_unit_at_most(path, tries):
    """One flipped bit, in a header or in a unit: at most one unit is lost, and said."""
    fill(path, range(5))
    whole, rng = path.read_bytes(), random.Random(tries)
    for _ in range(tries):
        data = damaged(whole, rng)
        path.write_bytes(data)
        with open_store(path, header()) as store:
            kept = {unit: store.payload(unit) for unit in store.results()}
            said = store.damaged or store.copies < 2
            for unit in set(range(5)) - set(kept):
                put(store, unit)
        assert all(value == {"value": unit * unit} for unit, value in kept.items())
        if len(data) == len(whole):
            assert len(kept) == 5 or (len(kept) == 4 and said)
        assert contents(path) == {unit: {"value": unit * unit} for unit in range(5)}


@pytest.mark.slow
def test_every_bit_of_a_store(path):
    """All bits of a small store, one after another."""
    fill(path, range(2), small())
    whole = path.read_bytes()
    for where, byte in enumerate(whole):
        for bit in range(8):
            path.write_bytes(
                whole[:where] + bytes([byte ^ 1 << bit]) + whole[where + 1 :]
            )
            with open_store(path, small()) as store:
                assert len(store.results()) >= 1
            assert path.read_bytes()[: len(small().line())] == small().line()


def small():
    """A header of few bytes."""
    return Header(kind="toy", units=2, shard=(1, 1), settings={}, document={})


@pytest.mark.parametrize("bad", [0, 1])
def test_a_damaged_header_costs_nothing_and_is_restored(path, bad):
    """Either copy of the header will do, and makes the other whole again."""
    fill(path, range(5))
    whole = path.read_bytes()
    size = whole.index(b"\n") + 2
    for offset in (0, 8, 9, 40, size - 3, size - 2):
        where = bad * size + offset
        for value in (ord("\n"), whole[where] ^ 1):
            path.write_bytes(whole[:where] + bytes([value]) + whole[where + 1 :])
            with read_store(path) as entries:
                assert len(entries.results()) == 5
            fill(path, [])
            assert path.read_bytes() == whole


def test_a_power_cut_loses_what_was_not_synced_and_no_more(path, monkeypatch):
    """Writes since the last sync may be lost in part and in any order."""
    written, rng = [], random.Random(3)
    real_write, real_sync = os.pwrite, os.fsync

    def pwrite(descriptor, data, offset):
        written.append((offset, bytes(data)))
        return real_write(descriptor, data, offset)

    def fsync(descriptor):
        real_sync(descriptor)
        safe.clear()
        safe.append(path.read_bytes())
        written.clear()

    safe = [b""]
    monkeypatch.setattr(os, "pwrite", pwrite)
    monkeypatch.setattr(os, "fsync", fsync)
    cuts = 0
    for _ in range(40):
        path.unlink(missing_ok=True)
        safe[:], synced = [b""], set()
        with open_store(path, header()) as store:
            pending = []
            for unit in range(12):
                put(store, unit)
                pending.append(unit)
                if rng.random() < 0.3:
                    store.sync()
                    synced.update(pending)
                    pending = []
                disk = cut_power(safe[0], written, rng)
                other = path.with_name("other.journal")
                other.write_bytes(disk)
                with open_store(other, header()) as after:
                    kept = after.results()
                    assert synced <= set(kept) <= synced | set(pending)
                    assert all(
                        after.payload(one) == {"value": one * one} for one in kept
                    )
                other.unlink()
                cuts += 1
    assert cuts == 480


def cut_power(disk, written, rng):
    """What may be on a disk: any of the pages written since, the others as before."""
    for offset, data in written:
        for begin in range(0, len(data), 64):
            if rng.random() < 0.5:
                piece = data[begin : begin + 64]
                disk = disk.ljust(offset + begin, b"\0")
                disk = disk[: offset + begin] + piece + disk[offset + begin + 64 :]
    return disk


def test_a_store_of_another_version_is_named(path):
    """The message says which, and that the version that began it can finish it."""
    fill(path, [0])
    for version in ("1.0", "3.1"):
        text = header().line()[9:-1].replace(b'"2.0"', f'"{version}"'.encode())
        path.write_bytes(seal(text) + seal(b'{"unit":0}'))
        with (
            pytest.raises(MapFileError, match=f"with format '{version}'.*--restart"),
            open_store(path, header()),
        ):
            pass


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_no_file_is_refused_at_once(path, make):
    """A pipe or a folder where the store belongs neither blocks nor breaks anything."""
    make(path)
    with pytest.raises(OutputError, match="not a regular file"):
        fill(path, [])
    with pytest.raises(MapFileError, match="not a regular file"), read_store(path):
        pass


def test_a_device_is_refused_at_once(path):
    """So is a link to a device."""
    path.symlink_to("/dev/null")
    with pytest.raises(OutputError, match="not a regular file"):
        fill(path, [])


def test_phases_do_not_meet(path):
    """Units of a survey have numbers of their own, and belong to no shard."""
    with open_store(path, header(shard=(2, 2))) as store:
        store.put(Reply(index=0, text="7"), "survey")
        store.put(Reply(index=1, text="8"))
    with read_store(path) as entries:
        assert (list(entries.results("survey")), list(entries.results())) == ([0], [1])
        assert (entries.payload(0, "survey"), entries.payload(1)) == (7, 8)


def test_lines_of_another_journal_are_damage(path, tmp_path):
    """A valid line under another header does not count: its settings were others."""
    other = tmp_path / "other.journal"
    fill(other, [5], header(seed=2))
    fill(path, [0])
    stray = other.read_bytes().splitlines(keepends=True)[4]
    path.write_bytes(path.read_bytes() + stray)
    with read_store(path) as entries:
        assert (sorted(entries.results()), entries.damaged) == ([0], 1)


def test_units_outside_the_work_are_damage(path):
    """A line for a unit that does not exist, or is another shard's, is passed over."""
    head = header(units=4, shard=(1, 2))
    with open_store(path, head) as journal:
        for unit in (0, 1, 2, 99):
            put(journal, unit)
    with read_store(path) as entries:
        assert (sorted(entries.results()), entries.damaged) == ([0, 2], 2)


def test_first_result_wins_and_a_result_beats_an_error(path):
    """Repeated units have one meaning, whatever their order."""
    with open_store(path, header()) as journal:
        put(journal, 1, '"broke"', failed=True)
        put(journal, 1, '{"value":1}')
        put(journal, 1, '{"value":2}')
        put(journal, 1, '"broke again"', failed=True)
        put(journal, 2, '"first"', failed=True)
        put(journal, 2, '"second"', failed=True)
        live = journal.results(), journal.failed()
    with read_store(path) as entries:
        assert (entries.results(), entries.failed()) == live
        assert entries.payload(1) == {"value": 1}
        assert entries.failed()[2] == "first"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seed": 2}, "seed 1 → 2"),
        (
            {"cell": {"bin": {"xyz": [0.5, 0.1, -0.2]}}},
            "cell.bin.xyz [0.5, 0.0, -0.2] → [0.5, 0.1, -0.2]",
        ),
        ({"units": 21}, "units 20 → 21"),
        ({"extra": True}, "extra absent → true"),
        ({"method": "x" * 200}, 'method "roadmap" → "xxxxx'),
    ],
)
def test_other_settings_are_refused_by_name(path, change, said):
    """The refusal names the differing key, both values, and what can be done."""
    fill(path, [0])
    before = path.read_bytes()
    with (
        pytest.raises(MapFileError, match="--restart") as caught,
        open_store(path, header(**change)),
    ):
        pass
    assert said in str(caught.value)
    assert len(str(caught.value)) < 600
    assert path.read_bytes() == before


def test_the_document_may_differ(path):
    """What only dresses the artefact, such as folder names, does not stop a resume."""
    fill(path, [0])
    moved = Header(
        kind="toy", units=20, shard=(1, 1), settings=SETTINGS, document={"title": "b"}
    )
    with open_store(path, moved) as journal:
        assert list(journal.results()) == [0]
        assert journal.header.document == {"title": "a toy"}


def test_restart_discards(path):
    """With restart nothing of the old journal is left, also if it cannot be read."""
    for junk in (None, b"not a journal\n" * 50):
        fill(path, [0]) if junk is None else path.write_bytes(junk)
        with open_store(path, header(seed=2), restart=True) as journal:
            assert not journal.results()
        assert contents(path) == {}


@pytest.mark.parametrize(
    "text",
    [
        b"hello\n",
        b"hello",
        b"\n",
        b"\x00" * 100,
        seal(b'{"format":"something.else"}'),
        seal(b"[1, 2]"),
        seal(b"{"),
        seal(b'{"format":"reachmap.journal","format_version":"9.0"}'),
        seal(b'{"format":"reachmap.journal","format_version":"2.0","units":0}'),
        seal(b'{"format":"reachmap.journal","format_version":"2.0","units":1e99}'),
        seal(
            b'{"format":"reachmap.journal","format_version":"2.0","units":3,'
            b'"shard":[2,1]}'
        ),
        seal(
            b'{"format":"reachmap.journal","format_version":"2.0","units":3,'
            b'"shard":[1,1]}'
        ),
        seal(b'{"format":"reachmap.journal","x":' + b"[" * 60 + b"]" * 60 + b"}"),
        seal(b"[" * 100_000),
        seal(
            b'{"format":"reachmap.journal","format_version":"2.0","units":3,'
            b'"shard":[1,1],"settings":{"x":1e999},"document":{}}'
        ),
    ],
)
def test_what_is_not_a_journal_is_refused_and_left_alone(path, text):
    """Another file of that name is neither read as a journal nor written to."""
    path.write_bytes(text)
    with (
        pytest.raises(MapFileError, match="--restart discards it"),
        open_store(path, header()),
    ):
        pass
    assert path.read_bytes() == text
    with (
        pytest.raises(MapFileError, match="cannot be used as a journal"),
        read_store(path),
    ):
        pass


def test_a_second_run_is_refused_while_the_first_writes(path):
    """The lock holds for the whole run and not longer."""
    with (
        open_store(path, header()),
        pytest.raises(OutputError, match="another run"),
        open_store(path, header()),
    ):
        pass
    with open_store(path, header()):
        pass


def test_a_journal_removed_while_waiting_for_its_lock_is_made_again(path, monkeypatch):
    """The lock of a file that was just unlinked by its owner is worth nothing."""
    fill(path, [0])
    lock = store_module._lock
    removed: list[Path] = []

    def lock_late(where, descriptor):
        if not removed:
            removed.append(where)
            where.unlink()
        lock(where, descriptor)

    monkeypatch.setattr(store_module, "_lock", lock_late)
    with open_store(path, header()) as journal:
        assert not journal.results()
        put(journal, 1)
    assert list(contents(path)) == [1]


def test_a_file_system_without_locks_is_warned_about(path, monkeypatch, caplog):
    """No lock is better than no scan, but it is said."""

    def no_locks(descriptor, how):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    fill(path, [0])
    assert "no locks" in caplog.text


@pytest.mark.parametrize("place", ["missing/out.journal", "file/out.journal", "."])
def test_a_place_that_cannot_be_written_is_an_output_error(tmp_path, place):
    """A folder that does not exist is named instead of traced."""
    (tmp_path / "file").touch()
    with (
        pytest.raises(OutputError, match=r"No such file|Not a directory|not a regular"),
        open_store(tmp_path / place, header()),
    ):
        pass


def test_no_room_for_a_line_leaves_the_journal_whole(path, monkeypatch):
    """Half a line on a full disk is taken back; the message counts what is safe."""
    real, room = os.pwrite, 800

    def small_disk(descriptor, data, offset):
        if offset >= room:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(descriptor, data[: room - offset], offset)

    fill(path, [])
    monkeypatch.setattr(os, "pwrite", small_disk)
    with pytest.raises(IncompleteError, match=r"No space left.*are safe.*free some"):
        fill(path, range(20))
    monkeypatch.undo()
    kept = contents(path)
    assert 0 < len(kept) < 20
    assert path.read_bytes().endswith(b"\n")
    fill(path, range(len(kept), 20))
    assert contents(path) == {unit: {"value": unit * unit} for unit in range(20)}


def test_no_room_for_the_header_is_an_output_error(path, monkeypatch):
    """Nothing was begun, so there is nothing to resume."""

    def full(descriptor, data, offset):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    with (
        pytest.raises(OutputError, match="No space left"),
        open_store(path, header()),
    ):
        pass
    assert path.read_bytes() == b""


def test_payloads_that_do_not_fit_a_line_are_refused(path, monkeypatch):
    """A line is bounded, so that reading it is."""
    monkeypatch.setattr(store_module, "MAX_LINE", 500)
    with (
        pytest.raises(ValueError, match="too large for a line"),
        open_store(path, header()) as journal,
    ):
        put(journal, 0, '"' + "x" * 1000 + '"')
    assert contents(path) == {}


def test_a_journal_can_be_looked_into_while_it_is_written(path):
    """Reading needs no lock and sees whole lines only."""
    with open_store(path, header()) as journal:
        put(journal, 4)
        assert contents(path) == {4: {"value": 16}}


def test_a_payload_changed_after_opening_is_noticed(path):
    """Payloads are checked again when they are read."""
    fill(path, [1])
    with read_store(path) as entries:
        path.write_bytes(path.read_bytes().replace(b'"value":1', b'"value":7'))
        with pytest.raises(MapFileError, match="damaged while it was in use"):
            entries.payload(1)


def test_names_of_journals():
    """Beside the artefact, one per shard."""
    from pathlib import Path

    assert store_path(Path("a/bin.h5")) == Path("a/bin.h5.journal")
    assert store_path(Path("a/bin.h5"), (2, 30)) == Path("a/bin.shard-2-of-30.journal")
