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
from reachmap.placement.supports import has_room, natural_poses, supports_in

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


BELT = {
    "name": "belt",
    "shape": {"box": [1.0, 0.6, 0.02]},
    "pose": {"xyz": [0.5, 0.9, -0.4]},
}
PART = "part={shape: {box: [0.02, 0.02, 0.02]}, pose: {xyz: [0, 0, 0.01]}}"


def supports_with(*overrides: str) -> list[str]:
    """Names of what the toy's bin may stand on where there is a belt."""
    loaded = read_cell("planar-toy", [f"bodies.0={json.dumps(BELT)}", *overrides])
    scene = Scene.build(loaded, with_bin=False)
    faces = top_faces(loaded.cell, np.eye(4))
    fit = BinFit(scene.robot, loaded, None)
    return [face.name for face in supports_in(loaded.cell, EVERYWHERE, faces, fit)]


def test_a_belt_that_takes_parts_away_carries_no_bin():
    """Unless the cell has its bin there, or names it."""
    onto_it = "drop_off={name: out, frame: belt, pose: {xyz: [0, 0, 0.05]}}"
    assert supports_with() == ["belt"]
    assert supports_with(PART, onto_it) == []
    assert supports_with(PART, onto_it, "bin.on=belt", "bin.pose.xyz=[0.5,0.9,0]") == [
        "belt"
    ]
    height = -0.39 + read_cell("planar-toy").cell.bin.bottom_m
    assert supports_with(PART, onto_it, f"bin.pose.xyz=[0.5,0.9,{height}]") == ["belt"]
