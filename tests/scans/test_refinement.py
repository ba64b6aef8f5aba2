"""Grasps between the test grasps, with their verdicts, on the shipped arm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reachmap.geometry import rotation_from_quaternion_wxyz, transform_from_parts
from reachmap.maps import Status, read_bin_map
from reachmap.runtime.options import RunOptions
from reachmap.sampling.frames import approach_distance_m
from reachmap.scans.ik_survey import survey_frames
from reachmap.scans.refinement import refine
from reachmap.tools.bin_scan import bin_scan
from tests.support.scenes import scene_of

SMALL = (
    "bin_scan.grid=[3,2]",
    "bin_scan.repeats=1",
    "tool.rolls=6",
    "bin_scan.refine=60",
    # Of a capsule it is not worked out where it has room, so that its collisions with
    # the walls are to be found.
    "bodies.camera housing.shape={capsule: {radius: 0.05, length: 0.06}}",
)


class NeverAsked:
    """Stages of which none may be run."""

    def run(self, *_arguments, **_options):
        """Refuse."""
        raise AssertionError

    once = run


def scanned(folder, *overrides, workers=1):
    """Bin map of the shipped cell on six points."""
    path = folder / f"bin{workers}.h5"
    path.unlink(missing_ok=True)
    bin_scan(
        None,
        path,
        cell="ur5-eye-in-hand",
        overrides=(*SMALL, *overrides),
        run=RunOptions(workers=workers, quiet=True),
    )
    return read_bin_map(path)


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    """The cell as shipped, whose cup is round."""
    return scanned(tmp_path_factory.mktemp("refined"))


def test_verdicts_are_those_of_every_roll(refined):
    """Each grasp has a free goal in one of its rolls exactly where it is reached."""
    scene = scene_of("ur5-eye-in-hand", *SMALL)
    part = refined.refinement
    # Fewer than asked for: in some rounds nothing is in doubt.
    assert 30 <= len(part.status) <= 60
    assert set(part.status.tolist()) >= {Status.PATH_FOUND, Status.APPROACH_BLOCKED}
    R = rotation_from_quaternion_wxyz(part.quaternion_wxyz)
    for row in range(0, len(part.status), 3):
        turns = Rotation.from_rotvec(
            np.outer(2 * np.pi * np.arange(6) / 6, R[row][:, 2])
        ).as_matrix()
        T = transform_from_parts(turns @ R[row], part.position[row])
        survey = survey_frames(scene, T, approach_distance_m(scene.loaded.cell))
        free = np.unique(survey.frame)
        assert (part.status[row] == Status.PATH_FOUND) == bool(len(free))
        # What is reached is reached in the very roll that is kept.
        assert part.status[row] != Status.PATH_FOUND or 0 in free


def test_doubt_draws_more_grasps_to_the_boundary(refined):
    """Chosen grasps are reached about half the time, those drawn anywhere mostly."""
    reached = refined.refinement.status == Status.PATH_FOUND
    points = refined.refinement.position @ refined.bin_pose[:3, :3]
    points -= refined.bin_pose[:3, 3] @ refined.bin_pose[:3, :3]
    assert (np.abs(points[:, :2]) <= refined.bin_inner[:2] / 2).all()
    assert 0.3 < reached[6:].mean() < 0.95


@pytest.mark.slow
def test_workers_do_not_matter(refined, tmp_path):
    """Two workers find the same map."""
    again = scanned(tmp_path, workers=2)
    assert again.stamp.content_sha256 == refined.stamp.content_sha256


@pytest.mark.parametrize(
    "override",
    ["tool.roll=listed", "bin_scan.refine=0", "bin_scan.fill=[0.2]"],
)
def test_nothing_is_drawn_unless_it_means_something(override):
    """With listed rolls, if none are asked for, or with an obstacle in each layer."""
    scene = scene_of("ur5-eye-in-hand", *SMALL, override)
    assert refine(scene, NeverAsked()) is None
