"""The results in a run's folder: artefacts, ranked lists, a validation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from reachmap.disk import is_folder, is_there, real_path
from reachmap.errors import MapFileError, ReachmapError
from reachmap.maps import (
    artefact_kind,
    read_bin_map,
    read_placement,
    read_workspace_map,
)
from reachmap.maps.format.registry import Artefact
from reachmap.maps.records import BinMap, BinPlacement, WorkspaceMap
from reachmap.maps.study.format import read_study
from reachmap.maps.study.record import Study
from reachmap.ranking.lists.json_text import parse_json

# A choice against hostile input, far above what rank and validate write.
MAX_JSON_BYTES = 64 * 2**20

# Role -> kind, usual name, and the command that makes it.
ARTEFACTS = {
    "workspace": ("workspace_map", "workspace.h5", "reachmap workspace-scan"),
    "placement": ("bin_placement", "placement.h5", "reachmap place-bin"),
    "bin": ("bin_map", "bin.h5", "reachmap bin-scan"),
    "study": ("study", "study.h5", "reachmap study"),
}
OPTIONAL = frozenset({"study"})
"""Roles that a whole run does without."""
LISTS = {
    "ranked": ("ranked.json", "reachmap rank GRASPS -o ranked.json"),
    "validation": (
        "validation.json",
        "reachmap validate bin.h5 GRASPS -o validation.json",
    ),
}

Read = TypeVar("Read")


def usual_files(folder: Path) -> list[Path]:
    """Paths where results of a run are expected, existing or not."""
    names = [name for _, name, _ in ARTEFACTS.values()]
    return [folder / name for name in (*names, *(name for name, _ in LISTS.values()))]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFolder:
    """The results of a run that were found.

    Attributes
    ----------
    name : str
        Name of the folder.
    workspace, placement, bin_map, study : record or None
    ranked : tuple of mapping
        Ranked grasp lists.
    validation : mapping or None
    files : mapping of str to str
        Role ("workspace", "placement", "bin", "study", "ranked", "validation") to the
        name of the file it was read from.
    missing : mapping of str to str
        Usual name of what is not there, to the command that makes it.
    warnings : tuple of str
        Files that cannot be read, and files that do not belong together.
    """

    name: str
    workspace: WorkspaceMap | None = None
    placement: BinPlacement | None = None
    bin_map: BinMap | None = None
    study: Study | None = None
    ranked: tuple[Mapping[str, Any], ...] = ()
    validation: Mapping[str, Any] | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    missing: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def artefacts(self) -> dict[str, Artefact | Study]:
        """Artefacts by their role, in the order of the pipeline; a study comes last."""
        found: dict[str, Artefact | Study | None] = {
            "workspace": self.workspace,
            "placement": self.placement,
            "bin": self.bin_map,
            "study": self.study,
        }
        return {role: record for role, record in found.items() if record is not None}

    @property
    def is_study_alone(self) -> bool:
        """Whether there is nothing of the pipeline."""
        return list(self.artefacts) == ["study"]

    @property
    def latest(self) -> str:
        """Role of the artefact furthest down the pipeline, whose cell is current."""
        *_, last = (r for r in self.artefacts if self.is_study_alone or r != "study")
        return last


class _Reader:
    """Reads the results, and records what is missing."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.files: dict[str, str] = {}
        self.missing: dict[str, str] = {}
        self.warnings: list[str] = []

    def artefact(self, role: str, read: Callable[[Path], Read]) -> Read | None:
        kind, usual, command = ARTEFACTS[role]
        path = self.folder / usual
        if not is_there(path):
            # Under another name, if there is one of this kind only.
            others = [
                other
                for other in sorted(self.folder.glob("*.h5"))
                if artefact_kind(other) == kind
            ]
            if len(others) != 1:
                if role not in OPTIONAL:
                    self.missing[usual] = command
                if others:
                    names = ", ".join(other.name for other in others)
                    self.warnings.append(f"none of {names} is called {usual}: left out")
                return None
            path = others[0]
        return self._read(role, path, read)

    def json(self, role: str) -> Any:
        usual, command = LISTS[role]
        path = self.folder / usual
        if not is_there(path):
            self.missing[usual] = command
            return None
        return self._read(role, path, _read_json)

    def _read(self, role: str, path: Path, read: Callable[[Path], Read]) -> Read | None:
        try:
            record = read(path)
        except ReachmapError as error:
            self.warnings += [
                f"not used: {_without(line, path)}" for line in error.lines
            ]
            return None
        self.files[role] = path.name
        return record


