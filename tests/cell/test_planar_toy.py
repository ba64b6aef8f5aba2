"""The planar toy cell is what its comment says: closed-form answers."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.core.scene import Scene
from reachmap.geometry import yaw_transform

L1, L2, L3 = 0.4, 0.2, 0.1
BLOCKED_RAD = np.arcsin((0.01 + 0.01 + 0.002) / 0.06)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """The toy cell with its bin."""
    return Scene.build(read_cell("planar-toy"))


def test_forward_kinematics_is_a_sum_of_three_links(scene: Scene) -> None:
    """The TCP stays in the plane, its x axis along the last link."""
    rng = np.random.default_rng(1)
    for q in rng.uniform(-np.pi, np.pi, (20, 3)):
        a, b, c = np.cumsum(q)
        x = L1 * np.cos(a) + L2 * np.cos(b) + L3 * np.cos(c)
        y = L1 * np.sin(a) + L2 * np.sin(b) + L3 * np.sin(c)
        assert np.allclose(scene.kinematics.forward(q), yaw_transform(x, y, 0.0, c))


def test_free_space_is_that_of_the_first_joint(scene: Scene) -> None:
    """Only link 1 meets the post, within the angle of the comment."""
    rng = np.random.default_rng(2)
    Q = rng.uniform(-np.pi, np.pi, (2000, 3))
    Q[::2, 0] = rng.uniform(-2 * BLOCKED_RAD, 2 * BLOCKED_RAD, 1000)
    Q = Q[np.abs(np.abs(Q[:, 0]) - BLOCKED_RAD) > 1e-4]
    free = scene.checker.free_mask(Q)
    assert (free == (np.abs(Q[:, 0]) > BLOCKED_RAD)).all()


def test_inverse_kinematics_has_the_closed_form(scene: Scene) -> None:
    """Two solutions inside the annulus of the wrist, none outside."""
    rng = np.random.default_rng(3)
    for x, y, yaw in rng.uniform([-0.8, -0.8, -np.pi], [0.8, 0.8, np.pi], (60, 3)):
        wrist = np.hypot(x - L3 * np.cos(yaw), y - L3 * np.sin(yaw))
        Q = scene.kinematics.solve(yaw_transform(x, y, 0.0, yaw))
        inside = L1 - L2 < wrist < L1 + L2
        assert len(Q) == (2 if inside else 0)
