"""Joint limits: those of the URDF and of the cell, the tightest wins.

The limits of a MoveIt file are part of the cell once it is loaded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import JointLimits
from reachmap.core.robot.urdf_joints import UNBOUNDED
from reachmap.errors import SceneError


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitTable:
    """Limits of the joints that move; radians, or metres for a prismatic joint.

    Attributes
    ----------
    lower, upper : array, shape (dof,)
        Positions [rad].
    velocity : array, shape (dof,)
        Speeds [rad/s], the cell's scaling applied.
    acceleration : array, shape (dof,)
        Accelerations [rad/s²], the cell's scaling applied.
    """

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class JointRange:
    """What the URDF says about one joint; 0 as velocity means "not given"."""

    name: str
    kind: str
    lower: float
    upper: float
    velocity: float


def merge_limits(joints: Sequence[JointRange], cell: JointLimits) -> LimitTable:
    """Intersect the limits of URDF and cell.

    Parameters
    ----------
    joints : sequence of JointRange
        Limits of the URDF, in chain order.
    cell : JointLimits
        Limits of the cell; ``position_deg`` is in metres for prismatic joints.

    Raises
    ------
    SceneError
        A limit is missing or empty, or names a joint that does not move.
    """
    problems = _unknown_names(joints, cell)
    rows = [_position(j, cell, problems) for j in joints]
    velocity = _rates(joints, cell.velocity_rad_s, "velocity", problems)
    acceleration = _rates(joints, cell.acceleration_rad_s2, "acceleration", problems)
    if problems:
        raise SceneError(problems)
    lower, upper = np.array(rows, float).reshape(-1, 2).T
    return LimitTable(
        lower=lower.copy(),
        upper=upper.copy(),
        velocity=velocity * cell.scaling,
        acceleration=acceleration * cell.scaling,
    )


def _unknown_names(joints: Sequence[JointRange], cell: JointLimits) -> list[str]:
    names = [j.name for j in joints]
    problems = []
    for field in ("position_deg", "velocity_rad_s", "acceleration_rad_s2"):
        given = getattr(cell, field)
        unknown = sorted(set(given) - set(names)) if isinstance(given, dict) else []
        problems += [
            f"robot.limits.{field}: {name!r} is not a joint that moves "
            f"(joints: {', '.join(names)})"
            for name in unknown
        ]
    return problems


def _position(
    joint: JointRange, cell: JointLimits, problems: list[str]
) -> tuple[float, float]:
    turns = joint.kind != "prismatic"
    bounds = []
    if joint.kind != "continuous":
        bounds.append((joint.lower, joint.upper))
    if joint.name in cell.position_deg:
        low, high = cell.position_deg[joint.name]
        factor = math.pi / 180 if turns else 1.0
        bounds.append((low * factor, high * factor))
    if not bounds:  # a continuous joint that nobody bounds
        bounds.append((joint.lower, joint.upper))
    low, high = max(b[0] for b in bounds), min(b[1] for b in bounds)
    unit = "rad" if turns else "m"
    if max(abs(low), abs(high)) >= UNBOUNDED:
        problems.append(
            f"robot.limits.position_deg: joint {joint.name!r} has no limit in the URDF "
            f"(lower {low:.6g}, upper {high:.6g} {unit}); give it [low, high] here"
        )
    elif not (math.isfinite(low) and math.isfinite(high) and low < high):
        problems.append(
            f"robot.limits: joint {joint.name!r} has no range left "
            f"(lower {low:.6g}, upper {high:.6g} {unit})"
        )
    return low, high


def _rates(
    joints: Sequence[JointRange],
    given: float | Mapping[str, float] | None,
    what: str,
    problems: list[str],
) -> FloatArray:
    values, missing = [], []
    for joint in joints:
        candidates = [joint.velocity] if what == "velocity" else []
        if isinstance(given, Mapping):
            candidates.append(given.get(joint.name, 0.0))
        elif given is not None:
            candidates.append(given)
        known = [c for c in candidates if math.isfinite(c) and c > 0]
        if not known:
            missing.append(joint.name)
        values.append(min(known, default=math.nan))
    if missing:
        field = "velocity_rad_s" if what == "velocity" else "acceleration_rad_s2"
        problems.append(
            f"robot.limits.{field}: no {what} limit for {', '.join(missing)}; "
            f"give one number for all joints or one per joint"
        )
    return np.array(values, float)
