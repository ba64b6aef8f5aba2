"""Why nothing is reachable, in one line: the most likely cause, with counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reachmap._typing import CodeArray, IntArray
from reachmap.maps.records import BinMap, Status, WorkspaceMap
from reachmap.maps.summary.statistics import STATUS_NAMES, frames_of

REMEDIES = {
    Status.NO_IK: "the arm cannot reach these tool poses: check the position of the "
    "cubes or the bin, robot.tcp and its approach_axis, and the orientations",
    Status.APPROACH_BLOCKED: "the straight approach of bin_scan.approach_distance_m is "
    "not free",
    Status.NO_PATH_FOUND: "there are free configurations, but no path to them: check "
    "the scan configuration, the joint limits and the obstacles around the arm",
}


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