def _without(line: str, path: Path) -> str:
    """Reduce the path of a file in a message to its name."""
    return line.replace(str(path), path.name)


def _read_json(path: Path) -> Any:
    try:
        if path.stat().st_size > MAX_JSON_BYTES:
            raise MapFileError(f"{path}: larger than {MAX_JSON_BYTES >> 20} MB")
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MapFileError(f"{path}: cannot be read ({error})") from error
    return parse_json(text, str(path))


def read_run_folder(folder: Path) -> RunFolder:
    """Read a run; missing or damaged files are recorded and left out.

    Parameters
    ----------
    folder : Path
        With ``workspace.h5``, ``placement.h5``, ``bin.h5``, ``study.h5``,
        ``ranked.json`` and ``validation.json``, or some of them. An artefact may have
        another name if it is the only one of its kind.

    Raises
    ------
    MapFileError
        It is not a folder, or none of its artefacts can be read.
    """
    if is_there(folder) and not is_folder(folder):
        raise MapFileError(
            f"{folder}: is a file; a report is made of the folder that holds it"
        )
    if not is_folder(folder):
        raise MapFileError(f"{folder}: no such folder")
    reader = _Reader(folder)
    workspace = reader.artefact("workspace", read_workspace_map)
    placement = reader.artefact("placement", read_placement)
    bin_map = reader.artefact("bin", read_bin_map)
    study = reader.artefact("study", read_study)
    ranked = _ranked_lists(reader)
    validation = _validation(reader)
    run = RunFolder(
        name=real_path(folder).name,
        workspace=workspace,
        placement=placement,
        bin_map=bin_map,
        study=study,
        ranked=ranked,
        validation=validation,
        files=reader.files,
        missing=reader.missing,
        warnings=tuple(reader.warnings),
    )
    if not run.artefacts:
        names = ", ".join(usual for _, usual, _ in ARTEFACTS.values())
        raise MapFileError([f"{folder}: none of {names} can be used", *reader.warnings])
    return run


def _ranked_lists(reader: _Reader) -> tuple[Mapping[str, Any], ...]:
    found = reader.json("ranked")
    documents = found if isinstance(found, list) else [found]
    ranked = tuple(
        document
        for document in documents
        if isinstance(document, dict)
        and isinstance(document.get("reachmap"), dict)
        and isinstance(document.get("grasps"), list)
    )
    if found is not None and len(ranked) < len(documents):
        reader.warnings.append(f"{LISTS['ranked'][0]}: no ranked grasp list, left out")
    return ranked


def _validation(reader: _Reader) -> Mapping[str, Any] | None:
    found = reader.json("validation")
    if isinstance(found, dict) and isinstance(found.get("lists"), list):
        return found
    if found is not None:
        reader.warnings.append(f"{LISTS['validation'][0]}: no validation, left out")
    return None


def chain_warnings(run: RunFolder) -> tuple[str, ...]:
    """Files of a run that were not made from each other, one sentence each."""
    warnings = []
    chain = (("workspace", "placement"), ("placement", "bin"))
    for source, result in chain:
        a, b = run.artefacts.get(source), run.artefacts.get(result)
        if a is None or b is None:
            continue
        if b.provenance.source_sha256 != a.stamp.content_sha256:
            warnings.append(
                f"{run.files[result]} was not made from this {run.files[source]}"
            )
    if run.bin_map is not None:
        content = run.bin_map.stamp.content_sha256
        for document in run.ranked:
            if document["reachmap"].get("map_sha256") != content:
                warnings.append(
                    f"{run.files['ranked']} was not ranked with this {run.files['bin']}"
                )
    return tuple(dict.fromkeys(warnings))
