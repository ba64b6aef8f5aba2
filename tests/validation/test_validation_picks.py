"""Tool poses of a grasp, and grasps drawn from a map."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.model.orientations import ConeFamily
from reachmap.errors import SettingsError
from reachmap.geometry import rotation_angle, rotation_from_quaternion_wxyz
from reachmap.maps.parts import concatenated
from reachmap.ranking import Ranker, RankSettings, grasps_from_document, rank_list
from reachmap.validation.picks import picks_of, tool_poses
from reachmap.validation.random_grasps import random_grasps
from tests.support.ranking_maps import make_bin_map


def ranked(grasps, **settings):
    """A list in the frame of the bin, ranked with a small random map."""
    document = {"format": "reachmap.grasps", "format_version": "1.0", "frame": "bin"}
    grasps = grasps_from_document({**document, "grasps": grasps})
    return rank_list(grasps, Ranker(make_bin_map()), settings=RankSettings(**settings))


DIRECTION = {"position": [0.01, 0.02, 0.05], "direction": [0.3, -0.1, -1.0]}
ORIENTED = {"position": [0.0, 0.0, 0.05], "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]}


def test_free_rolls_share_the_exact_approach():
    """Equal steps of a full turn about the given direction, at the given point."""
    one = ranked([DIRECTION])
    T = tool_poses(picks_of(one), 0, rolls=12, approach_axis="+z")
    assert T.shape == (12, 4, 4)
    np.testing.assert_allclose(T[:, :3, 2], np.tile(one.queries.axes, (12, 1)))
    np.testing.assert_allclose(T[:, :3, 3], np.tile(one.queries.points, (12, 1)))
    np.testing.assert_allclose(np.linalg.det(T[:, :3, :3]), 1.0)
    steps = rotation_angle(T[:, :3, :3], np.roll(T[:, :3, :3], 1, axis=0))
    np.testing.assert_allclose(steps, 2 * np.pi / 12)


def test_the_first_pose_is_the_recommended_one():
    """It differs from the test grasp by φ2, the least that exactness needs."""
    one = ranked([DIRECTION])
    T = tool_poses(picks_of(one), 0, rolls=24, approach_axis="+z")
    R_test = rotation_from_quaternion_wxyz(one.ranking.orientation_wxyz[0])
    angle = rotation_angle(T[0, :3, :3], R_test)
    assert angle == pytest.approx(one.ranking.angle[0])
    assert (rotation_angle(T[1:, :3, :3], R_test) > angle).all()


def test_a_fixed_roll_leaves_one_pose():
    """A grasp with an orientation is planned to as it is, unless its roll is freed."""
    one = ranked([ORIENTED])
    (T,) = tool_poses(picks_of(one), 0, rolls=24, approach_axis="+z")
    R_base_bin = make_bin_map().bin_pose[:3, :3]
    np.testing.assert_allclose(
        T[:3, :3], R_base_bin @ np.diag([1.0, -1.0, -1.0]), atol=1e-12
    )
    freed = ranked([ORIENTED], roll="free")
    assert len(tool_poses(picks_of(freed), 0, rolls=24, approach_axis="+z")) == 24


def test_lists_keep_their_own_numbers():
    """Attempts are seeded by the place in the own list, whatever comes before it."""
    two = picks_of(ranked([DIRECTION, ORIENTED]))
    joined = concatenated([two, two])
    assert joined.number.tolist() == [0, 1, 0, 1]
    assert len(joined) == 4


def test_random_grasps_fill_the_mapped_volume():
    """Uniform between test points, layers and tilts; the same for the same seed."""
    bin_map = make_bin_map(shape=(3, 5, 7))
    grasps = random_grasps(bin_map, 4000, seed=3)
    assert grasps.frame == "bin"
    low, high = grasps.points.min(axis=0), grasps.points.max(axis=0)
    half_x, half_y = 0.18 - 0.36 / 14, 0.13 - 0.26 / 10
    wanted_low, wanted_high = [-half_x, -half_y, 0.03], [half_x, half_y, 0.15]
    np.testing.assert_allclose(low, wanted_low, atol=1e-3)
    np.testing.assert_allclose(high, wanted_high, atol=1e-3)
    np.testing.assert_allclose(grasps.points.mean(axis=0), [0, 0, 0.09], atol=4e-3)
    cosine = -grasps.directions[:, 2]
    assert cosine.min() >= np.cos(np.radians(30)) - 1e-9
    # Uniform on the sphere: the cosine is uniform, so the mean is in the middle.
    assert cosine.mean() == pytest.approx((1 + np.cos(np.radians(30))) / 2, abs=2e-3)
    np.testing.assert_allclose(grasps.directions[:, :2].mean(axis=0), 0, atol=0.01)
    again = random_grasps(bin_map, 4000, seed=3)
    np.testing.assert_array_equal(again.points, grasps.points)
    other = random_grasps(bin_map, 4000, seed=4)
    assert not np.allclose(other.points, grasps.points)


def test_random_grasps_of_a_single_layer_and_tilt():
    """One layer is half a pitch thick either way; one tilt leaves only the azimuth."""
    family = ConeFamily(tilts_deg=(20.0,), azimuths=(4,), rolls=1)
    grasps = random_grasps(make_bin_map(family=family), 500, seed=1)
    half = 0.5 * max(0.36 / 7, 0.26 / 5)
    assert (np.abs(grasps.points[:, 2] - 0.05) <= half).all()
    np.testing.assert_allclose(grasps.directions[:, 2], -np.cos(np.radians(20)))


@pytest.mark.parametrize("count", [0, 100_001])
def test_random_grasps_are_counted(count):
    """Neither none nor more than anybody would plan to."""
    with pytest.raises(SettingsError, match="random must be 1 to 100000"):
        random_grasps(make_bin_map(), count, seed=1)
