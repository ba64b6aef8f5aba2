"""How the format of an artefact is written down: variables, dimensions, attributes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from reachmap.maps.records import Status
from reachmap.maps.tree import Tree

STATUS_MEANINGS = " ".join(item.name.lower() for item in Status)
STATUS_CODES = tuple(int(item) for item in Status)

FORMAT_VERSION = "1.0"


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """One array of an artefact.

    Attributes
    ----------
    path : str
        Where it is; ``{cube}`` stands for the name of each cube.
    dims : tuple of str
    dtype : str
        As NumPy names it, little-endian: "f8", "u1", "i4".
    units : str
        "m", "rad", "s", "percent", or "1" for pure numbers.
    meaning : str
        One sentence, stored as ``long_name``.
    frame : str
        Frame that coordinates are given in, or "".
    low, high : float or None
        Range of the numbers, NaN aside.
    nan : bool
        Whether NaN may stand for "there is none".
    labels : str
        Name of an attribute that lists texts for the variable ("body_pairs"), or "".
        A coordinate has one text for each of its numbers.
    is_index : bool
        Whether the numbers count in that list.
    is_status : bool
        Whether the numbers are :class:`~reachmap.maps.records.Status` codes.
    is_flag : bool
        Whether the numbers are 0 for no and 1 for yes.
    """

    path: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    meaning: str
    frame: str = ""
    low: float | None = None
    high: float | None = None
    nan: bool = False
    labels: str = ""
    is_index: bool = False
    is_status: bool = False
    is_flag: bool = False

    @property
    def name(self) -> str:
        """Last part of the path."""
        return self.path.rpartition("/")[2]

    @property
    def group(self) -> str:
        """Group it lies in, "" for the root."""
        return self.path.rpartition("/")[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """The format of one kind of artefact.

    Attributes
    ----------
    kind : str
        Short name; ``format`` is ``reachmap.<kind>``.
    name : str
        What a message calls it.
    command : str
        The command that makes it.
    title : str
    signal, axes : str, tuple of str
        What a NeXus viewer plots first.
    variables : tuple of Variable
    attributes : mapping of str to str
        Root attributes of this kind besides those of every artefact, with what they
        mean.
    check : callable
        Whether the numbers agree with each other; sentences where they do not.
    """

    kind: str
    name: str
    command: str
    title: str
    signal: str
    axes: tuple[str, ...]
    variables: tuple[Variable, ...]
    attributes: dict[str, str]
    check: Callable[[Tree], list[str]]

    @property
    def format(self) -> str:
        """Value of the root attribute ``format``."""
        return f"reachmap.{self.kind}"


COMMON_ATTRIBUTES = {
    "Conventions": "Metadata conventions, `CF-1.11`.",
    "format": "Kind of artefact.",
    "format_version": "Version of the format; a reader accepts its own major version.",
    "title": "One line for people.",
    "NX_class": "`NXdata`, so that NeXus viewers find the default plot.",
    "signal": "Variable of the default plot.",
    "axes": "Its dimensions, one name each.",
    "frame": "Frame of everything that does not name its own: `robot_base`.",
    "seed": "Seed of all random choices (uint64).",
    "cell_sha256": "Hash of the cell's contents, meshes included.",
    "config_sha256": "Hash of everything that determines the result.",
    "content_sha256": "Hash of the result without measured times.",
    "integrity_sha256": "Hash of everything in the file.",
}
"""Root attributes of every artefact, with what they mean."""

PROVENANCE_TEXTS = {
    "cell_yaml": "The cell file as read.",
    "cell_resolved_json": "The cell after defaults and overrides, as JSON.",
    "overrides_json": "The `--set` assignments in order, as a JSON list.",
    "urdf": "The robot description after xacro.",
    "srdf": "The semantic description, empty if there is none.",
    "files_sha256_json": "Each mesh and the sha256 of its bytes, as a JSON object.",
    "packages_json": "Each package and its version, as a JSON object.",
    "settings_json": "Method, planner, checking and simplification, as a JSON object.",
    "source_sha256": "`content_sha256` of the artefact this one is made from.",
}
"""Texts of ``/provenance``, with what they hold."""

RUN_TEXTS = {
    "started": "When the run began, ISO 8601 with offset.",
    "finished": "When it ended.",
    "host": "Name of the machine.",
    "command_line": "The command as typed.",
    "workers": "Number of workers, as a decimal number.",
    "wall_s_json": "Phase to wall-clock seconds, as a JSON object.",
    "cpu_s_json": "Phase to CPU seconds of all workers, as a JSON object.",
}
"""Texts of ``/run``, with what they hold."""
