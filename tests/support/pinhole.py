"""A pinhole camera by hand: z ahead, x right, y down, angles from the middle.

from tests.support.pinhole import corners_of, sees
"""

from __future__ import annotations

import math

import numpy as np


def corners_of(inner, height_m):
    """Corners of a box on the bin's inner bottom, bin frame, lower four first."""
    x, y = inner[0] / 2, inner[1] / 2
    return np.array(
        [
            (sx * x, sy * y, z)
            for z in (0.0, height_m)
            for sx in (-1, 1)
            for sy in (-1, 1)
        ]
    )


def sees(camera, T_world_camera, point, *, in_range, border=0.0):
    """Whether a point is in the picture, and in range in the given sense.

    ``in_range`` is "along the axis", "at all" (along the line of sight, the far end
    only) or "" for the picture alone; ``border`` is a share of the half picture that
    does not count, at each edge.
    """
    offset = np.asarray(point) - T_world_camera[:3, 3]
    u, v, w = (float(offset @ T_world_camera[:3, k]) for k in range(3))
    half_u, half_v = (
        math.atan((1.0 - border) * math.tan(math.radians(angle) / 2))
        for angle in camera.field_of_view_deg
    )
    in_picture = w > 0 and abs(math.atan2(u, w)) <= half_u + 1e-9
    in_picture = in_picture and abs(math.atan2(v, w)) <= half_v + 1e-9
    near, far = camera.range_m
    if in_range == "along the axis":
        return in_picture and near - 1e-6 <= w <= far + 1e-6
    if in_range == "at all":
        return in_picture and math.dist(point, T_world_camera[:3, 3]) <= far + 1e-6
    return in_picture
