"""Clearance of the best paths of a bin map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap.maps.records import BinMap
from reachmap.maps.summary.statistics import attempted

# The usual safety margin, what a bin that is put down by hand is off by, and what one
# on a pallet is.
STEPS_M = (0.002, 0.005, 0.010)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearanceShare:
    """Test grasps whose best path keeps a clearance.

    Attributes
    ----------
    clearance_m : float
    frames : float
        Share of the test grasps [percent].
    """

    clearance_m: float
    frames: float


def clearance_shares(record: BinMap) -> tuple[ClearanceShare, ...]:
    """Share of test grasps by clearance of their best path; empty if unknown."""
    tried = int(attempted(record).sum())
    if record.margins is None or not tried:
        return ()
    clearance = np.nan_to_num(record.margins.clearance, nan=-1.0)
    return tuple(
        ClearanceShare(
            clearance_m=step, frames=100.0 * int((clearance >= step).sum()) / tried
        )
        for step in STEPS_M
    )
