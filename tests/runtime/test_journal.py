from __future__ import annotations

import errno
import json
import os

import pytest

from reachmap.errors import IncompleteError, MapFileError, OutputError
from reachmap.runtime.journal import journal as journal_module
from reachmap.runtime.journal import journal as lock_module
from reachmap.runtime.journal.entries import Entries, read_journal
from reachmap.runtime.journal.format import Header, Measure, seal
from reachmap.runtime.journal.journal import Journal, journal_path, open_journal

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
    with open_journal(path, head or header()) as journal:
        for unit in units:
            journal.append(unit, payload(unit), measure=Measure(ok=unit, frames=27))


def payload(unit):
    """Compact JSON of a unit."""
    return json.dumps({"value": unit * unit}, separators=(",", ":"))


def contents(path):
    """Payload of each unit with a result."""
    with read_journal(path) as entries:
        return {unit: entries.payload(unit) for unit in entries.results}


def test_what_was_written_is_read(path):
    """Units, payloads, tallies and header come back."""
    fill(path, [3, 0, 7])
    assert contents(path) == {3: {"value": 9}, 0: {"value": 0}, 7: {"value": 49}}
    with read_journal(path) as entries:
        assert entries.header == header()
        assert entries.results[7].measure == Measure(ok=7, frames=27)


def test_a_second_run_goes_on_where_the_first_ended(path):
    """Opening again keeps the units and appends behind them."""
    fill(path, [0, 1])
    fill(path, [2])
    assert sorted(contents(path)) == [0, 1, 2]


def test_every_cut_leaves_the_units_before_it(path):
    """A file cut at any byte resumes with all lines that were complete."""
    fill(path, range(3))
    whole = path.read_bytes()
    ends = [k + 1 for k, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(len(whole) + 1):
        path.write_bytes(whole[:cut])
        with open_journal(path, header()) as journal:
            complete = sum(cut >= end for end in ends[1:])
            assert sorted(journal.entries.results) == list(range(complete))
            journal.append(9, payload(9))
        assert contents(path)[9] == {"value": 81}


def test_a_damaged_line_costs_its_own_unit_only(path, caplog):
    """A flipped bit loses one unit, says so, and what follows is kept."""
    fill(path, range(5))
    lines = path.read_bytes().splitlines(keepends=True)
    lines[3] = lines[3].replace(b'"value":4', b'"value":5')
    path.write_bytes(b"".join(lines))
    with open_journal(path, header()) as journal:
        assert sorted(journal.entries.results) == [0, 1, 3, 4]
        assert journal.entries.damaged == 1
    assert "1 damaged lines" in caplog.text


def test_lines_of_another_journal_are_damage(path, tmp_path):
    """A valid line under another header does not count: its settings were others."""
    other = tmp_path / "other.journal"
    fill(other, [5], header(seed=2))
    fill(path, [0])
    stray = other.read_bytes().splitlines(keepends=True)[1]
    path.write_bytes(path.read_bytes() + stray)
    with read_journal(path) as entries:
        assert (sorted(entries.results), entries.damaged) == ([0], 1)


def test_units_outside_the_work_are_damage(path):
    """A line for a unit that does not exist, or is another shard's, is passed over."""
    head = header(units=4, shard=(1, 2))
    with open_journal(path, head) as journal:
        for unit in (0, 1, 2, 99):
            journal.append(unit, payload(unit))
    with read_journal(path) as entries:
        assert (sorted(entries.results), entries.damaged) == ([0, 2], 2)


def test_first_result_wins_and_a_result_beats_an_error(path):
    """Repeated units have one meaning, whatever their order."""
    with open_journal(path, header()) as journal:
        journal.append(1, '"broke"', failed=True)
        journal.append(1, '{"value":1}')
        journal.append(1, '{"value":2}')
        journal.append(1, '"broke again"', failed=True)
        journal.append(2, '"first"', failed=True)
        journal.append(2, '"second"', failed=True)
        live = dict(journal.entries.results), dict(journal.entries.failed)
    with read_journal(path) as entries:
        assert (dict(entries.results), dict(entries.failed)) == live
        assert entries.payload(1) == {"value": 1}
        assert entries.error(2) == "first"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seed": 2}, "seed 1 → 2"),
        ({"cell": {"bin": {"xyz": [0.5, 0.1, -0.2]}}}, "cell.bin.xyz[1] 0.0 → 0.1"),
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
        open_journal(path, header(**change)),
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
    with open_journal(path, moved) as journal:
        assert list(journal.entries.results) == [0]
        assert journal.entries.header.document == {"title": "a toy"}


def test_restart_discards(path):
    """With restart nothing of the old journal is left, also if it cannot be read."""
    for junk in (None, b"not a journal\n" * 50):
        fill(path, [0]) if junk is None else path.write_bytes(junk)
        with open_journal(path, header(seed=2), restart=True) as journal:
            assert not journal.entries.results
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
        seal(b'{"format":"reachmap.journal","format_version":"1.0","units":0}'),
        seal(b'{"format":"reachmap.journal","format_version":"1.0","units":1e99}'),
        seal(
            b'{"format":"reachmap.journal","format_version":"1.0","units":3,'
            b'"shard":[2,1]}'
        ),
        seal(
            b'{"format":"reachmap.journal","format_version":"1.0","units":3,'
            b'"shard":[1,1]}'
        ),
        seal(b'{"format":"reachmap.journal","x":' + b"[" * 60 + b"]" * 60 + b"}"),
        seal(b"[" * 100_000),
        seal(
            b'{"format":"reachmap.journal","format_version":"1.0","units":3,'
            b'"shard":[1,1],"settings":{"x":1e999},"document":{}}'
        ),
    ],
)
def test_what_is_not_a_journal_is_refused_and_left_alone(path, text):
    """Another file of that name is neither read as a journal nor written to."""
    path.write_bytes(text)
    with (
        pytest.raises(MapFileError, match="--restart discards it"),
        open_journal(path, header()),
    ):
        pass
    assert path.read_bytes() == text
    with (
        pytest.raises(MapFileError, match="cannot be used as a journal"),
        read_journal(path),
    ):
        pass


