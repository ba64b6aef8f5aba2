"""Down is the world's: arms that hang, cells that are turned, two ways to say so."""

from __future__ import annotations

import re

import numpy as np
import pytest
from ruamel.yaml import YAML

from reachmap.cell.files.resources import Resolver
from reachmap.cell.loading import read_cell
from reachmap.errors import CellError
from reachmap.geometry import (
    inverse_transform,
    rotation_from_quaternion_wxyz,
    rotation_from_rpy_deg,
    transform_from_parts,
)
from reachmap.maps import Status, read_workspace_map
from reachmap.maps.summary.upright import upright_workspace
from reachmap.plots.heatmap import draw_level
from reachmap.plots.parts.stack import stack_of
from reachmap.tools.workspace_scan import workspace_scan

URDF = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
LIMITED = URDF.replace("ur5_robot", "ur5_joint_limited_robot")
SRDF = LIMITED.replace("urdf/", "srdf/").replace(".urdf", ".srdf")
CEILING, WALL = (180.0, 0.0, 0.0), (0.0, 90.0, 0.0)
BOX = np.array([[-0.75, -0.6, 0.35], [0.75, 0.6, 1.05]])
CONE = {"family": "cone", "tilts_deg": [0, 30], "azimuths": [1, 4], "rolls": 2}


def hanging_cell(tmp_path, rpy_deg, *, way, turn_deg=0.0, shift=(0.0, 0.0)):
    """A UR5 above a table with a post, hung up in one of three ways.

    ``base_pose``: robot_base is the arm's own base, which leans. ``joint``: the URDF
    starts with a link that stands upright, and a fixed joint turns the arm.
    ``base_frame``: robot_base is the link behind that joint, and the cell has no
    base_pose. Everything is turned about the vertical and shifted in the plane.
    """
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = transform_from_parts(
        np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), np.array([*shift, 0.0])
    )
    mount = transform_from_parts(rotation_from_rpy_deg(rpy_deg), np.array([0, 0, 1.4]))
    text = Resolver(directory=tmp_path, packages={}).resolve(LIMITED).read_text()
    height = transform_from_parts(np.eye(3), mount[:3, 3])
    start, robot = turn @ mount, {}
    if way == "joint":
        start = turn @ height
        text = with_mounting(text, np.zeros(3), rpy_deg)
    if way == "base_frame":
        text = with_mounting(text, mount[:3, 3], rpy_deg)
        robot = {"base_frame": "base_link"}
    else:
        robot = {"base_pose": pose_data(start)}
    (tmp_path / "arm.urdf").write_text(text)
    low, high = box_in(inverse_transform(start) @ turn)
    steps = (0.5, 0.3, 0.35)
    # The same spacing along the cell's axes, whatever they are called here.
    steps = np.abs(start[:3, :3].T @ turn[:3, :3] @ np.array([0.5, 0.3, 0.35]))
    across = (np.rint(np.subtract(high, low) / steps).astype(int) + 1).tolist()
    data = {
        "format": "reachmap.cell",
        "format_version": "1.0",
        "name": "hanging",
        "robot": {
            "urdf": "arm.urdf",
            "srdf": SRDF,
            **robot,
            "tcp": {"parent": "tool0", "xyz": [0, 0, 0.1], "approach_axis": "+z"},
            "limits": {"acceleration_rad_s2": 5.0},
        },
        "bodies": [
            body("table", turn, [2.0, 2.0, 0.04], [0, 0, 0.2]),
            body("post", turn, [0.1, 0.1, 0.8], [0.45, 0.35, 0.6]),
        ],
        "bin": {
            "inner": [0.3, 0.2, 0.1],
            "frame": "world",
            "pose": pose_data(turn @ at(0.5, -0.2, 0.3)),
        },
        "scan_configuration": {
            "q_deg": dict(
                zip(JOINTS, [0.0, -60.0, 60.0, -90.0, -90.0, 0.0], strict=True)
            )
        },
        "workspace_scan": {
            "cubes": [
                {"name": "all", "min": low, "max": high, "grid": across[:2]},
            ],
            "z_step": (high[2] - low[2]) / (across[2] - 1),
            "orientations": CONE,
        },
    }
    path = tmp_path / f"{way}.yaml"
    with path.open("w") as stream:
        YAML().dump(data, stream)
    return path


