"""Optional parts of the maps, each stored completely or not at all."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, TypeVar

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray

# State checks by which a component that can be reached was reached, and the share of
# those components: 109 that exploring did not reach, in the cells of
# benchmarks/hard_cells, two seeds each. All were in the end, so 0.99 is the most that
# they say.
_CHECKS: Final = (0, 2_000, 5_000, 10_000, 20_000, 50_000, 80_000)
_SHARE: Final = (0.0, 0.25, 0.55, 0.75, 0.89, 0.95, 0.99)


Rows = TypeVar("Rows")


def freeze(record: Any) -> None:
    """Make every array of a dataclass read-only (for ``__post_init__``)."""
    for item in dataclasses.fields(record):
        value = getattr(record, item.name)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)


class Compared:
    """Mixin for dataclasses with arrays: equal where every field is, NaN included.

    Equality of the generated kind would be an array. Records are not hashable.
    """

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        names = [item.name for item in dataclasses.fields(self)]  # type: ignore[arg-type]
        return all(_same(getattr(self, n), getattr(other, n)) for n in names)

    __hash__ = None  # type: ignore[assignment]


def _same(one: Any, other: Any) -> bool:
    if not isinstance(one, np.ndarray):
        return bool(one == other or (one != one and other != other))
    if not isinstance(other, np.ndarray) or one.dtype != other.dtype:
        return False
    return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")


def concatenated(parts: Sequence[Rows]) -> Rows:
    """Dataclasses of arrays, one after another, as one."""
    first: Any = parts[0]
    names = [item.name for item in dataclasses.fields(first)]
    rows = {n: np.concatenate([getattr(part, n) for part in parts]) for n in names}
    whole: Rows = dataclasses.replace(first, **rows)
    return whole


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PathStore(Compared):
    """Ragged store of joint paths (CF contiguous ragged array).

    Attributes
    ----------
    configuration : array, shape (points, dof)
        Waypoints of all paths, one after another [rad].
    row_size : int array, shape (paths,)
        Number of waypoints of each path.
    planned_size : int array, shape (paths,)
        How many of them, from the first, are the planned part; the rest is the
        straight approach.
    index : int array, shape (paths, 5)
        layer, y, x, orientation, repeat of each path; repeat is -1 where the path is
        no attempt: the roadmap's own, or a later stage of the cycle.
    stage : uint8 array, shape (paths,), or None
        0: to the grasp; 1, 2, …: the stages of the cycle, in order.
    """

    configuration: FloatArray
    row_size: IntArray
    planned_size: IntArray
    index: IntArray
    stage: CodeArray | None = None

    def __post_init__(self) -> None:
        freeze(self)

    def __len__(self) -> int:
        return len(self.row_size)

    def __getitem__(self, row: int) -> FloatArray:
        """Waypoints of one path, shape (n, dof) [rad]."""
        if not -len(self) <= row < len(self):
            raise IndexError(f"there are {len(self)} paths (got {row})")
        row %= len(self)
        start = int(self.row_size[:row].sum())
        return self.configuration[start : start + int(self.row_size[row])]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Components(Compared):
    """Connected components of the roadmap: the evidence behind ``no_path_found``.

    Attributes
    ----------
    attempts, checks : int array, shape (components,)
        Searches that were made for the component, and the state checks they took.
    reached : uint8 array, shape (components,)
        1 where one of them arrived.
    agreed : uint8 array, shape (components,)
        1 where a method that shares nothing with the first was asked, too, and came
        to the same verdict.
    method_checks : int array, shape (components, methods)
        State checks by each method; they add up to ``checks``.
    methods : tuple of str
    confidence : array, shape (components,), or None
        See :func:`confidence_of`.
    """

    attempts: IntArray
    checks: IntArray
    reached: CodeArray
    agreed: CodeArray
    method_checks: IntArray
    methods: tuple[str, ...]
    confidence: FloatArray | None = None

    def __post_init__(self) -> None:
        freeze(self)


def confidence_of(checks: IntArray, reached: CodeArray) -> FloatArray:
    """Share of reachable components that are reached with no more checks than these.

    It is the share that a verdict "no path found" of the same effort would not have
    lost where the answer is known. It says that of another cell by analogy only, and
    not how likely the component is to be reachable at all.

    Parameters
    ----------
    checks, reached : int array, shape (components,)
        See :class:`Components`.

    Returns
    -------
    array, shape (components,)
        From 0 to 1; 1 for components that are reached.
    """
    share = np.interp(checks, _CHECKS, _SHARE)
    return np.asarray(np.where(reached == 1, 1.0, share))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Refinement(Compared):
    """Grasps between the test grasps whose verdict alone is known, in any roll.

    Attributes
    ----------
    position : array, shape (n, 3)
        In robot_base [m].
    quaternion_wxyz : array, shape (n, 4)
        R_base_tcp in the roll that is reached, in any where none is.
    status : uint8 array, shape (n,)
        Codes of :class:`reachmap.maps.records.Status`.
    lever_m : float
        Length of the tool, by which angles and distances between grasps compare [m].
    """

    position: FloatArray
    quaternion_wxyz: FloatArray
    status: CodeArray
    lever_m: float

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Effort(Compared):
    """State checks of each attempt.

    Attributes
    ----------
    checks : int array, shape (nl, ny, nx, no, nr)
        0 where nothing was sought.
    seconds_per_check : float
        Nominal cost of one check [s], by which checks read as seconds. It is a
        constant, not a measurement.
    """

    checks: IntArray
    seconds_per_check: float

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BestPaths(Compared):
    """The path to execute to each test grasp, whatever its origin.

    Attributes
    ----------
    row : int array, shape (nl, ny, nx, no)
        Row of the path store, -1 where there is none.
    path_length, execution_time : array, same shape
        Of that path [rad], [s]; NaN where there is none.
    effort_checks : int array, same shape
        State checks that it took; 0 where there is none.
    """

    row: IntArray
    path_length: FloatArray
    execution_time: FloatArray
    effort_checks: IntArray

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ApproachTimes(Compared):
    """Time optima of the straight approaches and retreats.

    Attributes
    ----------
    approach, retreat : array, shape (nl, ny, nx, no, nr)
        [s], NaN where no path.
    """

    approach: FloatArray
    retreat: FloatArray

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Margins(Compared):
    """Margins of the best path and its goal: clearance, joint limits, singularity.

    Attributes
    ----------
    clearance : array, shape (nl, ny, nx, no)
        Least distance of two bodies on the path [m], NaN where no path.
    clearance_pair : int array, same shape
        Index of these bodies into ``body_pairs``, -1 where there are none.
    joint_margin : array, same shape
        Least distance to a joint limit at the goal and on the straight approach [rad].
    smallest_singular_value : array, same shape
        Of the TCP Jacobian (m and rad), least at the goal and on the approach.
    """

    clearance: FloatArray
    clearance_pair: IntArray
    joint_margin: FloatArray
    smallest_singular_value: FloatArray

    def __post_init__(self) -> None:
        freeze(self)


ABOVE_RIM_M = 0.01
"""How far above the rim a lift that is to clear it takes the part, if it can [m]."""


class StageStatus(IntEnum):
    """Outcome of a stage of the cycle; the first six mean what they do elsewhere.

    The stored codes never change meaning.
    """

    NOT_ATTEMPTED = 0
    PATH_FOUND = 1
    NO_IK = 2
    IK_IN_COLLISION = 3
    NO_PATH_FOUND = 4
    ERROR = 5
    APPROACH_BLOCKED = 6
    PART_IN_COLLISION = 7
    LIFT_OUT_OF_REACH = 8
    LIFT_BLOCKED = 9
    TRANSFER_NOT_FOUND = 10
    DROP_OFF_UNREACHABLE = 11
    RETURN_NOT_FOUND = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cycle(Compared):
    """The stages from the grasp until the robot is back.

    Attributes
    ----------
    stages : tuple of str
        Names, in order; stage k is numbered k + 1 in the path store.
    status : uint8 array, shape (nl, ny, nx, no, stages)
        :class:`StageStatus` codes.
    blocking_pair : int array, same shape
    time, length : array, same shape
        [s], [rad]; NaN unless the stage has a path.
    drop_off : int array, shape (nl, ny, nx, no)
        Index of the place where the part goes, -1 where it goes nowhere.
    cycle_time : array, shape (nl, ny, nx, no)
        [s], NaN unless every stage has a path.
    reachability : array, shape (nl, ny, nx)
        Test grasps with a whole cycle [percent].
    """

    stages: tuple[str, ...]
    status: CodeArray
    blocking_pair: IntArray
    time: FloatArray
    length: FloatArray
    drop_off: IntArray
    cycle_time: FloatArray
    reachability: FloatArray

    def __post_init__(self) -> None:
        freeze(self)
