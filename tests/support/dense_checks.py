"""Dense collision checks on the original meshes, apart from the program's own."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from reachmap.core.collision.bodies import build_geometry


def dense_free(scene, q_from, q_to, *, margin_m, share=1 / 3):
    """Whether a motion is free at a share of the verification distance."""
    bodies = build_geometry(scene.robot, scene.loaded, with_bin=scene.with_bin)
    model, geometry = scene.robot.model, bodies.geometry
    data, placed = model.createData(), geometry.createData()
    for request in placed.collisionRequests:
        request.security_margin = margin_m
    change = q_to - q_from
    length_m = float(np.abs(change) @ scene.checker.reach_m)
    step = share * scene.motions.verification_distance_m
    count = max(1, int(np.ceil(length_m / step)))
    return not any(
        pin.computeCollisions(
            model, data, geometry, placed, q_from + k / count * change, True
        )
        for k in range(count + 1)
    )
