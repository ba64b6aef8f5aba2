"""What a scan computes, apart from where and how often it is interrupted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from reachmap.errors import MapFileError
from reachmap.runtime.encoding import Json, json_from_value, value_from_json

if TYPE_CHECKING:  # workers import this module, and have no use for HDF5
    from reachmap.maps.records import RunInfo, Status

KINDS: dict[str, str] = {
    "workspace_map": "reachmap.scans.workspace_per_frame:KIND",
    "bin_map": "reachmap.scans.bin_scan:KIND",
}
"""Kind of scan to ``module:name`` of its :class:`Kind`; imported on use."""

MAX_UNITS = 100_000_000


class Assemble(Protocol):
    """Joins the payloads of all units into the artefact."""

    def __call__(
        self, document: Mapping[str, Json], payloads: Sequence[Any], *, run: RunInfo
    ) -> Any:
        """Build the artefact; ``payloads`` is in unit order and read lazily."""


class Write(Protocol):
    """Publishes the artefact under its final name, atomically."""

    def __call__(
        self, path: Path, artefact: Any, /, *, overwrite: bool = False
    ) -> object:
        """Write ``artefact`` to ``path``."""


class Blank(Protocol):
    """Makes the payload of a unit that has none."""

    def __call__(self, document: Mapping[str, Json], unit: int, status: Status) -> Any:
        """Payload whose every frame has ``status``: NOT_ATTEMPTED or ERROR."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A kind of scan: how payloads are written down and become an artefact.

    It is all that merging shards or looking into a journal needs; everything
    particular to one scan comes from the journal's ``document``.

    Attributes
    ----------
    name : str
        Key in :data:`KINDS`.
    blank, assemble, write
        See the protocols of this module.
    encode, decode : callable
        Payload to JSON values and back, exactly; module-level functions. The
        defaults take nests of numbers, text and arrays.
    """

    name: str
    blank: Blank
    assemble: Assemble
    write: Write
    encode: Callable[[Any], Json] = json_from_value
    decode: Callable[[Json], Any] = value_from_json


def one_frame(payload: Any) -> tuple[int, int]:
    """Tally of a unit that is one frame and cannot fail."""
    return 1, 1


def unchanged(context: Any) -> Any:
    """Prepare nothing."""
    return context


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """Units of work 0 … ``units`` - 1, each computed from the context alone.

    Every callable is a module-level function, so that it can be sent by name.

    Attributes
    ----------
    kind : Kind
    units : int
        Number of units; one should take some hundred milliseconds.
    function : callable
        ``function(state, unit) -> payload``. Its result depends on nothing else.
    context : picklable
        What workers need to know, as text and numbers rather than models.
    prepare : callable
        ``prepare(context) -> state``, called once per worker: the scene, say.
    settings : mapping
        All that determines the result, as JSON values. A journal resumes only when
        every entry agrees; the names appear in the refusal ("seed 1 → 2").
    document : mapping
        What ``kind`` needs besides the payloads, as JSON values; not compared.
    tally : callable
        ``tally(payload) -> (ok, frames)`` for the progress report.
    frames : int, optional
        Frames in all units together; by default the number of units.
    """

    kind: Kind
    units: int
    function: Callable[[Any, int], Any]
    context: Any
    settings: Mapping[str, Json]
    prepare: Callable[[Any], Any] = unchanged
    document: Mapping[str, Json] = field(default_factory=dict)
    tally: Callable[[Any], tuple[int, int]] = one_frame
    frames: int | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.units <= MAX_UNITS:
            raise ValueError(f"{self.units} units: expected 1 to {MAX_UNITS:,}")

    @property
    def total_frames(self) -> int:
        """Frames in all units together."""
        return self.units if self.frames is None else self.frames


def kind_named(name: str, *, source: Path) -> Kind:
    """Find the kind a journal names.

    Raises
    ------
    MapFileError
        When this version knows no such kind; ``source`` is the journal to blame.
    """
    if name not in KINDS:
        known = ", ".join(KINDS)
        raise MapFileError(f"{source}: a journal of kind {name!r}; known: {known}")
    module, _, attribute = KINDS[name].partition(":")
    kind: Kind = getattr(import_module(module), attribute)
    return kind