def with_mounting(urdf, p, rpy_deg):
    """A URDF whose first joint, from its root to the arm, has another origin."""
    xyz = " ".join(repr(float(v)) for v in p)
    rpy = " ".join(repr(float(v)) for v in np.radians(rpy_deg))
    text, count = re.subn(
        r'(<child link="base_link"/>\s*)<origin[^>]*/>',
        rf'\1<origin rpy="{rpy}" xyz="{xyz}"/>',
        urdf,
    )
    assert count == 1
    return text


JOINTS = (
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint",
    "wrist_2_joint", "wrist_3_joint",
)  # fmt: skip


def at(x, y, z):
    """A translation."""
    return transform_from_parts(np.eye(3), np.array([x, y, z]))


def pose_data(T):
    """A pose as a cell has it."""
    from reachmap.geometry import quaternion_wxyz_from_rotation

    return {
        "xyz": T[:3, 3].tolist(),
        "quaternion_wxyz": quaternion_wxyz_from_rotation(T[:3, :3]).tolist(),
    }


def body(name, turn, sides, centre):
    """A box that is turned with the cell."""
    return {
        "name": name,
        "shape": {"box": sides},
        "pose": pose_data(turn @ at(*centre)),
    }


def box_in(T):
    """The box of the scan in another frame, corners as lists."""
    corners = np.sort(BOX @ T[:3, :3].T + T[:3, 3], axis=0).round(9)
    return corners[0].tolist(), corners[1].tolist()


