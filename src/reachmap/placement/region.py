"""Where the bin may stand: the cell's limits, the user's, and the map's extent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model import PlacementSpec
from reachmap.errors import SettingsError

AXES = ("x", "y", "z", "yaw")
SLACK = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """Ranges of the bin's pose: x, y, z of the inner bottom [m], yaw [rad].

    Attributes
    ----------
    low, high : array, shape (4,)
        ``low == high`` where a value is fixed.
    """

    low: FloatArray
    high: FloatArray

    def outside(self, pose: FloatArray) -> str:
        """Name of the first value of a pose (4,) that is outside, or ""."""
        for k, name in enumerate(AXES):
            value = float(pose[k])
            if name == "yaw":
                # A bin turned by half a turn is the same bin.
                middle = (self.low[k] + self.high[k]) / 2
                value = middle + (value - middle + np.pi / 2) % np.pi - np.pi / 2
            if not self.low[k] - SLACK <= value <= self.high[k] + SLACK:
                return name
        return ""

    def fixed(self, name: str) -> bool:
        """Whether a value may not change."""
        k = AXES.index(name)
        return bool(self.high[k] - self.low[k] <= SLACK)


def region_of(
    spec: PlacementSpec,
    lattice: Mapping[str, FloatArray],
    *,
    limits: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
) -> Region:
    """Intersect what the cell, the map and the user allow.

    Parameters
    ----------
    spec : PlacementSpec
    lattice : mapping
        ``x``, ``y``, ``z`` to what the map covers, for what the cell leaves open [m].
    limits : mapping, optional
        ``x``, ``y``, ``z`` to (low, high) [m], from the user.
    fixed : mapping, optional
        ``x``, ``y``, ``z`` [m], ``yaw`` [rad] to a value.

    Raises
    ------
    SettingsError
        Nothing is left of a range.
    """
    yaw = np.radians(spec.yaw_deg)
    ranges: dict[str, tuple[float, float]] = {
        name: getattr(spec, name) or (float(values.min()), float(values.max()))
        for name, values in lattice.items()
    }
    ranges["yaw"] = (float(yaw[0]), float(yaw[1]))
    for name, (low, high) in (limits or {}).items():
        ranges[name] = (max(low, ranges[name][0]), min(high, ranges[name][1]))
    for name, value in (fixed or {}).items():
        ranges[name] = (value, value)
    for name, (low, high) in ranges.items():
        if low > high:
            raise SettingsError(
                f"no value of {name} is left: {low:g} to {high:g} after the cell's "
                "placement limits and the region"
            )
    return Region(
        low=np.array([ranges[n][0] for n in AXES]),
        high=np.array([ranges[n][1] for n in AXES]),
    )
