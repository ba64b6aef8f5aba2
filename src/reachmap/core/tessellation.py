"""Triangles for the primitive shapes, for pictures; nothing is checked on them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from reachmap._typing import FloatArray, IntArray

Triangles: TypeAlias = tuple[FloatArray, IntArray]
ROUND_STEPS = 48


def box_triangles(sides: FloatArray) -> Triangles:
    """Centred box with full sides (3,) [m]; faces share no corners.

    Returns
    -------
    vertices : array, shape (24, 3)
    triangles : int array, shape (12, 3)
        Indices of vertices, counter-clockwise seen from outside.
    """
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    faces = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            face = np.empty((4, 3))
            face[:, axis] = sign
            # Running backwards turns the face to the other side.
            face[:, [(axis + 1) % 3, (axis + 2) % 3]] = square[:: int(sign)]
            faces.append(face)
    vertices = np.concatenate(faces) * np.asarray(sides, float) / 2.0
    corner = 4 * np.arange(6)[:, None, None]
    triangles = corner + np.array([[0, 1, 2], [0, 2, 3]])
    return vertices, np.asarray(triangles.reshape(-1, 3), np.int64)


def revolved_triangles(profile: FloatArray, steps: int = ROUND_STEPS) -> Triangles:
    """Surface of revolution about z.

    Parameters
    ----------
    profile : array, shape (n, 2)
        Radius and height of points from the lower end to the upper one [m]; the first
        and the last lie on the axis.
    steps : int
        Corners of each ring.

    Returns
    -------
    vertices : array, shape (n * steps, 3)
    triangles : int array, shape (m, 3)
    """
    angle = np.linspace(0.0, 2.0 * np.pi, steps, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(steps)], axis=-1)
    up = np.array([0.0, 0.0, 1.0])
    vertices = np.concatenate([r * ring + z * up for r, z in profile])
    here = np.arange(steps)
    there = (here + 1) % steps
    strips = []
    for low in range(len(profile) - 1):
        a, b = steps * low, steps * (low + 1)
        if profile[low, 0] > 0:
            strips.append(np.stack([a + here, a + there, b + there], axis=-1))
        if profile[low + 1, 0] > 0:
            strips.append(np.stack([a + here, b + there, b + here], axis=-1))
    return vertices, np.asarray(np.concatenate(strips), np.int64)


def cylinder_triangles(radius: float, length: float) -> Triangles:
    """Centred cylinder about z; caps and side share no corners."""
    half = length / 2.0
    # Rings that occur twice keep the edges of the caps sharp.
    profile = [(0, -half), (radius, -half), (radius, -half)]
    profile += [(radius, half), (radius, half), (0, half)]
    return revolved_triangles(np.array(profile, float))


def capsule_triangles(radius: float, length: float) -> Triangles:
    """Cylinder about z with two half-spheres; ``length`` is without them."""
    angle = np.linspace(0.0, np.pi / 2.0, ROUND_STEPS // 4 + 1)
    cap = radius * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    cap[0, 0] = 0.0
    lower = cap * [1.0, -1.0] - np.array([0.0, length / 2.0])
    upper = np.array([0.0, length / 2.0]) + cap[::-1]
    return revolved_triangles(np.concatenate([lower, upper]))
