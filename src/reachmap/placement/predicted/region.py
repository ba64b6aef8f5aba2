"""Where the bin may stand: the cell's limits, the user's, and the map's extent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import PlacementSpec
from reachmap.errors import SettingsError

AXES = ("x", "y", "z", "yaw")
# Rounding of limits [m, rad].
SLACK = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """Ranges of a pose: x, y, z [m], yaw [rad].

    The bin's are those of the inner bottom in the cell's level frame, see
    :meth:`Cell.T_base_level`.

    Attributes
    ----------
    low, high : array, shape (4,)
        ``low == high`` where a value is fixed.
    period_rad : float
        Turn after which all is as before; half a turn for a bin.
    """

    low: FloatArray
    high: FloatArray
    period_rad: float = np.pi

    def outside(self, pose: FloatArray) -> str:
        """Name of the first value of a pose (4,) that is outside, or ""."""
        for k, name in enumerate(AXES):
            value = float(pose[k])
            low, high = self.low[k], self.high[k]
            if not _is_inside(name, value, low, high, self.period_rad):
                return name
        return ""

    def rounded(
        self, pose: tuple[float, float, float, float]
    ) -> tuple[float, float, float, float]:
        """A pose without rounding errors, turned into the range of angles."""
        x, y, z, yaw = pose
        low = float(self.low[3])
        within = low + (yaw - low + SLACK) % self.period_rad - SLACK
        return (round(x, 9), round(y, 9), round(z, 9), round(within, 9))

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
        Nothing is left of a range, or a fixed value is outside.
    """
    yaw = np.radians(spec.yaw_deg)
    ranges: dict[str, tuple[float, float]] = {
        name: getattr(spec, name) or (float(values.min()), float(values.max()))
        for name, values in lattice.items()
    }
    ranges["yaw"] = (float(yaw[0]), float(yaw[1]))
    for name, wanted in (limits or {}).items():
        low, high = ranges[name]
        ranges[name] = (max(low, wanted[0]), min(high, wanted[1]))
        if ranges[name][0] > ranges[name][1]:
            said = f"{name} from {wanted[0]:g} to {wanted[1]:g}"
            raise SettingsError(f"{said} leaves no place: {_only(name, low, high)}")
    for name, value in (fixed or {}).items():
        if not _is_inside(name, value, *ranges[name]):
            said = f"{name} = {np.degrees(value) if name == 'yaw' else value:g}"
            raise SettingsError(f"{said} is not possible: {_only(name, *ranges[name])}")
        ranges[name] = (value, value)
    return Region(
        low=np.array([ranges[n][0] for n in AXES]),
        high=np.array([ranges[n][1] for n in AXES]),
    )


def _is_inside(
    name: str, value: float, low: float, high: float, period: float = np.pi
) -> bool:
    if name == "yaw":
        middle = (low + high) / 2
        value = middle + (value - middle + period / 2) % period - period / 2
    return low - SLACK <= value <= high + SLACK


def _only(name: str, low: float, high: float) -> str:
    """What the cell's placement limits, the map and the user's region leave."""
    if name == "yaw":
        low, high = float(np.degrees(low)), float(np.degrees(high))
    return (
        f"the bin may stand only from {low:g} to {high:g} (the map, the cell's "
        "placement limits and the region)"
    )
