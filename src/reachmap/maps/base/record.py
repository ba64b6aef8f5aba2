"""Placement of the robot base: the poses considered, and the one chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.maps.display import Shown
from reachmap.maps.parts import freeze
from reachmap.maps.records import Provenance, RunInfo, Stamp


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class BasePlacement(Shown):
    """Placement of the robot base for a fixed bin. Candidates are rows.

    Attributes
    ----------
    base_pose : array, shape (4, 4)
        T_world_base of the chosen candidate.
    bin_pose : array, shape (4, 4)
        T_world_bin, which stays.
    scan_configuration : array, shape (dof,)
        Of the chosen candidate [rad].
    joint_names : tuple of str
        Of the chosen arm.
    rail : str
        Joint whose position is chosen in place of a pose, or "".
    chosen, runner_up, present : int
        Rows: the best, the best in another place or of another arm or mounting, the
        cell as it is; -1 for none.
    arms, mountings : tuple of str
        What was compared; the first arm is the cell's own.
    best_of : int array, shape (na, nm)
        Best row of each arm and mounting, -1 for none.
    arm, mounting : int array, shape (n,)
        Of each candidate.
    candidate_position : array, shape (n, 3)
        In the world [m]; of an arm on a rail the joint's position, and zeros.
    candidate_yaw : array, shape (n,)
        Heading of the base in the world [rad].
    score, score_error, worst_point, reachable_share : array, shape (n,)
        Percent; NaN where there is none. Where ``exact`` is 0, the score is a bound:
        the share of test grasps with a free configuration.
    exact : uint8 array, shape (n,)
        1 where paths were planned.
    reason : tuple of str
        Why a candidate is excluded, "" if it is not.
    margin : mapping
        Direction ("+x", "-yaw", …, along the axes of ``T_world_level``) to how far the
        base may be off [m, rad] before the score drops by 5 points.
    T_world_level : array, shape (4, 4)
        Upright frame at the bin that the search was done in.
    """

    base_pose: FloatArray
    bin_pose: FloatArray
    scan_configuration: FloatArray
    joint_names: tuple[str, ...]
    rail: str
    chosen: int
    runner_up: int
    present: int
    arms: tuple[str, ...]
    mountings: tuple[str, ...]
    best_of: IntArray
    arm: IntArray
    mounting: IntArray
    candidate_position: FloatArray
    candidate_yaw: FloatArray
    score: FloatArray
    score_error: FloatArray
    worst_point: FloatArray
    reachable_share: FloatArray
    exact: CodeArray
    reason: tuple[str, ...]
    margin: Mapping[str, float]
    T_world_level: FloatArray
    stamp: Stamp
    provenance: Provenance
    run: RunInfo

    def __post_init__(self) -> None:
        freeze(self)
