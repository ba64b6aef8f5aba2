"""Two maps of one kind compared, frame by frame, matched by pose."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.errors import SettingsError
from reachmap.maps.bytes.to_json import flat_json
from reachmap.maps.comparison.pose_matching import (
    TOLERANCE_DEG,
    TOLERANCE_M,
    Frame,
    FrameTable,
    frame_table,
    match_frames,
)
from reachmap.maps.comparison.significance import (
    benjamini_hochberg,
    clustered_shares,
    fisher_exact,
)
from reachmap.maps.parts import freeze
from reachmap.maps.records import BinMap, Provenance, Status, WorkspaceMap
from reachmap.maps.summary.statistics import STATUS_NAMES
from reachmap.sampling.lattice import merge_coordinates


def cell_changes(
    before: Provenance, after: Provenance
) -> tuple[tuple[str, str, str], ...]:
    """Fields of the resolved cells that differ, with both values as JSON."""
    try:
        a, b = (
            dict(flat_json(json.loads(item.cell_resolved_json)))
            for item in (before, after)
        )
    except (ValueError, RecursionError):
        return ()
    return tuple(
        (key, a.get(key, "-"), b.get(key, "-"))
        for key in [*a, *(key for key in b if key not in a)]
        if a.get(key) != b.get(key)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SquareChange:
    """Change square by square, on the lattice of the common frames.

    Attributes
    ----------
    x, y, z : array, shape (nx,), (ny,), (nz,)
        Coordinates [m]; ``z`` is the layer for a bin map.
    frames, before, after : int array, shape (nz, ny, nx)
        Common frames, and those with a path in each map.
    p_value : array, same shape
        Of Fisher's exact test; NaN where there are no common frames.
    significant : bool array, same shape
        Squares named at a false-discovery rate of 5 %.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    frames: IntArray
    before: IntArray
    after: IntArray
    p_value: FloatArray
    significant: BoolArray

    def __post_init__(self) -> None:
        freeze(self)

    def percent(self, which: str) -> FloatArray:
        """Share of the common frames ["before" or "after", percent], (nz, ny, nx)."""
        share = np.full(self.frames.shape, np.nan)
        hits = getattr(self, which)
        np.divide(100.0 * hits, self.frames, out=share, where=self.frames > 0)
        return share


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """A state, and the two bodies in the way if there are any, with a count."""

    state: str
    pair: str
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What changed from one map to another.

    Attributes
    ----------
    kind : str
    frame : str
        Where poses were matched: "robot_base", "bin" or "world".
    tolerance_m, tolerance_deg : float
    frames_before, frames_after : int
        Different poses that each map attempted.
    common : int
        Poses that both attempted; all that follows is about them.
    reached_before, reached_after, gained, lost : int
        Frames with a path in each, and in one but not the other.
    p_value : float
        Of gained and lost, with places as units; see
        :func:`~reachmap.maps.comparison.significance.clustered_shares`.
    change_low, change_high : float
        95 % interval of the change [percentage points].
    path_length_before, path_length_after : float
        Mean over the frames that both reach [rad].
    squares : SquareChange
    losses : tuple of Cause
        Why frames that were reached before are not after.
    gains : tuple of Cause
        Why frames that are reached after were not before.
    cell_changes : tuple of (str, str, str)
        Field of the cell, its value before and after.
    """

    kind: str
    frame: str
    tolerance_m: float
    tolerance_deg: float
    frames_before: int
    frames_after: int
    common: int
    reached_before: int
    reached_after: int
    gained: int
    lost: int
    p_value: float
    change_low: float
    change_high: float
    path_length_before: float
    path_length_after: float
    squares: SquareChange
    losses: tuple[Cause, ...]
    gains: tuple[Cause, ...]
    cell_changes: tuple[tuple[str, str, str], ...]

    @property
    def change(self) -> float:
        """Change of path reachability [percentage points]."""
        return 100.0 * (self.reached_after - self.reached_before) / self.common


def compare_maps(
    before: WorkspaceMap | BinMap,
    after: WorkspaceMap | BinMap,
    *,
    frame: Frame = "robot_base",
    tolerance_m: float = TOLERANCE_M,
    tolerance_deg: float = TOLERANCE_DEG,
) -> Comparison:
    """Compare two maps on the poses that both attempted.

    Parameters
    ----------
    before, after : WorkspaceMap or BinMap
        Of the same kind.
    frame : {"robot_base", "bin", "world"}
        Where poses must agree; "bin" compares bins that stand in different places,
        "world" cells whose robots do.
    tolerance_m, tolerance_deg : float
        Poses closer than this are the same [m, deg].

    Raises
    ------
    SettingsError
        The maps are of different kinds or have no pose in common.
    """
    if type(before) is not type(after):
        raise SettingsError("a workspace map and a bin map cannot be compared")
    if frame == "bin" and not isinstance(before, BinMap):
        raise SettingsError("only bin maps can be compared in the frame of the bin")
    all_a = frame_table(before, frame, tolerance_m, tolerance_deg)
    all_b = frame_table(after, frame, tolerance_m, tolerance_deg)
    in_a, in_b = match_frames(all_a, all_b, tolerance_m, tolerance_deg)
    a, b = all_a.rows(in_a), all_b.rows(in_b)
    if not len(a):
        raise SettingsError(_nothing_common(before, frame, tolerance_m, tolerance_deg))
    was, now = a.status == Status.PATH_FOUND, b.status == Status.PATH_FOUND
    gained, lost = ~was & now, was & ~now
    both = was & now & ~np.isnan(a.path_length_rad) & ~np.isnan(b.path_length_rad)
    _, place = np.unique(np.round(a.square / TOLERANCE_M), axis=0, return_inverse=True)
    p_value, low, high = clustered_shares(gained.astype(float) - lost, place.ravel())
    return Comparison(
        kind="bin_map" if isinstance(before, BinMap) else "workspace_map",
        frame=frame,
        tolerance_m=tolerance_m,
        tolerance_deg=tolerance_deg,
        frames_before=len(all_a),
        frames_after=len(all_b),
        common=len(a),
        reached_before=int(was.sum()),
        reached_after=int(now.sum()),
        gained=int(gained.sum()),
        lost=int(lost.sum()),
        p_value=p_value,
        change_low=100.0 * low,
        change_high=100.0 * high,
        path_length_before=_mean(a.path_length_rad[both]),
        path_length_after=_mean(b.path_length_rad[both]),
        squares=_squares(a.square, was, now),
        losses=_causes(b, lost, after.body_pairs),
        gains=_causes(a, gained, before.body_pairs),
        cell_changes=cell_changes(before.provenance, after.provenance),
    )


def _nothing_common(
    record: WorkspaceMap | BinMap,
    frame: Frame,
    tolerance_m: float,
    tolerance_deg: float,
) -> str:
    text = (
        "the maps have no test frame in common "
        f"(within {tolerance_m * 1000:g} mm and {tolerance_deg:g} degrees)"
    )
    if isinstance(record, BinMap) and frame == "robot_base":
        text += "; if the bin was moved, --frame bin compares relative to the bin"
    return text


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _squares(square: FloatArray, was: BoolArray, now: BoolArray) -> SquareChange:
    x, y, z = (merge_coordinates([square[:, axis]]) for axis in range(3))
    place = tuple(
        np.abs(square[:, axis, None] - values).argmin(axis=1)
        for axis, values in ((2, z), (1, y), (0, x))
    )
    shape = (len(z), len(y), len(x))
    frames, before, after = (
        np.bincount(
            np.ravel_multi_index(place, shape),
            weights=weight.astype(float),
            minlength=int(np.prod(shape)),
        ).astype(np.int64)
        for weight in (np.ones(len(was)), was, now)
    )
    there = frames > 0
    p_value = np.full(frames.shape, np.nan)
    p_value[there] = fisher_exact(
        before[there], frames[there], after[there], frames[there]
    )
    significant = np.zeros(frames.shape, bool)
    significant[there] = benjamini_hochberg(p_value[there])
    return SquareChange(
        x=x,
        y=y,
        z=z,
        frames=frames.reshape(shape),
        before=before.reshape(shape),
        after=after.reshape(shape),
        p_value=p_value.reshape(shape),
        significant=significant.reshape(shape),
    )


def _causes(
    table: FrameTable, chosen: BoolArray, body_pairs: tuple[str, ...]
) -> tuple[Cause, ...]:
    """Count states and pairs of some frames, the most frequent first."""
    count: Counter[tuple[int, int]] = Counter(
        zip(
            table.status[chosen].tolist(),
            table.blocking_pair[chosen].tolist(),
            strict=True,
        )
    )
    return tuple(
        Cause(
            state=STATUS_NAMES[Status(status)],
            pair=body_pairs[pair] if pair >= 0 else "",
            count=number,
        )
        for (status, pair), number in sorted(
            count.items(), key=lambda item: (-item[1], item[0])
        )
    )
