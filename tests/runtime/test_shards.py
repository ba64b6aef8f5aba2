from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from reachmap.cli import group as reachmap
from reachmap.errors import (
    IncompleteError,
    MapFileError,
    OutputError,
    SceneError,
    SettingsError,
)
from reachmap.runtime.job import KINDS
from reachmap.runtime.merge import merge_journals
from reachmap.runtime.options import RunOptions
from reachmap.runtime.run import run_scan
from reachmap.runtime.store import store_path
from tests.support import toy_work
from tests.support.toy_work import Toy, expected


@pytest.fixture
def output(tmp_path):
    """Where the artefact goes."""
    return tmp_path / "out.json"


def shard(output, index, count, toy=None, **settings):
    """Run one shard; returns its journal."""
    options = RunOptions(shard=(index, count), **settings)
    outcome = run_scan(
        toy_work.toy_work(toy), output=output, options=options, label="toy"
    )
    assert outcome.artefact is None
    assert not output.exists()
    return outcome.path


def test_merged_shards_are_a_single_run(output):
    """Three shards, merged in any order, give the artefact of one run, bit for bit."""
    journals = [shard(output, index, 3) for index in (3, 1, 2)]
    outcome = merge_journals(journals, output=output)
    assert json.loads(output.read_text()) == expected()
    assert (outcome.resumed, outcome.run.workers) == (40, 3)
    assert all(journal.exists() for journal in journals)


def test_shards_of_different_sizes_go_together(output):
    """What counts is that every unit is there once: 1/2 and 2/4 and 4/4 will do."""
    journals = [shard(output, *which) for which in ((1, 2), (2, 4), (4, 4))]
    merge_journals(journals, output=output)
    assert json.loads(output.read_text()) == expected()


def test_more_shards_than_units(output):
    """A shard may be empty."""
    toy = Toy(units=2)
    journals = [shard(output, index, 4, toy) for index in (1, 2, 3, 4)]
    merge_journals(journals, output=output)
    assert json.loads(output.read_text()) == expected(units=2)


def test_a_whole_journal_merges_alone(output):
    """The journal of an ordinary run is a shard 1/1."""
    with pytest.raises(SceneError, match="unit 39"):
        run_scan(
            toy_work.toy_work(wrong=(39,)),
            output=output,
            options=RunOptions(),
            label="",
        )
    with pytest.raises(IncompleteError, match=r"1 of 40 units are missing \(39\)"):
        merge_journals([store_path(output)], output=output)


def test_a_shard_resumes_like_any_run(output):
    """An interrupted shard goes on, and its own number is part of its identity."""
    with pytest.raises(SceneError, match="unit 21"):
        shard(output, 2, 4, Toy(wrong=(21,)))
    journal = shard(output, 2, 4)
    other = store_path(output, (3, 4))
    journal.rename(other)
    with pytest.raises(MapFileError, match=r"shard \(2, 4\) → \(3, 4\)"):
        shard(output, 3, 4)


def test_a_missing_shard_is_named(output):
    """The message says which shards to run, and nothing is written."""
    journals = [shard(output, index, 4) for index in (1, 3)]
    with pytest.raises(
        IncompleteError, match=r"20 of 40 units are missing \(1, 3, .*--shard 2/4, 4/4"
    ):
        merge_journals(journals, output=output)
    assert not output.exists()


def test_units_that_are_there_twice_are_refused(output):
    """Which of two measurements counts is not for the program to choose."""
    journals = [shard(output, *which) for which in ((1, 2), (2, 2), (1, 4))]
    with pytest.raises(MapFileError, match=r"both hold units 0, 4, 8.*leave one"):
        merge_journals(journals, output=output)
    with pytest.raises(SettingsError, match="named twice"):
        merge_journals(journals[:2] + journals[:1], output=output)


def test_shards_of_another_scan_are_refused(output, tmp_path):
    """A different seed in one shard is found and named."""
    first = shard(output, 1, 2)
    second = shard(tmp_path / "other.json", 2, 2, Toy(seed=5))
    with pytest.raises(MapFileError, match=r"does not belong with .*seed 1 → 5"):
        merge_journals([first, second], output=output)


def test_failed_units_are_published_as_errors(output):
    """A merge finishes with what there is, and says what is wrong with it."""
    with pytest.raises(IncompleteError, match="1 of 40 units failed"):
        shard(output, 1, 2, Toy(buggy=(4,)))
    journals = [store_path(output, (1, 2)), shard(output, 2, 2)]
    with pytest.raises(IncompleteError, match="unit 4: ZeroDivisionError"):
        merge_journals(journals, output=output)
    assert json.loads(output.read_text()) == expected(failed=(4,))


def test_an_existing_artefact_is_kept(output):
    """Merging does not replace anything unasked."""
    journals = [shard(output, index, 2) for index in (1, 2)]
    output.write_text("precious")
    with pytest.raises(OutputError, match="exists"):
        merge_journals(journals, output=output)
    assert output.read_text() == "precious"
    merge_journals(journals, output=output, overwrite=True)
    assert json.loads(output.read_text()) == expected()


def test_no_journals_and_no_journal(output, tmp_path):
    """Nothing to merge, a missing file and another file are clean errors."""
    with pytest.raises(SettingsError, match="nothing to merge"):
        merge_journals([], output=output)
    with pytest.raises(MapFileError, match="No such file"):
        merge_journals([tmp_path / "none.journal"], output=output)
    (tmp_path / "text").write_text("hello\n")
    with pytest.raises(MapFileError, match="cannot be used as a journal"):
        merge_journals([tmp_path / "text"], output=output)


def test_a_kind_this_version_does_not_know(output, monkeypatch):
    """A journal from a newer program is refused with the kinds there are."""
    journal = shard(output, 1, 1)
    monkeypatch.delitem(KINDS, "toy")
    with pytest.raises(
        MapFileError, match=r"kind 'toy'; known: workspace_map, bin_map"
    ):
        merge_journals([journal], output=output)


def test_the_merge_command(output, monkeypatch):
    """`reachmap merge` joins shards, answers on stdout and keeps its exit codes."""
    output = output.with_suffix("")  # the toy writes JSON, real artefacts are HDF5
    journals = [str(shard(output, index, 3)) for index in (1, 2, 3)]
    runner = CliRunner()
    result = runner.invoke(reachmap, ["merge", *journals[:2], "-o", str(output)])
    assert (result.exit_code, result.stdout) == (3, "")
    assert "run --shard 3/3, then merge again" in result.stderr
    result = runner.invoke(reachmap, ["merge", *journals, "-o", str(output)])
    assert result.exit_code == 0, result.stderr
    assert result.stdout == f"{output}: 40 units of 3 shards\n"
    result = runner.invoke(reachmap, ["merge", *journals, "-o", str(output)])
    assert result.exit_code == 2
    again = ["merge", *journals, "-o", str(output), "--overwrite", "--json"]
    result = runner.invoke(reachmap, again)
    assert json.loads(result.stdout) == {
        "output": str(output),
        "shards": 3,
        "units": 40,
    }
    assert json.loads(output.read_text()) == expected()
