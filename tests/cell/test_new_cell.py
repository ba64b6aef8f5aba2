"""``reachmap new-cell``: from what makers publish to a cell that checks."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from scipy.spatial.transform import Rotation

from reachmap.cell.loading import read_cell
from reachmap.cli import group
from reachmap.core.scene import Scene
from reachmap.geometry import AXES
from reachmap.maps import Status, read_bin_map
from reachmap.maps.records import BinMap
from reachmap.sampling.frames import bin_test_frames
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.check import check
from tests.support.optional import present

CORNERS = ("0 0 0", "0.05 0 0", "0 0.05 0", "0 0 0.05")
STL = "solid a\n"
for first, second, third in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)):
    inner = "".join(f"vertex {CORNERS[k]}\n" for k in (first, second, third))
    STL += f"facet normal 0 0 0\nouter loop\n{inner}endloop\nendfacet\n"
STL += "endsolid a\n"
AXES_OF_SIX = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")


def solid(centre: str, size: str) -> str:
    """Collision element of a box."""
    shape = f'<geometry><box size="{size}"/></geometry>'
    return f'<collision><origin xyz="{centre}"/>{shape}</collision>'


def fixed(name: str, parent: str, child: str, origin: str = 'xyz="0 0 0"') -> str:
    """A fixed joint."""
    return (
        f'<joint name="{name}" type="fixed"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin {origin}/></joint>'
    )


def arm(more: str = "", *, flange: str = 'xyz="0 0 0.3"', base: str = "") -> str:
    """Inside of a URDF: six axes of 0.3 m, a flange called tool0, anything else."""
    parts = [f'<link name="base_link">{base}</link><link name="tool0"/>']
    for k, axis in enumerate(AXES_OF_SIX):
        body = solid("0 0 0.14", "0.05 0.05 0.2")
        parts.append(
            f'<link name="link{k + 1}">{body}</link>'
            f'<joint name="j{k + 1}" type="revolute"><child link="link{k + 1}"/>'
            f'<parent link="{f"link{k}" if k else "base_link"}"/>'
            f'<origin xyz="0 0 0.3"/><axis xyz="{axis}"/>'
            '<limit lower="-2.9" upper="2.9" velocity="2" effort="9"/></joint>'
        )
    return "".join(parts) + fixed("t", "link6", "tool0", flange) + more


def write(path: Path, text: str) -> Path:
    """Create a file with its folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def urdf(path: Path, inside: str) -> Path:
    """Create a URDF or xacro file."""
    xmlns = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    return write(path, f'<robot name="arm" {xmlns}>{inside}</robot>')


def new_cell(*arguments: object, output: Path, code: int = 0) -> Result:
    """Run the command and look at its exit code."""
    words = ["new-cell", *map(str, arguments), "-o", str(output)]
    result = CliRunner().invoke(group, words)
    assert result.exit_code == code, result.stderr
    return result


def checked(output: Path) -> None:
    """The cell works in a shell that knows nothing."""
    assert check(str(output)).problems == ()


