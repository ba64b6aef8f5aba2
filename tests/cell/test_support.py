"""What a bin stands on: top faces of bodies, footprints, bin.on."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.bins.support import TopFace, footprint_of_bin, support_of, top_faces
from reachmap.cell.loading import read_cell
from reachmap.errors import CellError
from reachmap.geometry import yaw_transform

UR5 = "ur5-eye-in-hand"
TABLE = (
    'bodies.pedestal={"name":"pedestal","attach_to":"world",'
    '"shape":{"box":[0.6,0.7,0.1]},"pose":{"xyz":[0.5,0.1,-0.25]}}'
)


def square(x, y, half, z=0.0):
    """A square top face."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return TopFace(name="square", polygon=corners + np.array([x, y]), z=z)


def test_overhang_against_the_box_it_is():
    """For an upright square, the largest distance beyond a side."""
    face = square(0.2, -0.1, 0.3)
    rng = np.random.default_rng(1)
    for points in rng.uniform(-0.8, 0.8, (100, 4, 2)):
        beyond = np.abs(points - [0.2, -0.1]).max() - 0.3
        assert face.overhang_m(points) == pytest.approx(beyond)


def test_the_bin_is_put_on_the_body_it_names():
    """The outer bottom lies on the top face: height and thickness add up."""
    loaded = read_cell(UR5, [TABLE, "bin.on=pedestal"])
    bin_spec = loaded.cell.bin
    T = loaded.cell.T_base_bin()
    assert T[2, 3] == pytest.approx(-0.2 + bin_spec.bottom_m)
    faces = top_faces(loaded.cell, np.eye(4))
    assert support_of(bin_spec, T, faces) == "pedestal"
    lifted = T.copy()
    lifted[2, 3] += 0.02
    assert support_of(bin_spec, lifted, faces) == ""


def test_faces_of_tilted_boxes_and_spheres_are_none():
    """A box on its edge and a ball have no level face; a cylinder has a round one."""
    tilted = TABLE.replace("-0.25]", '-0.25],"rpy_deg":[20,0,0]')
    ball = TABLE.replace('"box":[0.6,0.7,0.1]', '"sphere":{"radius":0.3}')
    drum = TABLE.replace(
        '"box":[0.6,0.7,0.1]', '"cylinder":{"radius":0.3,"length":0.1}'
    )
    names = []
    for body in (tilted, ball, drum):
        faces = top_faces(read_cell(UR5, [body]).cell, np.eye(4))
        names.append([face.name for face in faces if face.name == "pedestal"])
    assert names == [[], [], ["pedestal"]]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["bin.on=table"], "no body 'table'; known: .*pedestal"),
        (["bin.on=pedestal", "bin.pose.xyz=[0.75,0,0]"], r"hangs \d+ mm over the edge"),
        (
            ["bin.on=pedestal", "bin.pose.rpy_deg=[5,0,0]"],
            "so it cannot stand flat on",
        ),
        (
            ["bin.on=pedestal", "bin.pose.rpy_deg=[80,0,0]"],
            "the bin is tilted 80 deg from upright in the world and would spill",
        ),
    ],
)
def test_a_bin_that_cannot_stand_there_is_a_mistake(changes, words):
    """In one line, with what is wrong."""
    with pytest.raises(CellError, match=words) as told:
        read_cell(UR5, [TABLE, *changes])
    assert len(told.value.lines) == 1


def test_a_footprint_holds_the_walls():
    """Inner sides and two walls, turned with the bin."""
    bin_spec = read_cell(UR5).cell.bin
    corners = footprint_of_bin(bin_spec, yaw_transform(0.0, 0.0, 0.3, np.pi / 2))
    sides = np.ptp(corners, axis=0)
    wanted = np.array(bin_spec.inner[:2])[::-1] + 2 * bin_spec.wall
    np.testing.assert_allclose(sides, wanted)