def statuses(record):
    """Status by position and approach in the cell, without regard to the lattice."""
    cube = record.cubes["all"]
    T_cell_grid = record.T_world_base @ record.T_base_grid
    z, y, x = np.meshgrid(cube.z, cube.y, cube.x, indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    points = points @ T_cell_grid[:3, :3].T + T_cell_grid[:3, 3]
    R = record.T_world_base[:3, :3] @ rotation_from_quaternion_wxyz(
        cube.quaternion_wxyz
    )
    return points, R, cube.status.reshape(len(points), -1)


def compared(a, b, turn_deg=0.0, shift=(0.0, 0.0)):
    """Statuses of two maps, rows and columns of b brought into the order of a."""
    points_a, R_a, status_a = statuses(a)
    points_b, R_b, status_b = statuses(b)
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    points_a = points_a @ turn.T + np.array([*shift, 0.0])
    away = np.linalg.norm(points_a[:, None] - points_b, axis=-1)
    rows = away.argmin(axis=1)
    assert away.min(axis=1).max() < 1e-6
    assert len(set(rows.tolist())) == len(points_b)
    unlike = np.linalg.norm((turn @ R_a)[:, None] - R_b, axis=(-2, -1))
    columns = unlike.argmin(axis=1)
    assert unlike.min(axis=1).max() < 1e-6
    return status_a, status_b[rows][:, columns]


def scanned(path, output, *overrides):
    """The map of a cell, read back from its file."""
    workspace_scan(str(path), output, overrides=overrides)
    return read_workspace_map(output)


@pytest.mark.parametrize("rpy_deg", [CEILING, WALL], ids=["ceiling", "wall"])
def test_three_ways_of_hanging_an_arm_give_one_map(tmp_path, rpy_deg):
    """With base_pose, or a turned joint of the URDF from either side: one map."""
    maps = [
        scanned(hanging_cell(tmp_path, rpy_deg, way=way), tmp_path / f"{way}.h5")
        for way in ("base_pose", "joint", "base_frame")
    ]
    for other in maps[1:]:
        first, second = compared(maps[0], other)
        np.testing.assert_array_equal(first, second)
    found = first == Status.PATH_FOUND
    assert 0.05 < found.mean() < 0.95
    for record in maps:
        R = statuses(record)[1]
        assert (R[:, 2, 2] < -0.8).all(), "tools point down in the world"


@pytest.mark.parametrize("rpy_deg", [CEILING, WALL], ids=["ceiling", "wall"])
def test_a_turned_and_shifted_cell_is_the_same_cell(tmp_path, rpy_deg):
    """A random turn about the vertical and a shift in the plane change no status."""
    home = scanned(hanging_cell(tmp_path, rpy_deg, way="base_pose"), tmp_path / "a.h5")
    turned = {"turn_deg": 137.31, "shift": (3.2, -1.7)}
    path = hanging_cell(tmp_path, rpy_deg, way="base_pose", **turned)
    first, second = compared(home, scanned(path, tmp_path / "b.h5"), **turned)
    np.testing.assert_array_equal(first, second)


def test_an_upright_map_is_the_same_map(tmp_path):
    """Standing a hanging lattice upright moves no number, and heights rise."""
    path = hanging_cell(tmp_path, CEILING, way="base_pose")
    record = scanned(path, tmp_path / "map.h5")
    T_base_level = read_cell(str(path)).cell.T_base_level()
    upright = upright_workspace(record, T_base_level)
    first, second = compared(record, upright)
    np.testing.assert_array_equal(first, second)
    R_world_grid = (record.T_world_base @ upright.T_base_grid)[:3, :3]
    np.testing.assert_allclose(R_world_grid, np.eye(3), atol=1e-12)
    assert (np.diff(upright.z) > 0).all()
    assert upright_workspace(upright, T_base_level) is upright


def test_cubes_in_the_world_and_in_robot_base_are_one_map(tmp_path):
    """The box of the scan written in the world gives the statuses of the other way."""
    path = hanging_cell(tmp_path, WALL, way="base_pose")
    home = scanned(path, tmp_path / "a.h5")
    cube = home.cubes["all"]
    in_world = [
        "workspace_scan.frame=world",
        f"workspace_scan.cubes.0.min={BOX[0].tolist()}",
        f"workspace_scan.cubes.0.max={BOX[1].tolist()}",
        f"workspace_scan.cubes.0.grid=[{len(cube.z)},{len(cube.y)}]",
        f"workspace_scan.z_step={0.7 / (len(cube.x) - 1)}",
    ]
    first, second = compared(home, scanned(path, tmp_path / "b.h5", *in_world))
    np.testing.assert_array_equal(first, second)


def test_pictures_name_the_frame_of_their_levels(tmp_path):
    """Levels that were turned upright are not in robot_base."""
    path = hanging_cell(tmp_path, CEILING, way="base_pose")
    (tmp_path / "second").mkdir()
    without_base_pose = hanging_cell(tmp_path / "second", CEILING, way="base_frame")
    in_world = "workspace_scan.frame=world", "workspace_scan.cubes.0.grid=[2,2]"
    for k, (cell, overrides, frame) in enumerate(
        (
            (path, (), "robot_base, upright"),
            (without_base_pose, (), "robot_base, upright"),
            (path, in_world, "world"),
            (path, ("robot.base_pose={xyz: [0, 0, 0.8]}",), "robot_base"),
        )
    ):
        stack = stack_of(scanned(cell, tmp_path / f"{k}.h5", *overrides), "path")
        assert draw_level(stack, 0).axes[0].get_xlabel() == f"x in {frame} [m]"


def test_a_bin_that_would_spill_is_refused(tmp_path):
    """robot_base hangs, and the default pose of the bin with it."""
    path = hanging_cell(tmp_path, CEILING, way="base_pose")
    with pytest.raises(CellError, match=r"180 deg from upright.*bin\.frame: world"):
        read_cell(str(path), ["bin.frame=robot_base"])
    with pytest.raises(CellError, match="90 deg from upright"):
        read_cell(str(path), ["bin.frame=robot_base", "bin.pose={rpy_deg: [90, 0, 0]}"])
    read_cell(str(path), ["bin.frame=robot_base", "bin.pose={rpy_deg: [150, 0, 0]}"])


def test_levels_that_lean_are_named(tmp_path):
    """A wall makes the levels of robot_base vertical; a ceiling leaves them level."""
    wall = read_cell(str(hanging_cell(tmp_path, WALL, way="base_pose")))
    assert any("levels are tilted by 90 deg" in text for text in wall.warnings)
    ceiling = read_cell(str(hanging_cell(tmp_path, CEILING, way="base_pose")))
    assert not any("lean" in text for text in ceiling.warnings)
