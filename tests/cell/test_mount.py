"""The mount of an arm: one number moves base and body, and nothing else."""

from __future__ import annotations

import json

import numpy as np
import pytest

from reachmap.cell.loading import cell_from_json, read_cell
from reachmap.cell.text.yaml_writer import cell_yaml
from reachmap.errors import CellError
from reachmap.geometry import tilt_rad

TOY = "planar-toy"


def mounted(**mount):
    """The toy on a mount."""
    given = json.dumps({"height": 0.8, **mount})
    return read_cell(TOY, [f"robot.mount={given}", "bin.frame=world"])


def body_of(loaded, name="mount"):
    """The body of a mount."""
    return next(b for b in loaded.cell.bodies if b.name == name)


@pytest.mark.parametrize(
    ("kind", "lean_deg", "away"),
    [
        ("pedestal", 0.0, (0.0, 0.0, -1.0)),
        ("ceiling", 180.0, (0.0, 0.0, 1.0)),
        ("wall", 90.0, (-1.0, 0.0, 0.0)),
    ],
)
def test_base_and_body_belong_together(kind, lean_deg, away):
    """The base leans as its kind says, and its body lies behind it, a gap away."""
    loaded = mounted(kind=kind, size=[0.2, 0.3], length=0.4, at=[0.1, 0.2])
    T = loaded.cell.robot.base_pose.matrix()
    assert np.degrees(tilt_rad(T[:3, :3])) == pytest.approx(lean_deg)
    assert np.allclose(T[:3, 3], [0.1, 0.2, 0.8])
    body = body_of(loaded)
    assert np.allclose(np.array(body.pose.xyz) - T[:3, 3], 0.202 * np.array(away))
    assert np.allclose(body.pose.matrix()[:3, :3], T[:3, :3])
    assert body.shape.box == (0.2, 0.3, 0.4)


def test_a_pedestal_reaches_the_floor_whatever_its_height():
    """Its foot is at z = 0 of the world; a tilted base does not tilt it."""
    for height in (0.5, 0.9):
        body = body_of(mounted(height=height, size=[0.3, 0.3], tilt_deg=20.0))
        assert body.shape.box is not None
        assert body.pose.xyz[2] - body.shape.box[2] / 2 == pytest.approx(0.0)
        assert body.pose.matrix()[2, 2] == 1.0


def test_a_wall_faces_its_yaw():
    """The base's z axis is level and points along the yaw."""
    T = mounted(kind="wall", yaw_deg=90.0).cell.robot.base_pose.matrix()
    assert np.allclose(T[:3, 2], [0.0, 1.0, 0.0])


def test_it_is_the_cell_with_the_numbers_written_out():
    """The same contents have the same hash."""
    loaded = mounted(size=[0.3, 0.3])
    body = body_of(loaded).model_dump(mode="json", exclude_none=True)
    bodies = [
        b.model_dump(mode="json", exclude_none=True) for b in read_cell(TOY).cell.bodies
    ]
    plain = read_cell(
        TOY,
        [
            f"bodies={json.dumps([*bodies, body])}",
            "robot.base_pose={xyz: [0, 0, 0.8], rpy_deg: [0, 0, 0]}",
            "bin.frame=world",
        ],
    )
    assert plain.sha256 == loaded.sha256


def test_it_can_be_changed_in_an_artefact_and_in_an_exported_cell(tmp_path):
    """One override moves base and body, whatever the cell was read from."""
    loaded = mounted(size=[0.3, 0.3])
    wanted = mounted(size=[0.3, 0.3], height=1.1)
    changed = cell_from_json(
        loaded.resolved_json, urdf=loaded.urdf, changes=["robot.mount.height=1.1"]
    )
    assert changed.sha256 == wanted.sha256
    path = tmp_path / "exported.yaml"
    path.write_text(cell_yaml(loaded.cell))
    assert read_cell(str(path)).sha256 == loaded.sha256
    again = read_cell(str(path), ["robot.mount.height=1.1"])
    assert again.sha256 == wanted.sha256


def test_expressions_reach_the_mount():
    """A parameter may be its height."""
    loaded = read_cell(
        TOY,
        ["parameters={rise: 0.6}", 'robot.mount={height: "=rise + 0.1"}'],
    )
    assert loaded.cell.robot.base_pose.xyz[2] == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("mount", "said"),
    [
        ("{height: 0.8, kind: shelf}", r"robot\.mount\.kind: .*pedestal"),
        ("{kind: wall}", r"robot\.mount\.height"),
        ("{height: -0.1, size: [0.3, 0.3]}", "no length above the floor"),
    ],
)
def test_a_wrong_mount_is_a_clear_error(mount, said):
    """The key and what was expected are named."""
    with pytest.raises(CellError, match=said):
        read_cell(TOY, [f"robot.mount={mount}"])


def test_two_poses_of_the_base_are_a_mistake(tmp_path):
    """A file that gives base_pose and a mount that says another is refused."""
    text = cell_yaml(read_cell(TOY).cell)
    assert "base_pose" in text
    path = tmp_path / "cell.yaml"
    path.write_text(text)
    with pytest.raises(CellError, match=r"base_pose: contradicts robot.mount"):
        read_cell(str(path), ["robot.mount={height: 0.8}"])
