"""Initial candidates: a lattice around the bin, as far as the arm reaches.

The base faces the bin at each as it does where the cell has it.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.placement.mapped.exact import Pose
from reachmap.placement.predicted.region import Region

# Reach is that of random configurations; the longest of this many is short by little.
REACH_SAMPLES, REACH_SLACK = 500, 1.02
# A step is this share of the reach, and not smaller than this [m].
STEPS_IN_REACH, LEAST_STEP_M = 7, 0.10
# Heights beside the present one that are looked at by default [m].
HEIGHTS_M = 0.30


def reach_m(kinematics: Kinematics) -> float:
    """Upper bound of the TCP's distance from robot_base [m]."""
    robot = kinematics.robot
    rng = np.random.default_rng(0)
    half_turn = np.where(robot.is_revolute, np.pi, np.inf)
    low = np.maximum(robot.lower_rad, -half_turn)
    high = np.minimum(robot.upper_rad, half_turn)
    Q = rng.uniform(low, np.maximum(high, low), (REACH_SAMPLES, robot.dof))
    away = np.linalg.norm(kinematics.forward_many(Q)[:, :3, 3], axis=1)
    return float(np.round(REACH_SLACK * away.max(), 6))


def base_region(
    own: Pose,
    reach: float,
    limits: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float],
) -> Region:
    """Where the base may stand, in the level frame.

    Parameters
    ----------
    own : pose
        Where the cell has it.
    reach : float
        Limits x and y by default, around the bin [m].
    limits : mapping
        ``x``, ``y``, ``z`` to (low, high) [m].
    fixed : mapping
        ``x``, ``y``, ``z`` [m], ``yaw`` [rad] to a value.
    """
    ranges = {
        "x": (-reach, reach),
        "y": (-reach, reach),
        "z": (own[2] - HEIGHTS_M, own[2] + HEIGHTS_M),
        "yaw": (-np.pi, np.pi),
    }
    ranges |= dict(limits)
    ranges |= {name: (value, value) for name, value in fixed.items()}
    low, high = (np.array([ranges[n][k] for n in ranges]) for k in (0, 1))
    return Region(low=low, high=high, period_rad=2.0 * np.pi)


def base_lattice(
    region: Region, own: Pose, reach: float, *, around_bin: bool = True
) -> list[Pose]:
    """Poses at even distances.

    The lattice has the present place among its points where the region allows.

    Parameters
    ----------
    region : Region
    own : pose
    reach : float
        Distances are a share of it [m].
    around_bin : bool
        Leave out places from which the bin, at the origin, is out of reach.
    """
    step = max(reach / STEPS_IN_REACH, LEAST_STEP_M)
    axes = [
        axis_values(float(region.low[k]), float(region.high[k]), own[k], step)
        for k in range(3)
    ]
    found = []
    for x, y, z in itertools.product(*axes):
        if not around_bin or np.linalg.norm([x, y, z]) <= reach:
            yaw = facing(region, own, x, y)
            found.append((x, y, z, yaw))
    return found


def axis_values(low: float, high: float, own: float, step: float) -> list[float]:
    """Values from low to high through an own one; both ends where none fits."""
    first, last = (
        np.ceil((low - own) / step - 1e-9),
        np.floor((high - own) / step + 1e-9),
    )
    values = own + step * np.arange(first, last + 1)
    if not len(values):
        values = np.unique([low, high])
    return [round(float(v), 9) + 0.0 for v in values]


def facing(region: Region, own: Pose, x: float, y: float) -> float:
    """Heading that keeps the bin in its present direction, within the region [rad]."""
    low, high = float(region.low[3]), float(region.high[3])
    near = min(np.hypot(x, y), np.hypot(own[0], own[1])) < LEAST_STEP_M
    turn = 0.0 if near else float(np.arctan2(-y, -x) - np.arctan2(-own[1], -own[0]))
    turn = (own[3] + turn + np.pi) % (2.0 * np.pi) - np.pi
    return round(float(np.clip(turn, low, high)), 9) + 0.0


def smoothed(poses: Sequence[Pose], values: Sequence[float]) -> FloatArray:
    """Average of each value and the mean of its neighbours on the lattice.

    Of places that promise as much, those with good places around them come first; a
    place that is missing counts 0.
    """
    P = np.array(poses)[:, :3]
    index = np.column_stack(
        [np.unique(np.round(P[:, k], 6), return_inverse=True)[1] for k in range(3)]
    )
    axes = [k for k in range(3) if index[:, k].max() > 0]
    known = {tuple(row): v for row, v in zip(index.tolist(), values, strict=True)}
    result = np.array(values, float)
    for row, place in enumerate(index.tolist()):
        around = []
        for k, by in itertools.product(axes, (-1, 1)):
            moved = list(place)
            moved[k] += by
            around.append(known.get(tuple(moved), 0.0))
        if around:
            result[row] = (values[row] + float(np.mean(around))) / 2.0
    return result
