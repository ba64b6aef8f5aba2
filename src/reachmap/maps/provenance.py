"""Provenance of an artefact, and the record of its run."""

from __future__ import annotations

import contextlib
import json
import shlex
import socket
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from functools import lru_cache
from importlib import metadata
from typing import TYPE_CHECKING, Any

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

MAX_DEPTH = 32


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


def provenance_texts(provenance: Provenance) -> dict[str, str]:
    """Write a record as the texts of ``/provenance``."""
    return {
        "cell_yaml": provenance.cell_yaml,
        "cell_resolved_json": provenance.cell_resolved_json,
        "overrides_json": _json_text(provenance.overrides),
        "urdf": provenance.urdf,
        "srdf": provenance.srdf,
        "files_sha256_json": _json_text(provenance.files_sha256),
        "packages_json": _json_text(provenance.packages),
        "settings_json": _json_text(provenance.settings),
        "source_sha256": provenance.source_sha256,
    }


def provenance_from_texts(texts: Mapping[str, str], where: str) -> Provenance:
    """Parse the texts of ``/provenance``; MapFileError if they are not."""
    return Provenance(
        cell_yaml=texts.get("cell_yaml", ""),
        cell_resolved_json=texts.get("cell_resolved_json", ""),
        overrides=_texts(_json(texts, "overrides_json", where, list), where),
        urdf=texts.get("urdf", ""),
        srdf=texts.get("srdf", ""),
        files_sha256=_json(texts, "files_sha256_json", where, dict),
        packages=_json(texts, "packages_json", where, dict),
        settings=_json(texts, "settings_json", where, dict),
        source_sha256=texts.get("source_sha256", ""),
    )


def run_texts(run: RunInfo) -> dict[str, str]:
    """Write a record as the texts of ``/run``."""
    return {
        "started": run.started,
        "finished": run.finished,
        "host": run.host,
        "command_line": run.command_line,
        "workers": str(run.workers),
        "wall_s_json": _json_text(run.wall_s),
        "cpu_s_json": _json_text(run.cpu_s),
    }


def run_from_texts(texts: Mapping[str, str], where: str) -> RunInfo:
    """Parse the texts of ``/run``; MapFileError if they are not."""
    workers = texts.get("workers", "1")
    if not (workers.isdecimal() and len(workers) < 10):
        raise MapFileError(f"{where}: run/workers is not a number (got {workers!r})")
    return RunInfo(
        started=texts.get("started", ""),
        finished=texts.get("finished", ""),
        host=texts.get("host", ""),
        command_line=texts.get("command_line", ""),
        workers=int(workers),
        wall_s=_json(texts, "wall_s_json", where, dict),
        cpu_s=_json(texts, "cpu_s_json", where, dict),
    )


def _texts(values: list[Any], where: str) -> tuple[str, ...]:
    if not all(isinstance(value, str) for value in values):
        raise MapFileError(f"{where}: overrides_json is not a list of texts")
    return tuple(values)


def _json_text(value: Any) -> str:
    """Write JSON that keeps the order of keys, as phases of a run have one."""
    return json.dumps(plain(value), ensure_ascii=False)


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
