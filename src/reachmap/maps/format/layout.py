"""Declaration of artefact formats: variables, dimensions, attributes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.bytes.tree import Tree
from reachmap.maps.records import Status

FORMAT_VERSION = "1.1"
FORMAT_PREFIX = "reachmap."


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """One array of an artefact.

    Attributes
    ----------
    path : str
        Where it is; ``{cube}`` stands for the name of each cube.
    dims : tuple of str
    dtype : str
        As NumPy names it, little-endian: "f8", "u1", "i4"; "U" for texts.
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
    codes : type of IntEnum, or None
        What the numbers mean, where they are codes.
    is_flag : bool
        Whether the numbers are 0 for no and 1 for yes.
    is_hidden : bool
        Whether netCDF readers take the coordinate for a mere length.
    number : str
        Name of an attribute that holds a number ("seconds_per_check"), or "".
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
    codes: type[IntEnum] | None = None
    is_flag: bool = False
    number: str = ""
    is_hidden: bool = False

    @property
    def name(self) -> str:
        """Last part of the path."""
        return self.path.rpartition("/")[2]

    @property
    def group(self) -> str:
        """Group it lies in, "" for the root."""
        return self.path.rpartition("/")[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """Variables that a file has all of, or none.

    Attributes
    ----------
    field : str
        Field of the record that holds them, None where a file does not; "" where they
        follow from the rest of the record.
    part : callable or None
        Makes what is in that field of the arrays; None: the one array itself.
    arrays : mapping of str to Variable
        Field of the part to its variable.
    scales : tuple of Variable
        Coordinates that only these variables have.
    lists : mapping of str to str
        Field of the part that is a list of texts, to the name of the list.
    numbers : mapping of str to str
        Field of the part that is a number, to the name of the attribute.
    """

    field: str
    part: Callable[..., Any] | None = None
    arrays: Mapping[str, Variable]
    scales: tuple[Variable, ...] = ()
    lists: Mapping[str, str] = dataclasses.field(default_factory=dict)
    numbers: Mapping[str, str] = dataclasses.field(default_factory=dict)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Scales first."""
        return (*self.scales, *self.arrays.values())

    def is_in(self, paths: Container[str]) -> bool:
        """Whether any of its variables is among the paths."""
        return any(variable.path in paths for variable in self.arrays.values())


@dataclass(frozen=True, slots=True)
class Kind:
    """Name of a kind of artefact in messages, and the command that makes it."""

    name: str
    command: str


KINDS: Final[dict[str, Kind]] = {
    "workspace_map": Kind("workspace map", "reachmap workspace-scan"),
    "bin_map": Kind("bin map", "reachmap bin-scan"),
    "bin_placement": Kind("bin placement", "reachmap place-bin"),
    "base_placement": Kind("base placement", "reachmap place-robot"),
    "study": Kind("study", "reachmap study"),
    "robustness": Kind("robustness of a bin map", "reachmap robust"),
}
"""Every kind of artefact, also for readers that know the layout of one alone."""


def kind_of_format(format_name: object) -> str | None:
    """Kind that a ``format`` attribute names; None if it is not one of ours."""
    kind = str(format_name).removeprefix(FORMAT_PREFIX)
    return kind if kind in KINDS and format_name == FORMAT_PREFIX + kind else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """The format of one kind of artefact.

    Attributes
    ----------
    kind : str
        Short name; ``format`` is ``reachmap.<kind>``.
    title : str
    signal, axes : str, tuple of str
        What a NeXus viewer plots first.
    variables : tuple of Variable
    attributes : mapping of str to str
        Root attributes of this kind besides those of every artefact, with what they
        mean.
    check : callable
        Whether the numbers agree with each other; sentences where they do not.
    sections : tuple of Section
        What a file may have besides; version 1.0 had nothing of it.
    """

    kind: str
    title: str
    signal: str
    axes: tuple[str, ...]
    variables: tuple[Variable, ...]
    attributes: dict[str, str]
    check: Callable[[Tree], list[str]]
    sections: tuple[Section, ...] = ()

    def in_frame(
        self, field: str, T: FloatArray, names: Container[str], frame: str
    ) -> Layout:
        """The layout of a file with some numbers in a frame other than robot_base.

        Parameters
        ----------
        field : str
            Name of the section that holds the frame; where that is robot_base itself
            the file goes without.
        T : array, shape (4, 4)
            The frame in robot_base.
        names : container of str
            Variables whose numbers are in it.
        frame : str
            What they call it.
        """
        if np.array_equal(T, np.eye(4)):
            kept = tuple(part for part in self.sections if part.field != field)
            return dataclasses.replace(self, sections=kept)
        variables = tuple(
            dataclasses.replace(item, frame=frame) if item.name in names else item
            for item in self.variables
        )
        return dataclasses.replace(self, variables=variables)

    @property
    def format(self) -> str:
        """Value of the root attribute ``format``."""
        return FORMAT_PREFIX + self.kind

    @property
    def name(self) -> str:
        """Its name in messages."""
        return KINDS[self.kind].name

    @property
    def command(self) -> str:
        """The command that makes it."""
        return KINDS[self.kind].command


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


PERCENT: Final[dict[str, Any]] = {"units": "percent", "low": 0.0, "high": 100.0}
NONNEGATIVE: Final[dict[str, Any]] = {"low": 0.0, "nan": True}
# Dimensions of what a bin map holds of each test point, and of each test grasp.
POINT: Final = ("layer", "y", "x")
GRASP: Final = (*POINT, "orientation")


def variable(
    path: str, dims: tuple[str, ...], dtype: str, meaning: str, **more: Any
) -> Variable:
    """Describe a variable of a section."""
    return Variable(path=path, dims=dims, dtype=dtype, meaning=meaning, **more)


def index(path: str, meaning: str, **more: Any) -> Variable:
    """Describe a coordinate that only counts."""
    name = path.rpartition("/")[2]
    return Variable(
        path=path, dims=(name,), dtype="i4", units="1", meaning=meaning, low=0, **more
    )


def coordinate(path: str, meaning: str, frame: str) -> Variable:
    """Describe a coordinate in metres."""
    name = path.rpartition("/")[2]
    return Variable(
        path=path, dims=(name,), dtype="f8", units="m", meaning=meaning, frame=frame
    )


def outcome(prefix: str, dims: tuple[str, ...]) -> tuple[Variable, ...]:
    """Describe what both maps say of a test frame."""
    return (
        Variable(
            path=f"{prefix}status",
            dims=dims,
            dtype="u1",
            units="1",
            meaning="Outcome of the test frame.",
            codes=Status,
        ),
        Variable(
            path=f"{prefix}blocking_pair",
            dims=dims,
            dtype="i4",
            units="1",
            meaning="The two bodies in collision, an index into body_pairs; -1: none.",
            low=-1,
            labels="body_pairs",
            is_index=True,
        ),
        Variable(
            path=f"{prefix}n_ik",
            dims=dims,
            dtype="u1",
            units="1",
            meaning="Distinct solutions of the inverse kinematics.",
        ),
        Variable(
            path=f"{prefix}n_ik_free",
            dims=dims,
            dtype="u1",
            units="1",
            meaning="Solutions of the inverse kinematics that are free of collision.",
        ),
    )


def goal(prefix: str, dims: tuple[str, ...], which: str) -> Variable:
    """Describe the joint positions that a result is based on."""
    return Variable(
        path=f"{prefix}goal_configuration",
        dims=(*dims, "joint"),
        dtype="f8",
        units="rad",
        meaning=f"Joint positions at the test frame{which}; NaN where there are none.",
        nan=True,
    )


JOINT = Variable(
    path="joint",
    dims=("joint",),
    dtype="U",
    units="1",
    meaning="Names of the joints.",
    labels="joint_names",
)
COMMON_SCALES = (
    JOINT,
    index("quat", "Parts of a quaternion: w, x, y, z."),
)
SCAN = Variable(
    path="scan_configuration",
    dims=("joint",),
    dtype="f8",
    units="rad",
    meaning="Joint positions from which every path starts.",
)
