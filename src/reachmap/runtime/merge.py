"""Merging the journals of shards into the artefact of a single run."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from reachmap.errors import IncompleteError, MapFileError, SettingsError
from reachmap.maps import RunClock, check_output
from reachmap.runtime.job import kind_named
from reachmap.runtime.journal import Entries, differences, read_store
from reachmap.runtime.results import Results, units_text
from reachmap.runtime.run import Outcome


def merge_journals(
    paths: Sequence[Path], *, output: Path, overwrite: bool = False
) -> Outcome:
    """Finish a scan from journals that together hold all its units.

    Parameters
    ----------
    paths : sequence of Path
        Journals of shards, in any order; they are left as they are.
    output : Path
    overwrite : bool
        Replace ``output``.

    Raises
    ------
    OutputError
        When ``output`` exists.
    MapFileError
        When a journal is damaged, of another scan, or repeats units of another.
    IncompleteError
        When units are missing (nothing is written), or failed.
    """
    if not paths:
        raise SettingsError("nothing to merge: name the journals of the shards")
    check_output(output, overwrite=overwrite)
    clock = RunClock(workers=len(paths))
    with ExitStack() as stack:
        journals = {path: stack.enter_context(read_store(path)) for path in paths}
        if len(journals) < len(paths):
            raise SettingsError("a journal is named twice")
        check_together(journals)
        # In the order of the shards: that of the arguments does not matter.
        in_order = sorted(journals.values(), key=lambda one: one.header.shard)
        kind = kind_named(in_order[0].header.kind, source=paths[0])
        results = Results(kind, in_order)
        _check_complete(results, in_order)
        clock.add_cpu("units", results.cpu_s)
        run = clock.finish()
        artefact = kind.assemble(results.document, results, run=run)
        kind.write(output, artefact, overwrite=overwrite)
    results.check_failures(output)
    return Outcome(
        path=output, artefact=artefact, computed=0, resumed=results.done, run=run
    )


def check_together(journals: dict[Path, Entries]) -> None:
    """Refuse journals of different scans, and units that are in two of them.

    Raises
    ------
    MapFileError
    """
    (first_path, first), *others = journals.items()
    for path, entries in others:
        if changed := differences(first.header, entries.header):
            raise MapFileError(
                f"{path} does not belong with {first_path}: {', '.join(changed)}"
            )
    owner: dict[int, Path] = {}
    for path, entries in journals.items():
        if twice := sorted(owner.keys() & entries.results().keys()):
            raise MapFileError(
                f"{path} and {owner[twice[0]]} both hold units {units_text(twice)}: "
                "leave one of them out"
            )
        owner.update(dict.fromkeys(entries.results(), path))


def _check_complete(results: Results, journals: Sequence[Entries]) -> None:
    if not results.missing:
        return
    count = max(entries.header.shard[1] for entries in journals)
    shards = sorted({unit % count + 1 for unit in results.missing})
    names = ", ".join(f"{index}/{count}" for index in shards)
    raise IncompleteError(
        f"{len(results.missing)} of {len(results)} units are missing "
        f"({units_text(results.missing)}): run --shard {names}, then merge again"
    )
