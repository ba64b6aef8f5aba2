"""The closed form of the UR5, an oracle that shares nothing with the solver.

Frames: ``base`` (the controller's, a half turn from base_link) to ``tool0``.
"""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray

D1, A2, A3, D4, D5, D6 = 0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823


def link(a: float, d: float, alpha: float, theta: float) -> FloatArray:
    """Denavit–Hartenberg transform."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [c, -s * ca, s * sa, a * c],
            [s, c * ca, -c * sa, a * s],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def forward(q: FloatArray) -> FloatArray:
    """Pose of tool0 in base."""
    h = np.pi / 2
    rows = ((0, D1, h), (A2, 0, 0), (A3, 0, 0), (0, D4, h), (0, D5, -h), (0, D6, 0))
    T = np.eye(4)
    for (a, d, alpha), theta in zip(rows, q, strict=True):
        T = T @ link(a, d, alpha, theta)
    return T


def arc_cosine(value: float) -> tuple[float, ...]:
    """Both angles of a cosine, or none."""
    if abs(value) > 1 + 1e-9:
        return ()
    angle = float(np.arccos(np.clip(value, -1.0, 1.0)))
    return (angle, -angle)


def inverse(T: FloatArray) -> FloatArray:
    """All branches of a pose away from singularities, shape (m, 6)."""
    n, o, a, p = (T[:3, k] for k in range(4))
    p5 = p - D6 * a
    radius = float(np.hypot(p5[0], p5[1]))
    solutions = []
    for psi in arc_cosine(D4 / radius) if radius > 0 else ():
        q1 = np.arctan2(p5[1], p5[0]) + np.pi / 2 + psi
        s1, c1 = np.sin(q1), np.cos(q1)
        for q5 in arc_cosine((p[0] * s1 - p[1] * c1 - D4) / D6):
            s5 = np.sin(q5)
            q6 = np.arctan2(-(o[0] * s1 - o[1] * c1) / s5, (n[0] * s1 - n[1] * c1) / s5)
            T01 = link(0, D1, np.pi / 2, q1)
            T46 = link(0, D5, -np.pi / 2, q5) @ link(0, D6, 0, q6)
            T14 = np.linalg.inv(T01) @ T @ np.linalg.inv(T46)
            p13 = T14[:3, 3] - D4 * T14[:3, 1]
            cosine = (p13[0] ** 2 + p13[1] ** 2 - A2**2 - A3**2) / (2 * A2 * A3)
            for q3 in arc_cosine(cosine):
                q2 = np.arctan2(p13[1], p13[0]) - np.arctan2(
                    A3 * np.sin(q3), A2 + A3 * np.cos(q3)
                )
                q4 = np.arctan2(T14[1, 0], T14[0, 0]) - q2 - q3
                solutions.append([q1, q2, q3, q4, q5, q6])
    return np.array(solutions, float).reshape(-1, 6)


def wrist_centre_over_base(q: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Change joint 2 (and 3) so that the shoulder is singular: p5 on the base axis.

    There the branch of joint 1 is not determined: ‖p5xy‖ = d4.
    """
    for _ in range(100):
        grid = np.linspace(-np.pi, np.pi, 25)
        values = [_offset(q, q2) for q2 in grid]
        for k in range(len(grid) - 1):
            if values[k] * values[k + 1] < 0:
                return np.array([q[0], _root(q, grid[k], grid[k + 1]), *q[2:]])
        q = np.array([*q[:2], rng.uniform(-np.pi, np.pi), *q[3:]])
    raise AssertionError("no shoulder singularity found")


def _offset(q: FloatArray, q2: float) -> float:
    T = forward(np.array([q[0], q2, *q[2:]]))
    p5 = T[:3, 3] - D6 * T[:3, 2]
    return float(p5[0] * np.cos(q[0]) + p5[1] * np.sin(q[0]))


def _root(q: FloatArray, low: float, high: float) -> float:
    sign = np.sign(_offset(q, low))
    for _ in range(60):
        middle = (low + high) / 2
        if np.sign(_offset(q, middle)) == sign:
            low = middle
        else:
            high = middle
    return (low + high) / 2