@pytest.fixture(autouse=True)
def _no_search_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("REACHMAP_PACKAGE_PATH", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


def mesh_of(package: str) -> str:
    """A link with a mesh of a package, fixed to the base."""
    geometry = f'<geometry><mesh filename="package://{package}/m/a.stl"/></geometry>'
    link = f'<link name="x"><collision>{geometry}</collision></link>'
    return link + fixed("jx", "base_link", "x")


def test_the_package_of_the_urdf_needs_no_word(tmp_path: Path) -> None:
    """Nor do its neighbours; the cell need not name them either."""
    for name in ("arm_description", "gripper"):
        write(
            tmp_path / name / "package.xml", f"<package><name>{name}</name></package>"
        )
        write(tmp_path / name / "m" / "a.stl", STL)
    second = mesh_of("gripper").replace('"x"', '"y"').replace('"jx"', '"jy"')
    path = urdf(
        tmp_path / "arm_description" / "urdf" / "arm.urdf",
        arm(mesh_of("arm_description") + second),
    )
    output = tmp_path / "cells" / "cell.yaml"
    output.parent.mkdir()
    new_cell(path, output=output)
    assert "resources:" not in output.read_text()
    checked(output)


@pytest.mark.parametrize("place", ["near", "far"])
def test_a_package_that_is_named_stays_in_the_cell(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Relative where it lies near the cell, so that both can be moved."""
    folder = tmp_path / ("vendor" if place == "near" else "a/b/c/vendor")
    write(folder / "m" / "a.stl", STL)
    home = tmp_path / ("." if place == "near" else "d/e/f")
    path = urdf(home / "arm.urdf", arm(mesh_of("only_here")))
    failed = new_cell(path, output=home / "cell.yaml", code=2)
    assert "--package only_here=FOLDER" in failed.stderr
    assert not (home / "cell.yaml").exists()
    monkeypatch.chdir(folder.parent)
    new_cell(path, "--package", "only_here=vendor", output=home / "cell.yaml")
    written = (home / "cell.yaml").read_text()
    shown = "vendor" if place == "near" else str(folder)
    assert f"packages: {{only_here: {shown}}}" in written.replace('"', "")
    monkeypatch.chdir("/")
    checked(home / "cell.yaml")


@pytest.mark.parametrize(
    ("variable", "below"),
    [
        ("REACHMAP_PACKAGE_PATH", ""),
        ("ROS_PACKAGE_PATH", ""),
        ("AMENT_PREFIX_PATH", "share"),
    ],
)
def test_a_package_of_the_environment_is_written_down(
    variable: str, below: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next shell does not have the variable."""
    folder = tmp_path / "far" / "ws" / "x"
    write(folder / below / "only_here" / "m" / "a.stl", STL)
    path = urdf(tmp_path / "home" / "arm.urdf", arm(mesh_of("only_here")))
    monkeypatch.setenv(variable, str(folder))
    output = path.parent / "cell.yaml"
    new_cell(path, output=output)
    monkeypatch.delenv(variable)
    checked(output)
    assert read_cell(str(output)).cell.resources.packages == {
        "only_here": str(folder / below / "only_here")
    }


XACRO = (
    '<xacro:arg name="size" default="1"/><xacro:property name="n" value="$(arg name)"/>'
)


@pytest.mark.parametrize(
    "arguments",
    [
        ("name:=ur", "--xacro-arg", "size:=2"),
        pytest.param(("name:=ur", "size:=2"), marks=pytest.mark.slow),
        pytest.param(
            ("--xacro-arg", "name=ur", "--xacro-arg", "size=2"),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_xacro_arguments_stay_in_the_cell(
    arguments: tuple[str, ...], tmp_path: Path
) -> None:
    """In either spelling; the robot is the one that was meant."""
    pytest.importorskip("xacro")
    link = "${n}_$(arg size)"
    inside = XACRO + arm(f'<link name="{link}"/>' + fixed("e", "tool0", link))
    path = urdf(tmp_path / "arm.urdf.xacro", inside)
    output = tmp_path / "cell.yaml"
    new_cell(path, *arguments, output=output)
    assert read_cell(str(output)).cell.robot.xacro_args == {"name": "ur", "size": "2"}
    assert "ur_2" in read_cell(str(output)).robot.links
    checked(output)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "argument 'name' is not given; .*--xacro-arg name=VALUE"),
        (("name:=a", "sise:=2"), "--xacro-arg sise: no such argument; .*'size'"),
        (("name:=a", "name:=b"), "'name' is given twice"),
        (("name",), "'name' is not NAME:=VALUE"),
        (("--package", "x"), "'x' is not NAME=FOLDER"),
        (("--package", "x="), "'x=' is not NAME=FOLDER"),
        (("--package", "x/y=z"), "'x/y=z' is not NAME=FOLDER"),
        (("name:=a", "--package", "x=none"), "--package x=none: no such folder"),
        (("name:=a", "--moveit-config", "none"), "none: no such folder"),
    ],
)
def test_wrong_arguments_are_refused(
    arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    """One line, exit code 2, nothing written."""
    pytest.importorskip("xacro")
    used = '<link name="${n}"/>' + fixed("e", "tool0", "${n}")
    path = urdf(tmp_path / "arm.urdf.xacro", XACRO + arm(used))
    result = new_cell(path, *arguments, output=tmp_path / "cell.yaml", code=2)
    assert re.search(message, result.stderr.splitlines()[-1])
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("arm.xml", "<mujoco/>", "MJCF .* export a URDF"),
        ("arm.xml", '<sdf version="1.7"/>', "SDF .* export a URDF"),
        ("arm.mjcf.xml", "<mujoco/>", "MJCF"),
        ("arm.sdf", "<sdf/>", "SDF is not read; export the robot as URDF"),
        ("arm.usdz", "PK\x03\x04", "USD is not read"),
        ("arm.usda", "#usda 1.0", "USD is not read"),
        ("arm.GLB", "glTF", "glTF is not read"),
        ("arm.stp", "ISO-10303-21;", "STEP is not read"),
        ("arm.urdf", '<robot name="a"><xacro:x/></robot>', r"arm\.urdf\.xacro"),
    ],
)
def test_other_formats_are_refused_with_what_to_do(
    name: str, text: str, message: str, tmp_path: Path
) -> None:
    """A sentence instead of what a parser says."""
    path = write(tmp_path / name, text)
    result = new_cell(path, output=tmp_path / "cell.yaml", code=2)
    assert re.search(message, result.stderr)
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "cell.yaml").exists()