def test_a_second_run_is_refused_while_the_first_writes(path):
    """The lock holds for the whole run and not longer."""
    with (
        open_journal(path, header()),
        pytest.raises(OutputError, match="another run"),
        open_journal(path, header()),
    ):
        pass
    with open_journal(path, header()):
        pass


def test_a_journal_removed_while_waiting_for_its_lock_is_made_anew(path, monkeypatch):
    """The lock of a file that was just unlinked by its owner is worth nothing."""
    fill(path, [0])
    lock, removed = lock_module._lock, []

    def lock_late(where, descriptor):
        if not removed:
            removed.append(where)
            where.unlink()
        lock(where, descriptor)

    monkeypatch.setattr(lock_module, "_lock", lock_late)
    with open_journal(path, header()) as journal:
        assert not journal.entries.results
        journal.append(1, payload(1))
    assert list(contents(path)) == [1]


def test_a_file_system_without_locks_is_warned_about(path, monkeypatch, caplog):
    """No lock is better than no scan, but it is said."""

    def no_locks(descriptor, how):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock_module.fcntl, "flock", no_locks)
    fill(path, [0])
    assert "no locks" in caplog.text


@pytest.mark.parametrize("place", ["missing/out.journal", "file/out.journal", "."])
def test_a_place_that_cannot_be_written_is_an_output_error(tmp_path, place):
    """A folder that does not exist is named instead of traced."""
    (tmp_path / "file").touch()
    with (
        pytest.raises(
            OutputError, match=r"No such file|Not a directory|Is a directory"
        ),
        open_journal(tmp_path / place, header()),
    ):
        pass


def test_no_room_for_a_line_leaves_the_journal_whole(path, monkeypatch):
    """Half a line on a full disk is taken back; the message counts what is safe."""
    real, room = os.pwrite, 400

    def small_disk(descriptor, data, offset):
        if offset >= room:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(descriptor, data[: room - offset], offset)

    fill(path, [])
    monkeypatch.setattr(journal_module.os, "pwrite", small_disk)
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

    monkeypatch.setattr(journal_module.os, "pwrite", full)
    with (
        pytest.raises(OutputError, match="No space left"),
        open_journal(path, header()),
    ):
        pass
    assert path.read_bytes() == b""


def test_lines_reach_the_disk_within_the_interval(path, monkeypatch):
    """A line is synced once a second at most, and at the end without fail."""
    now, synced = [0.0], []
    fill(path, [])
    monkeypatch.setattr(journal_module.os, "fsync", lambda fd: synced.append(now[0]))
    descriptor = os.open(path, os.O_RDWR)
    journal = Journal(path, descriptor, Entries(path, descriptor), clock=lambda: now[0])
    for unit in range(20):
        now[0] = 0.125 * unit
        journal.append(unit, payload(unit))
    assert synced == [1.0, 2.0]
    now[0] = 2.9
    journal.sync_if_due()
    now[0] = 3.0
    journal.sync_if_due()
    now[0] = 9.0
    journal.sync_if_due()
    assert synced == [1.0, 2.0, 3.0]
    os.close(descriptor)


def test_payloads_that_do_not_fit_a_line_are_refused(path, monkeypatch):
    """A line is bounded, so that reading it is."""
    monkeypatch.setattr(journal_module, "MAX_LINE", 500)
    with (
        pytest.raises(ValueError, match="no journal line can hold"),
        open_journal(path, header()) as journal,
    ):
        journal.append(0, '"' + "x" * 1000 + '"')
    assert contents(path) == {}


def test_a_journal_can_be_looked_into_while_it_is_written(path):
    """Reading needs no lock and sees whole lines only."""
    with open_journal(path, header()) as journal:
        journal.append(4, payload(4))
        assert contents(path) == {4: {"value": 16}}


def test_a_payload_changed_after_opening_is_noticed(path):
    """Payloads are checked again when they are read."""
    fill(path, [1])
    with read_journal(path) as entries:
        path.write_bytes(path.read_bytes().replace(b'"value":1', b'"value":7'))
        with pytest.raises(MapFileError, match="damaged while it was in use"):
            entries.payload(1)


def test_names_of_journals():
    """Beside the artefact, one per shard."""
    from pathlib import Path

    assert journal_path(Path("a/bin.h5")) == Path("a/bin.h5.journal")
    assert journal_path(Path("a/bin.h5"), (2, 30)) == Path(
        "a/bin.shard-2-of-30.journal"
    )
