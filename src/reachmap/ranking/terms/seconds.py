"""Predicted seconds per pick, stage by stage.

A pick over a test grasp takes the time of its cycle, which is cut into the way to the
grasp, the stages that follow and the waits; to it come the planning effort and what a
failure costs times its probability.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray
from reachmap.maps.cycle.seconds import cycle_parts, failing_stage
from reachmap.maps.parts import StageStatus, freeze
from reachmap.maps.records import BinMap

PLANNING, FAILURE = "planning_s", "failure_s"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CycleSeconds:
    """Duration of picks at test grasps, by stage.

    Attributes
    ----------
    names : tuple of str, length k
        ``to_grasp_s``, each stage with ``_s``, ``waits_s``.
    values : array, shape (points, orientations, k)
        [s]; they add up to the cycle's time. NaN without a whole cycle.
    status : uint8 array, shape (points, orientations)
        :class:`StageStatus` of the first stage that fails; that of the grasp where
        none does or none was tried.
    """

    names: tuple[str, ...]
    values: FloatArray
    status: CodeArray

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def whole(self) -> BoolArray:
        """Where there is a whole cycle, shape (points, orientations)."""
        return np.isfinite(self.values[..., 0])

    def usual_failure_s(self) -> float:
        """Default cost of a failure: the median whole cycle of the map [s]."""
        if not self.whole.any():
            return 0.0
        return float(np.median(self.values[self.whole].sum(axis=-1)))


def cycle_seconds(bin_map: BinMap, status: CodeArray) -> CycleSeconds | None:
    """Cut the cycle times of a map into their parts; None where it has none.

    Parameters
    ----------
    bin_map : BinMap
    status : uint8 array, shape (points, orientations)
        Of the grasps themselves.
    """
    if bin_map.cycle is None:
        return None
    names, values = cycle_parts(bin_map)
    stage = failing_stage(bin_map.cycle)
    ended = np.take_along_axis(bin_map.cycle.status, stage[..., None], -1)
    lost = (status == StageStatus.PATH_FOUND) & (stage >= 0).reshape(status.shape)
    return CycleSeconds(
        names=names,
        values=values.reshape(*status.shape, len(names)),
        status=np.where(lost, ended.reshape(status.shape), status),
    )