SRDF = """<robot name="arm">
<group name="hand"><joint name="finger"/></group>
<group name="manipulator"><chain base_link="base_link" tip_link="tool0"/></group>
<group_state name="up" group="manipulator">{up}</group_state>
<group_state name="look" group="manipulator">{look}</group_state>
<group_state name="half" group="manipulator"><joint name="j1" value="0"/></group_state>
</robot>"""
LIMITS = "joint_limits:\n  j1: {has_velocity_limits: true, max_velocity: 0.5}\n"
SCENE = """table scene
* table
0.5 0 -0.6
0 0 0 1
1
box
1 2 0.1
0 0 0.05
0 0 0 1
0 0 0 0
0
* old post
2
cylinder
0.05 0.4
-0.6 0.6 0.2
0 0 0 1
0 0 0 0
mesh
3 1
0 0 0
1 0 0
0 1 0
0 1 2
0 0 0
0 0 0 1
0 0 0 0
.
"""
MESSAGE = """world:
  collision_objects:
    - id: shelf
      header: {frame_id: base_link}
      pose: {position: {x: -1.0, y: 0.0, z: 0.0}, orientation: {w: 1.0}}
      primitives: [{type: 3, dimensions: [0.4, 0.1]}]
      primitive_poses: [{position: {x: 0.0, y: 1.0, z: 0.2}}]
    - id: bar
      primitives: [{type: box, dimensions: [0.4, 0.1, 0.1]}]
      primitive_poses: [{position: [0, 1.5, 0], orientation: [0, 0, 1, 0]}]
    - id: table
      primitives: [{type: sphere, dimensions: [0.4]}]
"""


def state(values: list[float]) -> str:
    """Joints of a group state."""
    return "".join(
        f'<joint name="j{k + 1}" value="{value}"/>' for k, value in enumerate(values)
    )


def moveit_config(folder: Path, **states: list[float]) -> Path:
    """A MoveIt configuration, with states ``up`` and ``look``."""
    both = {"up": [0.0] * 6, "look": [0.0, 0.3, 1.2, 0.0, 1.64, 0.0], **states}
    texts = {name: state(values) for name, values in both.items()}
    write(folder / "config" / "arm.srdf", SRDF.format(**texts))
    write(folder / "config" / "joint_limits.yaml", LIMITS)
    write(
        folder / "config" / "kinematics.yaml", "manipulator: {kinematics_solver: x}\n"
    )
    write(folder / "scenes" / "table.scene", SCENE)
    write(folder / "config" / "scene.yaml", MESSAGE)
    return folder


