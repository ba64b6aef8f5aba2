"""Boxes around moving bodies hold every point of them, and not much more."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from reachmap.cell.loading import read_cell
from reachmap.core.collision.static_bodies import box_around
from reachmap.core.scene import Scene


def test_boxes_hold_the_bodies_of_the_shipped_cell():
    """Against the engine's own placements of all vertices and corners."""
    scene = Scene.build(read_cell("ur5-eye-in-hand"), with_bin=False)
    checker, robot = scene.checker, scene.robot
    Q = np.random.default_rng(0).uniform(robot.lower_rad, robot.upper_rad, (50, 6))
    low, high = checker.bound.boxes(Q)
    model, data = robot.body_model, robot.body_model.createData()
    placed = checker.bodies.createData()
    slack = []
    for row, q in enumerate(Q):
        pin.updateGeometryPlacements(model, data, checker.bodies, placed, q)
        for k, body in enumerate(checker.bound.on_chain.tolist()):
            shape = checker.bodies.geometryObjects[body].geometry
            T = robot.T_base_root @ np.array(placed.oMg[body].homogeneous)
            if hasattr(shape, "vertices"):
                points = np.asarray(shape.vertices()) @ T[:3, :3].T + T[:3, 3]
            else:
                # Middles of the faces of the box around a primitive lie on it.
                own = box_around(shape, np.eye(4))
                points = np.vstack([np.diag(own[0]), np.diag(own[1])])
                points = points @ T[:3, :3].T + T[:3, 3]
            assert (points >= low[row, k] - 1e-9).all()
            assert (points <= high[row, k] + 1e-9).all()
            slack.append(points.min(axis=0) - low[row, k])
    assert np.median(slack) < 0.03
