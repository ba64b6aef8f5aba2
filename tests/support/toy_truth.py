"""The planar toy arm: what it can reach, in closed form, and grasps to try it on."""

from __future__ import annotations

from typing import Any

import numpy as np

L1, L2, L3 = 0.4, 0.2, 0.1
BLOCKED_RAD = float(np.arcsin((0.01 + 0.01 + 0.002) / 0.06))
# A bin that the limit of the arm and the post's shadow both run through.
OVERRIDES = ("bin.pose.xyz=[0.42,0.22,-0.2]", "bin_scan.repeats=1")


def slack_of(x: float, y: float, yaw: float) -> float:
    """How far a tool pose is from the limit of what can be reached; negative if not.

    The wrist must lie in the annulus of the first two links. The arm starts with joint
    1 on the left of the post and cannot pass it, so one of the two elbow solutions must
    have joint 1 between the post and half a turn.
    """
    wrist = np.array([x - L3 * np.cos(yaw), y - L3 * np.sin(yaw)])
    r = float(np.hypot(*wrist))
    annulus = min(r - (L1 - L2), L1 + L2 - r)
    if annulus <= 0:
        return annulus
    bearing = np.arctan2(wrist[1], wrist[0])
    inner = np.arccos((L1**2 + r**2 - L2**2) / (2 * L1 * r))
    shoulders = np.array([bearing - inner, bearing + inner])
    shoulders = (shoulders + np.pi) % (2 * np.pi) - np.pi
    return min(annulus, float((shoulders - BLOCKED_RAD).max()))


def clear_rows(count: int, seed: int) -> np.ndarray:
    """Poses x, y, yaw inside the bin, none near the limit of the arm, (count, 3)."""
    rng = np.random.default_rng(seed)
    low, high = [0.24, 0.09, -np.pi], [0.60, 0.35, np.pi]
    rows = rng.uniform(low, high, (20 * count, 3))
    clear = [row for row in rows if abs(slack_of(*row)) > 0.01]
    return np.array(clear[:count])


def toy_grasps(rows: np.ndarray, **header: Any) -> dict[str, Any]:
    """A document of oriented grasps x, y, yaw in robot_base."""
    grasps = [
        {
            "id": f"g{k}",
            "position": [float(x), float(y), 0.0],
            "quaternion_wxyz": [float(np.cos(yaw / 2)), 0, 0, float(np.sin(yaw / 2))],
        }
        for k, (x, y, yaw) in enumerate(rows)
    ]
    return {
        "format": "reachmap.grasps",
        "format_version": "1.0",
        "frame": "robot_base",
        "approach_axis": "+x",
        **header,
        "grasps": grasps,
    }
