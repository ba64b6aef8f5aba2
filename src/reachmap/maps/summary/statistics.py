"""Statistics of the maps: shares with intervals, causes, levels, saturation.

Also why nothing is reachable, in one line: the most likely cause, with counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.comparison.significance import Z_95
from reachmap.maps.records import BinMap, Status, WorkspaceMap

STATUS_NAMES: dict[Status, str] = {
    Status.PATH_FOUND: "path found",
    Status.NO_PATH_FOUND: "no path found",
    Status.APPROACH_BLOCKED: "approach blocked",
    Status.IK_IN_COLLISION: "every IK solution in collision",
    Status.NO_IK: "no IK solution",
    Status.ERROR: "error",
    Status.NOT_ATTEMPTED: "not attempted",
}
"""States in words, in the order in which tables and pictures have them."""

REMEDIES = {
    Status.NO_IK: "the arm cannot reach these tool poses: check the position of the "
    "cubes or the bin, robot.tcp and its approach_axis, and the orientations",
    Status.APPROACH_BLOCKED: "the straight approach of bin_scan.approach_distance_m is "
    "not free",
    Status.NO_PATH_FOUND: "there are free configurations, but no path to them: check "
    "the scan configuration, the joint limits and the obstacles around the arm",
}


def wilson_interval(
    hits: FloatArray, total: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Wilson score interval of a share at 95 % confidence, as fractions.

    It keeps its coverage near 0 and 1, where the normal approximation gives
    intervals that leave [0, 1] or have no width.

    Examples
    --------
    >>> low, high = wilson_interval(np.array(0.0), np.array(10.0))
    >>> float(low), round(float(high), 4)
    (0.0, 0.2775)
    """
    z2 = Z_95**2
    share = hits / total
    middle = (share + z2 / (2.0 * total)) / (1.0 + z2 / total)
    spread = share * (1.0 - share) / total + z2 / (4.0 * total**2)
    half = np.sqrt(z2 * spread) / (1.0 + z2 / total)
    return np.maximum(middle - half, 0.0), np.minimum(middle + half, 1.0)


def level_means(values: FloatArray) -> FloatArray:
    """Mean over the attempted squares of each level, (nz, ny, nx) to (nz,)."""
    attempted = ~np.isnan(values)
    total = np.where(attempted, values, 0.0).sum(axis=(1, 2))
    with np.errstate(invalid="ignore"):
        return np.asarray(total / attempted.sum(axis=(1, 2)))


def best_level(values: FloatArray) -> int | None:
    """Index of the level with the highest mean, the lowest of equals."""
    means = level_means(values)
    return None if np.isnan(means).all() else int(np.nanargmax(means))


def attempted(bin_map: BinMap) -> BoolArray:
    """Test grasps that the scan came to, shape (nl, ny, nx, no)."""
    return np.asarray(bin_map.status != Status.NOT_ATTEMPTED)


def found_after(bin_map: BinMap, attempts: int) -> BoolArray:
    """Test grasps with a path in the first attempts, shape (nl, ny, nx, no)."""
    return np.asarray(bin_map.path_found[..., :attempts].any(axis=-1))


def are_independent(bin_map: BinMap) -> bool:
    """Whether each test grasp has several attempts of a planner.

    Attempts that branch off the roadmap's routes share their search; more of them
    reach no more, and have no saturation.
    """
    attempts = str(bin_map.provenance.settings.get("attempts", "planner"))
    return bin_map.path_found.shape[-1] > 1 and attempts != "roadmap"


@dataclass(frozen=True, slots=True, kw_only=True)
class Saturation:
    """Test grasps reached over the number of attempts, in percent.

    Attributes
    ----------
    attempts : int array, shape (nr,)
    hits : int array, shape (nr,)
        Test grasps reached.
    share, low, high : array, shape (nr,)
        Share reached, and its Wilson 95 % interval.
    proved : float
        Share that an attempt or the roadmap proves reachable.
    missed : int
        Test grasps that the roadmap proves and every attempt missed.
    total : int
        Number of test grasps that were tried.
    """

    attempts: IntArray
    hits: IntArray
    share: FloatArray
    low: FloatArray
    high: FloatArray
    proved: float
    missed: int
    total: int


