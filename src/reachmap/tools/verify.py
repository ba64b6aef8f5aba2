"""``verify``: whether files are intact and follow their format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reachmap.disk import one_or_more
from reachmap.errors import MapFileError
from reachmap.maps.format.registry import load_any
from reachmap.maps.format.store import is_sealed
from reachmap.runtime.journal import is_store, read_store
from reachmap.text import plural


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What verifying one file found.

    Attributes
    ----------
    path : Path
    kind : str
        As in ``"bin map"``; "" where it could not be determined.
    facts : mapping
        What was counted and recomputed, as JSON values.
    problems : tuple of str
        What is wrong, the file named in each; none if it is whole.
    """

    path: Path
    kind: str
    facts: dict[str, Any]
    problems: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """One line about a whole file."""
        said = ", ".join(
            f"{key.replace('_', ' ')} {value}" for key, value in self.facts.items()
        )
        return f"{self.path}: {self.kind}, whole; {said}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Verdicts on several files."""

    verdicts: tuple[Verdict, ...]

    @property
    def whole(self) -> tuple[Verdict, ...]:
        """Verdicts on files with nothing wrong."""
        return tuple(item for item in self.verdicts if not item.problems)

    def facts(self) -> dict[str, Any]:
        """Everything as JSON values."""
        files = [
            {
                "file": str(item.path),
                "kind": item.kind,
                "whole": not item.problems,
                **item.facts,
                "problems": list(item.problems),
            }
            for item in self.verdicts
        ]
        return {"whole": len(self.whole) == len(files), "files": files}

    def require_whole(self) -> None:
        """Raise MapFileError with every problem of every file, if there are any."""
        problems = [text for item in self.verdicts for text in item.problems]
        if problems:
            raise MapFileError(problems)


def verify(paths: Sequence[str | Path]) -> Verification:
    """Check files for damage, and against the format of their kind.

    Every byte is read, so that the checksums of HDF5 are compared; the hashes over
    content and file are recomputed; names, dimensions, types, units and ranges are
    compared with the format; percentages are recomputed from the status.

    Parameters
    ----------
    paths : sequence of Path
        Artefacts, or journals of unfinished runs.
    """
    verdicts = [_verdict(Path(path)) for path in one_or_more(paths)]
    return Verification(verdicts=tuple(verdicts))


def _verdict(path: Path) -> Verdict:
    try:
        return _journal(path) if is_store(path) else _artefact(path)
    except MapFileError as error:
        return Verdict(path=path, kind="", facts={}, problems=error.lines)


def _artefact(path: Path) -> Verdict:
    tree, layout = load_any(path)
    facts = {
        "format": str(tree.attributes["format_version"]),
        "variables": sum(1 for _ in tree.arrays()),
        "content_sha256": str(tree.attributes["content_sha256"]),
        "sealed": "yes" if is_sealed(path) else "no",
    }
    return Verdict(path=path, kind=layout.name, facts=facts)


def _journal(path: Path) -> Verdict:
    with read_store(path) as entries:
        own = len(entries.header.own_units())
        facts = {
            "units": own,
            "done": len(entries.results()),
            "failed": len(entries.failed()),
            "torn_bytes": path.stat().st_size - entries.end,
        }
        kind = f"journal of a {entries.header.kind.replace('_', ' ')}"
        problems = []
        if entries.damaged:
            lines = plural(entries.damaged, "damaged line")
            problems.append(f"{path}: {lines}; a resumed run does that work again")
    return Verdict(path=path, kind=kind, facts=facts, problems=tuple(problems))
