"""Algorithm 1 of the paper, loop by loop, written apart from the library.

Slow and plain on purpose: matrices, one grasp and one test grasp at a time, no
library code but the status codes. The decisions of the conventions page apply: what
ties within a micrometre and a microradian goes to the least cost, then to the first.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

TIE = 1e-6
INFINITE = float("inf")


def matrix_of(q: Any) -> list[list[float]]:
    """Rotation matrix of a quaternion wxyz."""
    w, x, y, z = (float(v) for v in q)
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def column(R: list[list[float]], axis: str) -> list[float]:
    """The signed axis of a frame."""
    sign = 1.0 if axis[0] == "+" else -1.0
    return [sign * row["xyz".index(axis[1])] for row in R]


def phi_1(d_nn: Any, d_test: Any) -> float:
    """Eq. (2)."""
    dx, dy, dz = (d_nn[0] - d_test[0], d_nn[1] - d_test[1], d_nn[2] - d_test[2])
    return math.sqrt(dx * dx + dy * dy + dz * dz)


def phi_2(R_nn: list[list[float]], R_test: list[list[float]]) -> float:
    """Eq. (3): the norm of the logarithm of R_nn R_testᵀ."""
    product = [
        [sum(R_nn[i][k] * R_test[j][k] for k in range(3)) for j in range(3)]
        for i in range(3)
    ]
    trace = product[0][0] + product[1][1] + product[2][2]
    axis = [
        product[2][1] - product[1][2],
        product[0][2] - product[2][0],
        product[1][0] - product[0][1],
    ]
    return math.atan2(math.sqrt(sum(v * v for v in axis)), trace - 1.0)


def axis_angle_between(a: list[float], b: list[float]) -> float:
    """Angle between two directions: φ2 minimised over the roll."""
    cross = [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
    return math.atan2(
        math.sqrt(sum(v * v for v in cross)),
        sum(p * q for p, q in zip(a, b, strict=True)),
    )


def mean(values: Any, found: Any) -> float:
    """Average over the successful attempts."""
    taken = [float(v) for v, ok in zip(values, found, strict=True) if ok]
    return sum(taken) / len(taken) if taken else INFINITE


class Oracle:
    """The look-up table as nested loops would build it."""

    def __init__(self, bin_map: Any, normalise: str = "quantile") -> None:
        self.normalise = normalise
        self.bin_map = bin_map
        self.axis = bin_map.approach_axis
        effort = bin_map.effort
        self.planning = (
            bin_map.planning_cpu_time
            if effort is None
            else effort.checks * effort.seconds_per_check
        )
        self.grasps: list[dict[str, Any]] = []
        nl, ny, nx, no = bin_map.status.shape
        for i_layer in range(nl):
            for i_y in range(ny):
                for i_x in range(nx):
                    for i_o in range(no):
                        self.grasps.append(self._test_grasp(i_layer, i_y, i_x, i_o))
        reached = [g for g in self.grasps if g["reachable"]]
        for name in ("length", "planning", "execution"):
            greatest = self._scale([g[name] for g in reached])
            for g in self.grasps:
                g["norm_" + name] = g[name] / greatest if g["reachable"] else INFINITE

    def _scale(self, values: list[float]) -> float:
        """The maximum, or the 95 % quantile by linear interpolation between ranks."""
        if self.normalise == "max" or not values:
            return max(values, default=0.0)
        ordered = sorted(values)
        place = 0.95 * (len(ordered) - 1)
        low = int(place)
        high = min(low + 1, len(ordered) - 1)
        return ordered[low] + (place - low) * (ordered[high] - ordered[low])

    def _test_grasp(self, *at: int) -> dict[str, Any]:
        m = self.bin_map
        found = m.path_found[at]
        R = matrix_of(m.quaternion_wxyz[at])
        return {
            "at": at,
            "d": m.position[at[:3]].tolist(),
            "R": R,
            "v": column(R, self.axis),
            "reachable": any(found),
            "length": mean(m.path_length[at], found),
            "planning": mean(self.planning[at], found),
            "execution": mean(m.execution_time[at], found),
        }

    def test_cost(self, g: dict[str, Any], weights: tuple[float, ...]) -> float:
        """J of one test grasp."""
        if not g["reachable"]:
            return INFINITE
        return (
            weights[0] * g["norm_length"]
            + weights[1] * g["norm_planning"]
            + weights[2] * g["norm_execution"]
        )

    def nearest(
        self, d: Any, v: Any, R: Any, free: bool, weights: tuple[float, ...]
    ) -> tuple[dict[str, Any], float, float]:
        """The test grasp of one grasp, φ1 and φ2."""
        distances = [phi_1(d, g["d"]) for g in self.grasps]
        least = min(distances)
        close = [
            (g, f1)
            for g, f1 in zip(self.grasps, distances, strict=True)
            if f1 <= least + TIE
        ]
        angles = []
        for g, _ in close:
            if free:
                angles.append(axis_angle_between(v, g["v"]))
            else:
                angles.append(phi_2(R, g["R"]))
        smallest = min(angles)
        best, best_cost, best_f = None, INFINITE, (0.0, 0.0)
        for (g, f1), f2 in zip(close, angles, strict=True):
            if f2 > smallest + TIE:
                continue
            cost = self.test_cost(g, weights)
            if best is None or round(cost, 12) < round(best_cost, 12):
                best, best_cost, best_f = g, cost, (f1, f2)
        assert best is not None
        return best, best_f[0], best_f[1]

    def rank(
        self,
        points: np.ndarray,
        directions: np.ndarray,
        rotations: np.ndarray | None,
        weights: tuple[float, ...] = (1.0, 1.0, 1.0),
    ) -> tuple[list[int], list[float], list[tuple[int, ...]]]:
        """Algorithm 1: costs by look-up, then a stable sort."""
        costs, matches = [], []
        for i in range(len(points)):
            free = rotations is None
            R = None if rotations is None else rotations[i].tolist()
            v = directions[i].tolist()
            g, _, _ = self.nearest(points[i].tolist(), v, R, free, weights)
            costs.append(self.test_cost(g, weights))
            matches.append(g["at"])
        order: list[int] = []
        for i in range(len(points)):
            place = len(order)
            while place > 0 and round(costs[order[place - 1]], 12) > round(
                costs[i], 12
            ):
                place -= 1
            order.insert(place, i)
        return order, costs, matches
