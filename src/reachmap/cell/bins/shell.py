"""Whether the mesh of a bin and its inner size describe the same bin."""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.bodies import BinSpec
from reachmap.cell.model.shapes import TriangleMesh

# Corners are rounded and bottoms are ribbed, so smaller differences are not told.
SLACK_M = 5e-3
# Points of the inner bottom that are looked at, as shares of its half sides.
PLACES = ((0.0, 0.0), (0.5, 0.5), (-0.5, 0.5), (0.5, -0.5), (-0.5, -0.5))


def surface_heights(mesh: TriangleMesh, points: FloatArray) -> FloatArray:
    """Height of the surface that is seen from above at points (n, 2); -inf: none [m].

    A vertical line that meets an edge meets both triangles there.
    """
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    u, v = (b - a)[:, :2], (c - a)[:, :2]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    level = np.abs(area) > 0.0
    found = np.full(len(points), -np.inf)
    for k, point in enumerate(points):
        p = point - a[level, :2]
        s = (p[:, 0] * v[level, 1] - p[:, 1] * v[level, 0]) / area[level]
        t = (u[level, 0] * p[:, 1] - u[level, 1] * p[:, 0]) / area[level]
        inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1.0 + 1e-9)
        z = a[level, 2] + s * (b - a)[level, 2] + t * (c - a)[level, 2]
        found[k] = z[inside].max(initial=-np.inf)
    return found


def place_doubt(spec: BinSpec, mesh: TriangleMesh) -> str:
    """Why the inner bottom is not where ``inner`` has it; "" where it is."""
    # Adding 0.0 turns -0.0 into 0.0, which reads better.
    low, high = (
        np.round(end(mesh.vertices, axis=0)[:2], 6) + 0.0 for end in (np.min, np.max)
    )
    half = np.array(spec.inner[:2]) / 2.0
    rule = "its origin must be the centre of the inner bottom, z out of the bin"
    if (low > SLACK_M - half).any() or (high < half - SLACK_M).any():
        x, y = (f"{a:.3f} to {b:.3f}" for a, b in zip(low, high, strict=True))
        return (
            f"it reaches from {x} m in x and from {y} m in y, and inner is "
            f"{spec.inner[0]:g} x {spec.inner[1]:g} m; {rule}"
        )
    heights = surface_heights(mesh, half * np.array(PLACES))
    if np.isneginf(heights).any():
        x, y = half * np.array(PLACES[int(np.argmin(heights))])
        return (
            f"it has no bottom at x = {x:.3g}, y = {y:.3g} m; what lies there is open"
        )
    height = float(np.median(heights))
    if abs(height) > SLACK_M:
        where = "above" if height > 0 else "below"
        return f"its bottom is {1e3 * abs(height):.0f} mm {where} the origin; {rule}"
    return ""


def size_doubt(spec: BinSpec, mesh: TriangleMesh) -> str:
    """What ``bottom`` and ``wall`` should say of the mesh; "" where they do.

    What a bin stands on is judged by them, mesh or not.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    below = float(-low[2])
    if abs(below - spec.bottom_m) > SLACK_M:
        return (
            f"it reaches {1e3 * below:.0f} mm below the inner bottom, and bottom is "
            f"{1e3 * spec.bottom_m:.0f} mm; give bottom: {below:.3g}"
        )
    outer = 2.0 * np.maximum(-low, high)[:2]
    if (np.abs(outer - spec.outer[:2]) > 2.0 * SLACK_M).any():
        x, y = ((outer - spec.inner[:2]) / 2.0).tolist()
        return (
            f"it is {outer[0]:.3g} x {outer[1]:.3g} m outside, and inner and wall "
            f"make {spec.outer[0]:.3g} x {spec.outer[1]:.3g} m; "
            f"give wall: [{x:.3g}, {y:.3g}]"
        )
    return ""