def test_a_moveit_configuration_is_taken_over(tmp_path: Path) -> None:
    """SRDF, limits, the state that looks down, bodies where the scenes have them."""
    path = urdf(tmp_path / "arm.urdf", arm())
    config = moveit_config(tmp_path / "arm_moveit_config")
    output = tmp_path / "cell.yaml"
    made = new_cell(path, "--moveit-config", config, output=output)
    assert "mesh and is left out" in made.stderr
    text = output.read_text()
    assert "srdf: arm_moveit_config/config/arm.srdf" in text
    assert "group_state: look   # or up" in text
    loaded = read_cell(str(output))
    assert loaded.cell.robot.limits.velocity_rad_s is not None
    rows = {row.name: row.velocity for row in check(str(output)).joints}
    assert rows["j1"] == pytest.approx(np.degrees(0.5))
    bodies = {body.name: body for body in loaded.cell.bodies}
    assert sorted(bodies) == ["bar", "old_post_1", "shelf", "table"]
    assert "scene.yaml: 'table' is in another scene, too" in made.stderr
    assert bodies["table"].shape.box == (1.0, 2.0, 0.1)
    assert bodies["table"].pose.xyz == (0.5, 0.0, -0.55)
    assert bodies["bar"].pose.matrix()[:3, 0] == pytest.approx([-1, 0, 0])
    assert bodies["old_post_1"].pose.xyz == (-0.6, 0.6, 0.2)
    shelf = bodies["shelf"].shape.cylinder
    assert shelf is not None
    assert (shelf.radius, shelf.length) == (0.1, 0.4)
    assert bodies["shelf"].pose.xyz == (-1.0, 1.0, 0.2)
    checked(output)


def test_an_srdf_may_lie_in_a_folder_of_its_own(tmp_path: Path) -> None:
    """Beside the file of its macro, as in the packages of makers for ROS 2."""
    path = urdf(tmp_path / "arm.urdf", arm())
    config = moveit_config(tmp_path / "m")
    (config / "srdf").mkdir()
    (config / "config" / "arm.srdf").rename(config / "srdf" / "arm.srdf")
    write(config / "srdf" / "arm_macro.srdf", "<robot/>")
    output = tmp_path / "cell.yaml"
    new_cell(path, "--moveit-config", config, output=output)
    assert "srdf: m/srdf/arm.srdf" in output.read_text()
    assert "joint_limits: m/config/joint_limits.yaml" in output.read_text()


def test_no_state_is_taken_that_looks_up(tmp_path: Path) -> None:
    """Then the scan configuration is searched for, and that is said."""
    path = urdf(tmp_path / "arm.urdf", arm())
    config = moveit_config(tmp_path / "m", look=[0.1] * 6)
    made = new_cell(path, "--moveit-config", config, output=tmp_path / "cell.yaml")
    assert "no named state is free and looks down (up, look)" in made.stderr
    assert "group_state" not in (tmp_path / "cell.yaml").read_text()


@pytest.mark.parametrize("text", ["x\n* a\n1\nbox\n1 2\n", "x\n* a\none\n", "x\n* a\n"])
def test_a_scene_cut_short_is_refused(text: str, tmp_path: Path) -> None:
    """Rather than taken by halves."""
    path = urdf(tmp_path / "arm.urdf", arm())
    config = moveit_config(tmp_path / "m")
    write(config / "scenes" / "table.scene", text)
    made = new_cell(
        path, "--moveit-config", config, output=tmp_path / "cell.yaml", code=2
    )
    assert "table.scene: not a MoveIt scene, or truncated" in made.stderr


@pytest.mark.parametrize(
    ("rpy", "axis"),
    [
        ("0 0 0", "+z"),
        ("0 0 0.7", "+z"),
        ("0 1.5707963 0", "-x"),
        ("0 -1.5707963 0", "+x"),
        ("3.14159265 0 0", "-z"),
        ("1.5707963 0 0", "+y"),
    ],
)
def test_the_approach_axis_points_away_from_the_arm(
    rpy: str, axis: str, tmp_path: Path
) -> None:
    """Whatever way the flange's frame is turned: along the last joint, outwards."""
    flange = f'xyz="0 0 0.1" rpy="{rpy}"'
    path = urdf(tmp_path / "arm.urdf", arm(flange=flange))
    output = tmp_path / "cell.yaml"
    new_cell(path, output=output)
    assert read_cell(str(output)).cell.robot.tcp.approach_axis == axis
    kinematics = Scene.build(read_cell(str(output))).kinematics
    T = kinematics.forward(np.zeros(6))
    column, sign = AXES[axis]
    assert sign * T[:3, column] == pytest.approx([0, 0, 1], abs=1e-6)


