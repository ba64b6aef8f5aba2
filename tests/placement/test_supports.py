"""Where on its supports a bin is looked for."""

from __future__ import annotations

import json

import numpy as np
import pytest

from reachmap.cell.bins.support import SLACK_M, footprint_of_bin, top_faces
from reachmap.cell.loading import read_cell
from reachmap.core.collision.bin_fit import BinFit
from reachmap.core.scene import Scene
from reachmap.geometry import yaw_transform
from reachmap.placement.predicted.region import Region
from reachmap.placement.supports import has_room, natural_poses

EVERYWHERE = Region(
    low=np.array([-2.0, -2.0, -1.0, 0.0]), high=np.array([2.0, 2.0, 1.0, np.pi])
)


def on_a_stand(turn_deg: float, spare_m: float):
    """The planar toy with a stand that is a little larger than its bin."""
    bin_spec = read_cell("planar-toy").cell.bin
    size = 2 * (np.array(bin_spec.inner[:2]) / 2 + bin_spec.walls) + spare_m
    stand = {
        "name": "stand",
        "shape": {"box": [*size.tolist(), 0.02]},
        "pose": {"xyz": [0.137, 0.613, -0.4], "rpy_deg": [0, 0, turn_deg]},
    }
    return read_cell("planar-toy", [f"bodies.0={json.dumps(stand)}"])


@pytest.mark.parametrize("turn_deg", [0.0, 20.0, 90.0, 163.0])
def test_a_stand_of_the_size_of_the_bin_has_room_for_it(turn_deg):
    """Whatever its angle, and though no grid of places meets its middle."""
    loaded = on_a_stand(turn_deg, spare_m=1e-4)
    scene = Scene.build(loaded, with_bin=False)
    (face,) = top_faces(loaded.cell, np.eye(4))
    fit = BinFit(scene.robot, loaded, None)
    assert has_room(loaded.cell, EVERYWHERE, face, fit)
    poses = natural_poses(loaded.cell, EVERYWHERE, (face,))
    over = [
        face.overhang_m(footprint_of_bin(loaded.cell.bin, yaw_transform(*pose)))
        for pose in poses
    ]
    assert min(over) <= SLACK_M
    assert all(not EVERYWHERE.outside(np.array(pose)) for pose in poses)
    smaller = on_a_stand(turn_deg, spare_m=-2e-3)
    (face,) = top_faces(smaller.cell, np.eye(4))
    assert not has_room(smaller.cell, EVERYWHERE, face, fit)


def test_the_pose_in_the_cell_is_always_among_them():
    """A bin a little above a face is put on it."""
    loaded = read_cell("planar-toy")
    own = natural_poses(loaded.cell, EVERYWHERE, ())[0]
    assert yaw_transform(*own) == pytest.approx(loaded.cell.T_base_bin(), abs=1e-8)
