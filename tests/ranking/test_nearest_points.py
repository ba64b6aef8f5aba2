"""Nearest test points, compared one by one and looked up in a tree."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from reachmap.ranking.lookup.matching import FEW_PAIRS, NearestPoints


def test_few_and_many_are_answered_alike():
    """A short list is compared with every point, a long one asks the tree."""
    rng = np.random.default_rng(2)
    points, grasps = rng.random((300, 3)), rng.random((2000, 3))
    assert len(points) * len(grasps) > FEW_PAIRS
    distance, index = NearestPoints(points).query(grasps, 4)
    few = NearestPoints(points)
    assert len(points) * len(grasps[:50]) <= FEW_PAIRS
    near, which = few.query(grasps[:50], 4)
    np.testing.assert_array_equal(which, index[:50])
    np.testing.assert_allclose(near, distance[:50], rtol=1e-12)
    plain = np.linalg.norm(grasps[7] - points, axis=1)
    np.testing.assert_array_equal(which[7], np.argsort(plain)[:4])


def test_fewer_points_than_asked_for():
    """Columns are as many as there are points."""
    distance, index = NearestPoints(np.zeros((2, 3))).query(np.ones((1, 3)), 8)
    assert distance.shape == index.shape == (1, 2)


def test_ranking_does_not_import_scipy():
    """Importing it would take most of a command's time."""
    code = "import sys, reachmap.tools.rank; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