def test_a_wrist_that_swings_points_where_it_holds_the_tool(tmp_path: Path) -> None:
    """Three axes, the last a pitch: the tool sticks out along the flange's x."""
    four = arm().split('<link name="link4"')[0]
    inside = four + fixed("t", "link3", "tool0", 'xyz="0.2 0 0"')
    path = urdf(tmp_path / "arm.urdf", inside)
    new_cell(path, output=tmp_path / "cell.yaml")
    assert 'approach_axis: "+x"' in (tmp_path / "cell.yaml").read_text()


def test_the_bin_keeps_out_of_the_robots_own_table(tmp_path: Path) -> None:
    """It moves to the nearest place that is clear, and that is said."""
    table = solid("0.9 0 0.05", "0.9 0.9 0.3")
    path = urdf(tmp_path / "arm.urdf", arm(base=table))
    output = tmp_path / "cell.yaml"
    made = new_cell(path, output=output)
    assert "in front of the base it would collide with base_link" in made.stderr
    checked(output)


def reached(output: Path, folder: Path) -> BinMap:
    """Reduced bin scan of a new cell as it is."""
    bin_scan(
        None,
        folder / "bin.h5",
        cell=str(output),
        overrides=["bin_scan.grid=[3,2]", "bin_scan.repeats=1"],
    )
    return read_bin_map(folder / "bin.h5")


WIDE_WRIST = solid("0 0 0", "0.4 0.4 0.05")


def test_a_flange_too_wide_for_the_bin_is_given_a_tool(tmp_path: Path) -> None:
    """It could pick nothing by itself; the note says so, and the scan reaches."""
    inside = arm(flange='xyz="0 0 0.05"').replace(
        '<link name="tool0"/>', f'<link name="tool0">{WIDE_WRIST}</link>'
    )
    path = urdf(tmp_path / "arm.urdf", inside)
    output = tmp_path / "cell.yaml"
    made = new_cell(path, output=output)
    tcp = read_cell(str(output)).cell.robot.tcp
    assert tcp.xyz[:2] == (0, 0)
    assert tcp.xyz[2] > 0.1
    assert f"robot.tcp is {tcp.xyz[2]:g} m beyond tool0" in made.stderr
    assert (reached(output, tmp_path).status == Status.PATH_FOUND).any()


def test_the_tcp_is_at_the_end_of_the_tool_in_the_urdf(tmp_path: Path) -> None:
    """A gripper beyond the flange, which would otherwise meet the part first."""
    body = f'<link name="gripper">{solid("0 0 0.1", "0.04 0.04 0.2")}</link>'
    path = urdf(tmp_path / "arm.urdf", arm(body + fixed("g", "tool0", "gripper")))
    made = new_cell(path, output=tmp_path / "cell.yaml")
    tcp = read_cell(str(tmp_path / "cell.yaml")).cell.robot.tcp
    assert (tcp.parent, tcp.xyz) == ("tool0", (0, 0, 0.2))
    assert "0.2 m beyond tool0, at the end of what the URDF has there" in made.stderr


def test_links_that_touch_too_often_are_named(tmp_path: Path) -> None:
    """Shapes that are too coarse make a map red; allowing it is up to the user."""
    ball = '<collision><geometry><sphere radius="0.33"/></geometry></collision>'
    inside = arm().replace('<link name="link3">', f'<link name="link3">{ball}')
    made = new_cell(urdf(tmp_path / "a.urdf", inside), output=tmp_path / "cell.yaml")
    said = re.search(r"note: link1 and link3 touch in (\d+)% of random", made.stderr)
    assert said is not None
    assert 50 <= int(said[1]) < 98
    assert not (tmp_path / "cell.srdf").exists()


@pytest.mark.slow
def test_an_arm_that_hangs_from_a_shoulder_finds_its_bin(tmp_path: Path) -> None:
    """Its tool points down beside and below it, hardly ever in front."""
    talos = "package://example-robot-data/robots/talos_data/robots/talos_left_arm.urdf"
    output = tmp_path / "cell.yaml"
    new_cell(talos, output=output)
    x, y, z = read_cell(str(output)).cell.bin.pose.xyz
    assert x == 0.0
    assert y > 0.3
    assert z < -0.2
    assert (reached(output, tmp_path).status == Status.PATH_FOUND).any()


