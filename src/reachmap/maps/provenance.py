"""Provenance of an artefact, and the record of its run."""

from __future__ import annotations

import contextlib
import json
import shlex
import socket
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from datetime import datetime
from functools import lru_cache
from importlib import metadata
from typing import TYPE_CHECKING, Any, Final

from reachmap.disk import recorded_name
from reachmap.errors import MapFileError
from reachmap.maps.bytes.to_json import plain
from reachmap.maps.records import Provenance, RunInfo

if TYPE_CHECKING:
    from reachmap.cell.loaded import LoadedCell

PACKAGES = (
    "reachmap-cells", "numpy", "scipy", "pin", "coal", "ompl", "eaik",
    "example-robot-data", "h5py", "pydantic", "ruamel.yaml",
)  # fmt: skip
"""Distributions whose versions are recorded."""

# A choice against hostile input: no settings are nested nearly as deep.
MAX_DEPTH = 32
_JSON: Final[Mapping[str, type]] = {
    "overrides": list,
    **dict.fromkeys(("files_sha256", "packages", "settings", "wall_s", "cpu_s"), dict),
}
"""Fields that are stored as JSON texts, and what they are."""


def package_versions(names: Sequence[str] = PACKAGES) -> dict[str, str]:
    """Versions of the distributions that are installed, and of Python."""
    versions = {"python": sys.version.split()[0]}
    for name in names:
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[name] = _version(name)
    return versions


# Looked up in files, which takes longer than the rest of a map's provenance.
_version = lru_cache(maxsize=None)(metadata.version)


def collect_provenance(
    loaded: LoadedCell, *, settings: Mapping[str, Any], source_sha256: str = ""
) -> Provenance:
    """Collect the provenance of an artefact, as stored.

    Parameters
    ----------
    loaded : LoadedCell
    settings : mapping
        Method, planner, checking and simplification, as JSON values.
    source_sha256 : str
        ``content_sha256`` of the artefact that this one is made from.
    """
    return Provenance(
        cell_yaml=loaded.text,
        cell_resolved_json=loaded.resolved_json,
        overrides=tuple(loaded.overrides),
        urdf=loaded.urdf,
        srdf=loaded.srdf,
        files_sha256=dict(loaded.files_sha256),
        packages=package_versions(),
        settings=dict(settings),
        source_sha256=source_sha256,
    )


class RunClock:
    """Records the times of a run, phase by phase.

    Examples
    --------
    >>> clock = RunClock(workers=2)
    >>> with clock.phase("plan"):
    ...     pass
    >>> clock.add_cpu("plan", 12.5)  # seconds that the workers report
    >>> clock.finish().workers
    2
    """

    def __init__(self, *, workers: int = 1, argv: Sequence[str] | None = None) -> None:
        self.workers = workers
        words = sys.argv if argv is None else argv
        self.command_line = recorded_name(shlex.join(words))
        self.started = _now()
        self.wall_s: dict[str, float] = {}
        self.cpu_s: dict[str, float] = {}

    @contextlib.contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time spent inside to a phase; CPU time is this process's."""
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            spent = time.perf_counter() - wall
            self.wall_s[name] = self.wall_s.get(name, 0.0) + spent
            self.add_cpu(name, time.process_time() - cpu)

    def add_cpu(self, name: str, seconds: float) -> None:
        """Add CPU time that workers spent on a phase [s]."""
        self.cpu_s[name] = self.cpu_s.get(name, 0.0) + seconds

    def finish(self) -> RunInfo:
        """End the run now and return its record."""
        return RunInfo(
            started=self.started,
            finished=_now(),
            host=recorded_name(socket.gethostname()),
            command_line=self.command_line,
            workers=self.workers,
            wall_s=dict(self.wall_s),
            cpu_s=dict(self.cpu_s),
        )


def _now() -> str:
    return datetime.now().astimezone().isoformat(timespec="seconds")


def record_texts(record: Provenance | RunInfo) -> dict[str, str]:
    """Write a record as the texts of ``/provenance`` or ``/run``."""
    values = ((item.name, getattr(record, item.name)) for item in fields(record))
    return {
        f"{name}_json" if name in _JSON else name: (
            # In the order of the keys, as phases of a run have one.
            json.dumps(plain(value), ensure_ascii=False)
            if name in _JSON
            else str(value)
        )
        for name, value in values
    }


def provenance_from_texts(texts: Mapping[str, str], where: str) -> Provenance:
    """Parse the texts of ``/provenance``; MapFileError if they are not."""
    values = _values(Provenance, texts, where)
    return Provenance(**{**values, "overrides": _texts(values["overrides"], where)})


def run_from_texts(texts: Mapping[str, str], where: str) -> RunInfo:
    """Parse the texts of ``/run``; MapFileError if they are not."""
    values = _values(RunInfo, texts, where)
    workers = values["workers"] or "1"
    if not (workers.isdecimal() and len(workers) < 10):
        raise MapFileError(f"{where}: run/workers is not a number (got {workers!r})")
    return RunInfo(**{**values, "workers": int(workers)})


def _values(
    kind: type[Provenance | RunInfo], texts: Mapping[str, str], where: str
) -> dict[str, Any]:
    return {
        item.name: _json(texts, f"{item.name}_json", where, _JSON[item.name])
        if item.name in _JSON
        else texts.get(item.name, "")
        for item in fields(kind)
    }


def _texts(values: list[Any], where: str) -> tuple[str, ...]:
    if not all(isinstance(value, str) for value in values):
        raise MapFileError(f"{where}: overrides_json is not a list of texts")
    return tuple(values)


def _json(texts: Mapping[str, str], name: str, where: str, kind: type) -> Any:
    text = texts.get(name, "")
    try:
        value = json.loads(text) if text else kind()
    except (ValueError, RecursionError) as error:
        raise MapFileError(f"{where}: {name} is not JSON") from error
    if not isinstance(value, kind) or not _is_shallow(value):
        raise MapFileError(f"{where}: {name} is not a JSON {kind.__name__} as expected")
    return value


def _is_shallow(value: Any, levels: int = MAX_DEPTH) -> bool:
    """Whether a JSON value is nested no deeper than settings ever are."""
    if isinstance(value, dict):
        value = list(value.values())
    if not isinstance(value, list):
        return True
    return levels > 0 and all(_is_shallow(item, levels - 1) for item in value)


def cell_of_artefact(
    provenance: Provenance, source: str, changes: Sequence[str] = ()
) -> LoadedCell:
    """Load the cell that an artefact was made from.

    Parameters
    ----------
    provenance : Provenance
    source : str
        The artefact, for messages.
    changes : sequence of str
        Overrides to be made now.
    """
    # Imported here: what looks things up in a map needs no cell.
    from reachmap.cell.loading import cell_from_json

    return cell_from_json(
        provenance.cell_resolved_json,
        urdf=provenance.urdf,
        srdf=provenance.srdf,
        text=provenance.cell_yaml,
        overrides=provenance.overrides,
        changes=changes,
        files_sha256=provenance.files_sha256,
        source=source,
    )
