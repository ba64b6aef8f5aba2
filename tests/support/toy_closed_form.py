"""Reachability of the planar toy arm on paper: two links, a wrist and a post."""

from __future__ import annotations

import numpy as np

LINKS = (0.4, 0.2, 0.1)
POST_ANGLE = float(np.arcsin((0.01 + 0.01 + 0.002) / 0.06))


def joint_1_solutions(x: float, y: float, yaw: float) -> list[float]:
    """Values of joint 1 with which the TCP reaches (x, y) at a yaw."""
    a, b, c = LINKS
    wrist = np.array([x - c * np.cos(yaw), y - c * np.sin(yaw)])
    distance = float(np.hypot(*wrist))
    cosine = (distance**2 - a**2 - b**2) / (2 * a * b)
    if abs(cosine) > 1:
        return []
    elbow = float(np.arccos(cosine))
    direction = float(np.arctan2(wrist[1], wrist[0]))
    solutions = []
    for bend in {elbow, -elbow}:
        inner = np.arctan2(b * np.sin(bend), a + b * np.cos(bend))
        solutions.append(float((direction - inner + np.pi) % (2 * np.pi) - np.pi))
    return solutions


def verdict(x: float, y: float, yaw: float) -> str:
    """What a scan from joint_1 > 0 finds: no_ik, blocked, behind or reachable."""
    solutions = joint_1_solutions(x, y, yaw)
    if not solutions:
        return "no_ik"
    free = [q for q in solutions if abs(q) > POST_ANGLE]
    if not free:
        return "blocked"
    return "reachable" if any(q > 0 for q in free) else "behind"


def margin(x: float, y: float, yaw: float) -> float:
    """How far a frame is from where its verdict changes [m or rad]."""
    a, b, c = LINKS
    distance = float(np.hypot(x - c * np.cos(yaw), y - c * np.sin(yaw)))
    edges = [abs(distance - (a + b)), abs(distance - (a - b))]
    edges += [
        min(abs(abs(q) - POST_ANGLE), np.pi - abs(q))
        for q in joint_1_solutions(x, y, yaw)
    ]
    return min(edges)