def test_a_tool_point_stays_where_its_maker_has_it(tmp_path: Path) -> None:
    """A link called tcp is none that carries a tool."""
    inside = arm(fixed("g", "tool0", "hand_tcp"), flange='xyz="0 0 0.05"').replace(
        '<link name="tool0"/>',
        f'<link name="tool0">{WIDE_WRIST}</link><link name="hand_tcp"/>',
    )
    path = urdf(tmp_path / "arm.urdf", inside)
    made = new_cell(path, output=tmp_path / "cell.yaml")
    assert "hand_tcp, xyz: [0, 0, 0]" in (tmp_path / "cell.yaml").read_text()
    assert (
        "no grasp in the bin is reached at the places tried: nothing is" in made.stderr
    )


def test_an_arm_on_a_high_body_finds_its_bin_higher(tmp_path: Path) -> None:
    """The floor is 3 m below its shoulder, and the arm 2.1 m long."""
    high = arm().replace('xyz="0 0 0.3"', 'xyz="0 0 3"', 1)
    path = urdf(tmp_path / "arm.urdf", high)
    output = tmp_path / "cell.yaml"
    new_cell(path, output=output)
    assert read_cell(str(output)).cell.bin.pose.xyz[2] > 1.0
    assert (reached(output, tmp_path).status == Status.PATH_FOUND).any()


def test_four_axes_pick_at_the_roll_they_have(tmp_path: Path) -> None:
    """Yaw and three pitches: the tool lies in the plane through the first axis."""
    pitches = arm().split('<link name="link5"')[0].replace('"0 0 1"', '"0 1 0"')
    inside = pitches.replace('"0 1 0"', '"0 0 1"', 1)
    inside += fixed("t", "link4", "tool0", 'xyz="0 0 0.3"')
    path = urdf(tmp_path / "arm.urdf", inside)
    output = tmp_path / "cell.yaml"
    new_cell(path, output=output)
    loaded = read_cell(str(output))
    assert loaded.cell.tool.roll == "free"
    found = reached(output, tmp_path)
    assert found.winning_roll is not None
    hit = np.argwhere(found.status == Status.PATH_FOUND)
    assert len(hit) >= 3
    scene = Scene.build(loaded)
    x, y, layer = found.x, found.y, found.layer
    ends = np.cumsum(found.paths.row_size)
    for grasp in hit:
        row, j, i, _ = grasp
        p = scene.T_base_bin @ [x[i], y[j], layer[row], 1.0]
        q = found.paths.configuration[ends[present(found.best).row[tuple(grasp)]] - 1]
        T = scene.kinematics.forward(q)
        np.testing.assert_allclose(T[:3, 3], p[:3], atol=1e-6)
        np.testing.assert_allclose(T[:3, 2], [0, 0, -1], atol=1e-6)
        # Turned by the roll that the map has, the listed orientation is the true one.
        turned = scene.kinematics.forward(q)[:3, :3]
        grid = bin_test_frames(loaded.cell, scene.T_base_bin).frames
        listed = Rotation.from_matrix(grid.orientations[0].copy())
        about = np.array([0.0, 0.0, found.winning_roll[tuple(grasp)]])
        met = (listed * Rotation.from_rotvec(about)).as_matrix()
        np.testing.assert_allclose(met, turned, atol=1e-5)


def test_a_cell_that_needs_fixing_is_written(tmp_path: Path) -> None:
    """Exit code 2 and a list on stderr; the answer names the file."""
    inside = arm().replace('lower="-2.9" upper="2.9"', 'lower="0" upper="0"', 1)
    path = urdf(tmp_path / "arm.urdf", inside)
    output = tmp_path / "cell.yaml"
    result = new_cell(path, "--json", output=output, code=2)
    assert "cell.yaml: to be fixed: robot.limits: joint 'j1' has no" in result.stderr
    assert json.loads(result.stdout)["problems"]
    assert output.exists()


def test_what_the_loader_warns_of_is_said_at_once(tmp_path: Path) -> None:
    """An arm without collision elements would be green everywhere."""
    path = urdf(tmp_path / "arm.urdf", arm().replace("collision", "visual"))
    made = new_cell(path, output=tmp_path / "cell.yaml")
    assert "note: NOTHING OF THE ARM IS CHECKED" in made.stderr
