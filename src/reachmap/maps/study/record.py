"""A study: variants of a cell, their objectives, and how they compare with the base."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.display import Shown
from reachmap.maps.parts import Compared, freeze
from reachmap.maps.records import Provenance, RunInfo, Stamp

PATH_LENGTH = "path_length_rad"
OBJECTIVES: dict[str, str] = {
    "level_average": "percent",
    "bin_reachability": "percent",
    "directions": "percent",
    "points": "percent",
    PATH_LENGTH: "rad",
    "motion_time_s": "s",
    "robust_reachability": "percent",
    "emptied": "percent",
    "cycle_reachability": "percent",
    "cycle_time_s": "s",
}
"""Name of an objective to its unit."""
ALWAYS = (
    "bin_reachability",
    "directions",
    "points",
    PATH_LENGTH,
    "level_average",
)
"""Objectives that every cell has; by default the first one decides."""
MEANS = frozenset({PATH_LENGTH, "motion_time_s", "emptied", "cycle_time_s"})
"""Objectives that are means of numbers; the others are shares of what is reached."""
LOWER_IS_BETTER = frozenset({PATH_LENGTH, "motion_time_s", "cycle_time_s"})


class VariantStatus(IntEnum):
    """Outcome of a variant; the stored codes never change meaning."""

    NOT_ATTEMPTED = 0
    DONE = 1
    FAILED = 2
    LEFT_OUT = 3


STATES = tuple(state.name.lower() for state in VariantStatus)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BinSquares(Compared):
    """What is reached of the bin in each variant, point by point.

    Attributes
    ----------
    bin_x, bin_y : array, shape (nx,), (ny,)
        Test points, in the bin frame [m].
    bin_square : array, shape (nv, ny, nx)
        Share of the test grasps at each point that are reached, mean over the layers
        [percent]; NaN where there is none.
    """

    bin_x: FloatArray
    bin_y: FloatArray
    bin_square: FloatArray

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Study(Shown):
    """Variants of a cell. Index order (variant, parameter or objective).

    Attributes
    ----------
    design : {"grid", "latin_hypercube", "optimised"}
    bin_mode : {"kept", "placed"}
        Whether the bin stays where each variant's cell has it.
    parameter_names, parameter_units : tuple of str
        Parameters of the cell, or keys as ``--set`` takes them.
    objective_names : tuple of str
        Keys of :data:`OBJECTIVES`; the first is what ``best`` is about.
    requirements : tuple of str
        As in ``"bin_reachability >= 90"``.
    base : int
        Variant that the others are compared with.
    best, runner_up : int
        Of the variants that meet the requirements; -1: none.
    parameter : array, shape (nv, np)
        Values; where they are not numbers, their place among those that are varied.
    assignment : tuple of str
        What each variant sets.
    status : uint8 array, shape (nv,)
        :class:`VariantStatus` codes.
    cause : tuple of str
        Why a variant failed or was left out, "" if it was not.
    feasible : uint8 array, shape (nv,)
        1 where all requirements are met.
    cell_sha256, workspace_sha256, placement_sha256, bin_sha256 : tuple of str
        Of the variant's cell, and content hashes of the maps it rests on; "" for none.
    objective, objective_low, objective_high : array, shape (nv, no)
        Value and 95 % interval [percent, rad]; NaN where there is none.
    pairs, gained, lost : int array, shape (nv, no)
        Frames that variant and base share, and those reached by one of them alone;
        for a path length, those that both reach, and zeros.
    change, change_low, change_high : array, shape (nv, no)
        Variant minus base over these frames, and its 95 % interval.
    p_value : array, shape (nv, no)
        NaN for the base, and where no frames are shared.
    significant : uint8 array, shape (nv, no)
        1 where the change is more than chance, at a false-discovery rate of 5 %
        across the study.
    squares : BinSquares, optional
        Where all variants have the same test points.
    """

    design: str
    bin_mode: str
    parameter_names: tuple[str, ...]
    parameter_units: tuple[str, ...]
    objective_names: tuple[str, ...]
    requirements: tuple[str, ...]
    base: int
    best: int
    runner_up: int
    parameter: FloatArray
    assignment: tuple[str, ...]
    status: CodeArray
    cause: tuple[str, ...]
    feasible: CodeArray
    cell_sha256: tuple[str, ...]
    workspace_sha256: tuple[str, ...]
    placement_sha256: tuple[str, ...]
    bin_sha256: tuple[str, ...]
    objective: FloatArray
    objective_low: FloatArray
    objective_high: FloatArray
    pairs: IntArray
    gained: IntArray
    lost: IntArray
    change: FloatArray
    change_low: FloatArray
    change_high: FloatArray
    p_value: FloatArray
    significant: CodeArray
    stamp: Stamp
    provenance: Provenance
    run: RunInfo
    squares: BinSquares | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def done(self) -> BoolArray:
        """Variants that were computed, shape (nv,)."""
        return np.asarray(self.status == VariantStatus.DONE)
