"""Regression over grasps: what it must return, and what may not matter to it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reachmap.sampling.regression import GraspRegression
from reachmap.sampling.volume import GraspVolume

LEVER_M = 0.3
VOLUME = GraspVolume(
    low=np.array([-0.2, -0.2, 0.0]),
    high=np.array([0.2, 0.2, 0.2]),
    cosines=(float(np.cos(np.radians(30))), 1.0),
)


def clears_wall(points, axes):
    """Whether tip and lever point are on the near side of a wall: a closed form."""
    return (points[:, 0] < 0.1) & ((points - LEVER_M * axes)[:, 0] < 0.12)


def fitted(count, seed=0):
    """A regression on random grasps before the wall."""
    points, axes = VOLUME.draw(np.random.default_rng(seed), count)
    values = clears_wall(points, axes).astype(float)
    return GraspRegression.fit(points, axes, values, LEVER_M), points, axes, values


def test_a_wall_is_found_from_samples():
    """Other grasps are told apart, better with more samples."""
    points, axes = VOLUME.draw(np.random.default_rng(99), 4000)
    truth = clears_wall(points, axes)
    wrong = [
        np.mean((fitted(count)[0](points, axes) > 0.5) != truth) for count in (50, 800)
    ]
    assert wrong[1] < 0.05
    assert wrong[1] < 0.6 * wrong[0]


def test_samples_keep_their_values():
    """At a sample the estimate is on the side of its value, but for a few."""
    regression, points, axes, values = fitted(400)
    assert np.mean((regression(points, axes) > 0.5) == (values > 0.5)) > 0.99


def test_frames_do_not_matter():
    """Everything moved rigidly gives the same estimates."""
    regression, points, axes, values = fitted(200)
    R = Rotation.from_euler("xyz", [0.3, -1.1, 2.0]).as_matrix()
    t = np.array([1.0, -2.0, 0.5])
    moved = GraspRegression.fit(points @ R.T + t, axes @ R.T, values, LEVER_M)
    asked, along = VOLUME.draw(np.random.default_rng(5), 300)
    np.testing.assert_allclose(
        moved(asked @ R.T + t, along @ R.T), regression(asked, along), atol=1e-8
    )


def test_far_from_samples_it_does_not_know():
    """A hundred metres away the estimate is one half."""
    regression, *_ = fitted(100)
    far = regression(np.array([[100.0, 0.0, 0.0]]), np.array([[0.0, 0.0, -1.0]]))
    assert far == pytest.approx([0.5], abs=1e-6)


def test_nothing_and_one():
    """No questions have no answers; a single sample may be all there is."""
    down = np.array([[0.0, 0.0, -1.0]])
    one = GraspRegression.fit(np.zeros((1, 3)), down, np.ones(1), LEVER_M)
    assert one(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)
    assert one(np.zeros((1, 3)), down)[0] > 0.9


def test_draws_fill_the_volume():
    """Points reach into every corner; directions are uniform between the tilts."""
    points, axes = VOLUME.draw(np.random.default_rng(1), 20_000)
    assert (points >= VOLUME.low).all()
    assert (points <= VOLUME.high).all()
    np.testing.assert_allclose(points.mean(axis=0), [0, 0, 0.1], atol=5e-3)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0)
    # Uniform over the sphere: the cosine of the tilt is uniform.
    low, high = VOLUME.cosines
    shares = np.histogram(-axes[:, 2], bins=4, range=(low, high))[0] / 20_000
    np.testing.assert_allclose(shares, 0.25, atol=0.02)
