"""Conversions of rotations against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reachmap.geometry import (
    quaternion_wxyz_from_rotation,
    rotation_from_quaternion_wxyz,
    rotation_from_rpy_deg,
)

HALF_TURNS = np.pi * np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0], [0, 0.6, -0.8], [-0.6, 0, 0.8]]
)


@pytest.fixture(scope="module")
def rotations():
    """Rotations at random, next to none, and by half turns."""
    rng = np.random.default_rng(5)
    vectors = [rng.normal(size=(5000, 3)), rng.normal(size=(100, 3)) * 1e-9, HALF_TURNS]
    return Rotation.from_rotvec(np.vstack([*vectors, np.zeros((1, 3))]))


def test_quaternions_from_rotations(rotations):
    """They agree with scipy's canonical ones, whatever the shape."""
    R = rotations.as_matrix()
    expected = np.roll(rotations.as_quat(canonical=True), 1, axis=1)
    found = quaternion_wxyz_from_rotation(R)
    # Of a half turn, w is rounding, and the sign of the rest hangs on it.
    same = np.abs((found * expected).sum(axis=1))
    np.testing.assert_allclose(same, 1.0, atol=1e-14)
    np.testing.assert_allclose(found[:5000], expected[:5000], atol=1e-14)
    assert (found[:, 0] >= 0).all()
    blocks = quaternion_wxyz_from_rotation(R[:30].reshape(2, 5, 3, 3, 3))
    np.testing.assert_array_equal(blocks.reshape(-1, 4), found[:30])


def test_rotations_from_quaternions(rotations):
    """Of any length, they give the rotation; zero is refused."""
    q = np.roll(rotations.as_quat(), 1, axis=1)
    R = rotation_from_quaternion_wxyz(q * 3.0)
    np.testing.assert_allclose(R, rotations.as_matrix(), atol=1e-14)
    assert rotation_from_quaternion_wxyz(q[0]).shape == (3, 3)
    with pytest.raises(ValueError, match="length 0"):
        rotation_from_quaternion_wxyz(np.zeros(4))


def test_roll_pitch_yaw():
    """They turn about fixed axes, x first."""
    angles = np.random.default_rng(6).uniform(-400, 400, (4, 50, 3))
    expected = Rotation.from_euler("xyz", angles.reshape(-1, 3), degrees=True)
    found = rotation_from_rpy_deg(angles)
    np.testing.assert_allclose(
        found.reshape(-1, 3, 3), expected.as_matrix(), atol=1e-13
    )
    assert rotation_from_rpy_deg([0, 0, 90]).shape == (3, 3)
