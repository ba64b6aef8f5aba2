"""The payloads of a run, read from its stores as they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from reachmap.errors import IncompleteError
from reachmap.maps.records import RunInfo, Status
from reachmap.runtime.encoding import Json
from reachmap.runtime.job import Kind, kind_named
from reachmap.runtime.journal import Entries, read_store

# A choice: one message, not a page.
SHOWN_FAILURES = 5
SHOWN_UNITS = 6


class Results(Sequence[Any]):
    """Payloads in unit order, whatever order and store they were recorded in.

    A unit that failed has the payload ``kind.blank(…, Status.ERROR)``, one that was
    not done yet ``kind.blank(…, Status.NOT_ATTEMPTED)``.

    Parameters
    ----------
    kind : Kind
    stores : sequence of Entries
        At least one; all of the same work.

    Attributes
    ----------
    document : mapping
        What finishing the artefact needs besides the payloads.
    failed : mapping
        Unit to the text of its error.
    missing : tuple of int
        Units that are not done.
    done : int
        Number of units that have a result.
    cpu_s : float
        CPU time of all units together, over all resumes and shards [s].
    """

    def __init__(self, kind: Kind, stores: Sequence[Entries]) -> None:
        header = stores[0].header
        self._kind = kind
        self._units = header.units
        results = [(entries, entries.results()) for entries in stores]
        self._home = {unit: entries for entries, units in results for unit in units}
        self.document: Mapping[str, Json] = header.document
        self.failed: Mapping[int, str] = {
            unit: text
            for entries in stores
            for unit, text in entries.failed().items()
            if unit not in self._home
        }
        self.missing: tuple[int, ...] = tuple(
            unit
            for unit in range(self._units)
            if unit not in self._home and unit not in self.failed
        )
        self.done = len(self._home)
        self.cpu_s: float = sum(
            measure.cpu_s for _, units in results for measure in units.values()
        )

    def __len__(self) -> int:
        return self._units

    def __iter__(self) -> Iterator[Any]:
        return (self[unit] for unit in range(self._units))

    def __getitem__(self, unit: Any) -> Any:
        if isinstance(unit, slice):
            return [self[index] for index in range(*unit.indices(self._units))]
        if not 0 <= unit < self._units:
            raise IndexError(f"unit {unit} of {self._units}")
        entries = self._home.get(unit)
        if entries is None:
            status = Status.ERROR if unit in self.failed else Status.NOT_ATTEMPTED
            return self._kind.blank(self.document, unit, status)
        return entries.payload(unit)

    def check_failures(self, output: Path) -> None:
        """Raise IncompleteError when units have failed; the others are published."""
        if not self.failed:
            return
        shown = [
            f"unit {unit}: {last_line(text)}"
            for unit, text in sorted(self.failed.items())[:SHOWN_FAILURES]
        ]
        if len(self.failed) > len(shown):
            shown.append(f"and {len(self.failed) - len(shown)} more")
        raise IncompleteError(
            [
                f"{output} is written, but {len(self.failed)} of {len(self)} units "
                "failed and are marked as error; the same command tries them again",
                *shown,
            ]
        )


def preview(path: Path) -> Any:
    """Artefact of what a store holds so far, its other frames not attempted.

    Parameters
    ----------
    path : Path
        A store, also one that is being written.

    Returns
    -------
    artefact
        What the kind of the store assembles, a ``BinMap`` say.
    """
    with read_store(path) as entries:
        kind = kind_named(entries.header.kind, source=path)
        results = Results(kind, [entries])
        return kind.assemble(results.document, results, run=RunInfo())


def last_line(text: str) -> str:
    """Return the last line of a text: of a traceback, what was raised."""
    return (text.strip().splitlines() or ["no message"])[-1]


def units_text(units: Sequence[int]) -> str:
    """Name some units: ``3, 4, 9, … (93 units)``."""
    shown = ", ".join(str(unit) for unit in units[:SHOWN_UNITS])
    return shown if len(units) <= SHOWN_UNITS else f"{shown}, … ({len(units)} units)"