def saturation_of(bin_map: BinMap, chosen: BoolArray | None = None) -> Saturation:
    """Count what the first 1, 2, … attempts reach.

    Parameters
    ----------
    bin_map : BinMap
    chosen : array of bool, shape (nl, ny, nx, no), optional
        Test grasps to look at; all if left out.
    """
    tried = attempted(bin_map) if chosen is None else attempted(bin_map) & chosen
    total = max(int(tried.sum()), 1)
    attempts = np.arange(1, bin_map.path_found.shape[-1] + 1)
    reached = [found_after(bin_map, int(k)) & tried for k in attempts]
    hits = np.array([int(mask.sum()) for mask in reached])
    low, high = wilson_interval(hits.astype(float), np.full(len(hits), float(total)))
    found = reached[-1]
    proved = bin_map.connected.astype(bool) & tried
    return Saturation(
        attempts=attempts,
        hits=hits,
        share=100.0 * hits / total,
        low=100.0 * low,
        high=100.0 * high,
        proved=100.0 * int(((proved | found) & tried).sum()) / total,
        missed=int((proved & ~found).sum()),
        total=total,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Causes:
    """How many test frames are in each state, and what blocks them.

    Attributes
    ----------
    states : mapping
        State to number of test frames, without those that do not occur.
    pairs : tuple of (str, int)
        Pair of bodies to the number of test frames it blocks, the most first.
    total : int
        Number of test frames that were attempted.
    """

    states: dict[Status, int]
    pairs: tuple[tuple[str, int], ...]
    total: int


def causes_of(record: WorkspaceMap | BinMap) -> Causes:
    """Count states and blocking pairs over all test frames of a map."""
    status, pair = frames_of(record)
    states = {code: int((status == code).sum()) for code in STATUS_NAMES}
    number = np.bincount(pair[pair >= 0], minlength=len(record.body_pairs))
    order = np.argsort(-number, kind="stable")
    return Causes(
        states={code: count for code, count in states.items() if count},
        pairs=tuple((record.body_pairs[i], int(number[i])) for i in order if number[i]),
        total=int((status != Status.NOT_ATTEMPTED).sum()),
    )


def frames_of(record: WorkspaceMap | BinMap) -> tuple[CodeArray, IntArray]:
    """Status and blocking pair of every test frame, each of shape (frames,)."""
    if isinstance(record, BinMap):
        return record.status.ravel(), record.blocking_pair.ravel()
    cubes = record.cubes.values()
    status: CodeArray = np.concatenate([cube.status.ravel() for cube in cubes])
    return status, np.concatenate([cube.blocking_pair.ravel() for cube in cubes])


def ik_approximation(settings: Mapping[str, Any]) -> str:
    """Description of approximate inverse kinematics; "" where it is complete.

    Parameters
    ----------
    settings : mapping
        The settings in the artefact's provenance.

    Examples
    --------
    >>> ik_approximation({"ik_method": "analytic", "ik_complete": True})
    ''
    >>> ik_approximation({"ik_method": "numeric", "ik_complete": False})
    'numeric'
    """
    if settings.get("ik_complete", True):
        return ""
    return str(settings.get("ik_approximation") or settings.get("ik_method", ""))


def why_unreachable(record: WorkspaceMap | BinMap) -> str:
    """Why a map has no reachable test frame; "" where it has one."""
    return most_likely_cause(*frames_of(record), record.body_pairs)


def most_likely_cause(
    status: CodeArray, blocking_pair: IntArray, body_pairs: Sequence[str]
) -> str:
    """Say why no test frame was reached; "" where one was, or none attempted.

    Parameters
    ----------
    status : uint8 array, shape (frames,)
    blocking_pair : int array, shape (frames,)
        Index into ``body_pairs``, -1 where there is none.
    body_pairs : sequence of str
    """
    tried = status != Status.NOT_ATTEMPTED
    if not tried.any() or (status == Status.PATH_FOUND).any():
        return ""
    counts = {code: int((status == code).sum()) for code in STATUS_NAMES}
    states = sorted((code for code in counts if counts[code]), key=lambda c: -counts[c])
    states = [code for code in states if code != Status.NOT_ATTEMPTED]
    said = ", ".join(f"{STATUS_NAMES[code]} {counts[code]}" for code in states)
    if states[0] == Status.IK_IN_COLLISION:
        pairs = np.bincount(blocking_pair[blocking_pair >= 0], minlength=1)
        worst = int(pairs.argmax())
        pair = body_pairs[worst] if pairs[worst] else "unknown bodies"
        remedy = f"in {pairs[worst]} of them {pair} collide"
    else:
        remedy = REMEDIES.get(states[0], "see the log")
    return (
        f"nothing is reachable (of {int(tried.sum())} test frames: {said}); most "
        f"likely cause: {STATUS_NAMES[states[0]]}, {remedy}"
    )
