"""Reading cells: what is found, what is resolved, what is refused."""

from __future__ import annotations

import json
import math
import pickle
import struct
from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.loading import (
    LoadedCell,
    cell_from_json,
    read_cell,
    shipped_cells,
    stored_cell,
)
from reachmap.cell.text.yaml_writer import cell_yaml
from reachmap.errors import CellError
from reachmap.geometry import transform_from_parts, yaw_transform

URDF = """<robot name="mini">
  <link name="base"/>
  <link name="arm"><collision><geometry>{shape}</geometry></collision></link>
  <link name="tip"/>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="1.5" effort="1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="arm"/><child link="tip"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.4" velocity="0.2" effort="1"/>
  </joint>
</robot>
"""
CELL = """\
format: reachmap.cell
format_version: "1.0"
name: mini
robot:
  urdf: mini.urdf
  tcp: {parent: tip}
  limits: {acceleration_rad_s2: 1.0}
bodies:
  - name: post
    shape: {box: [0.1, 0.1, 1.0]}
    pose: {xyz: [2, 0, 0]}
bin:
  inner: [0.3, 0.2, 0.1]
  pose: {xyz: [1, 0, 0]}
scan_configuration:
  q_deg: {turn: 90, slide: 0.1}
workspace_scan:
  cubes: [{name: one, min: [0, 0, 0], max: [1, 1, 0], grid: [3, 3]}]
"""
SRDF = """<robot name="mini">
  <group name="all"><chain base_link="base" tip_link="tip"/></group>
  <group name="outer"><group name="all"/></group>
  <group_state name="home" group="all">
    <joint name="turn" value="0.5"/><joint name="slide" value="0.2"/>
  </group_state>
  <group_state name="half" group="all"><joint name="turn" value="0.5"/></group_state>
  <disable_collisions link1="base" link2="tip"/>
</robot>
"""
LIMITS = """\
joint_limits:
  turn:
    has_velocity_limits: true
    max_velocity: 1.0
    has_acceleration_limits: true
    max_acceleration: 3.0
    has_position_limits: true
    min_position: -1.0
    max_position: 1.5
  gripper: {has_velocity_limits: true, max_velocity: 9}
"""


def triangle_stl(side: float) -> bytes:
    """Binary STL of one triangle that spans a cube of this side."""
    values = [0.0] * 3 + [0.0, 0.0, 0.0] + [side, side, side] + [side, 0.0, 0.0]
    return b"\0" * 80 + struct.pack("<I", 1) + struct.pack("<12fH", *values, 0)


def write(folder: Path, cell: str = CELL, shape: str = '<box size="1 .1 .1"/>') -> str:
    """Write a cell and its URDF; return the path of the cell."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mini.urdf").write_text(URDF.format(shape=shape))
    (folder / "cell.yaml").write_text(cell)
    return str(folder / "cell.yaml")


@pytest.mark.parametrize("name", shipped_cells())
def test_shipped_cells_load_and_pickle(name: str) -> None:
    """Every shipped cell loads by name, without warnings, and can be pickled."""
    loaded = read_cell(name)
    assert loaded.cell.name == name
    assert loaded.warnings == ()
    assert pickle.loads(pickle.dumps(loaded)) == loaded


@pytest.mark.parametrize("name", shipped_cells())
def test_a_cell_survives_the_artefact_and_the_export(name: str, tmp_path: Path) -> None:
    """The JSON of an artefact and the exported YAML are the same cell."""
    loaded = read_cell(name, ["planner.range_rad=null", "seed=7"])
    stored = cell_from_json(
        loaded.resolved_json,
        urdf=loaded.urdf,
        srdf=loaded.srdf,
        files_sha256=loaded.files_sha256,
    )
    path = tmp_path / "exported.yaml"
    path.write_text(cell_yaml(loaded.cell, comment="two\nlines"))
    exported = read_cell(str(path))
    assert stored.sha256 == exported.sha256 == loaded.sha256
    assert stored.cell == exported.cell == loaded.cell
    assert path.read_text().startswith("# two\n# lines\nformat: reachmap.cell\n")


def test_a_path_and_a_name_give_the_same_cell() -> None:
    """A shipped cell is a file like any other."""
    path = shipped_cells()["planar-toy"]
    assert read_cell(str(path)).sha256 == read_cell("planar-toy").sha256


def test_an_unknown_name_says_which_cells_there_are() -> None:
    """A near miss is guessed."""
    with pytest.raises(CellError, match="did you mean 'planar-toy'"):
        read_cell("planar-toys")
    with pytest.raises(CellError, match="known: panda-eye-in-hand"):
        read_cell("zzz")
    with pytest.raises(CellError, match=r"none\.yaml: no such file"):
        read_cell("none.yaml")


def test_a_map_is_no_cell(tmp_path: Path) -> None:
    """However large it is; what is said names the way to its cell."""
    for size in (10, 400_000):
        path = tmp_path / "map.h5"
        path.write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * size)
        with pytest.raises(CellError, match="an HDF5 file, a map perhaps") as told:
            read_cell(path)
        assert "cells --export" in told.value.lines[0]


def test_four_mistakes_are_four_lines(tmp_path: Path) -> None:
    """Each has file, line and column, the value found and what was expected."""
    text = CELL.replace("xyz: [1, 0, 0]", "xyz: [1, 0, abc]")
    text = text.replace("box:", "bx:").replace("parent: tip", "parent: tipp")
    path = write(tmp_path, text.replace("[3, 3]", "[3, 0]"))
    with pytest.raises(CellError, match="tipp") as caught:
        read_cell(path)
    assert caught.value.lines == (
        f"{path}:6:17: robot.tcp.parent: no frame 'tipp' in the URDF; "
        "did you mean 'tip'?",
        f"{path}:10:13: bodies[post].shape.bx: unknown key; did you mean 'box'?",
        f"{path}:14:22: bin.pose.xyz.2: expected a number (got 'abc')",
        f"{path}:18:65: workspace_scan.cubes[one].grid.1: expected a number >= 1 "
        "(got 0)",
    )


@pytest.mark.parametrize(
    ("right", "wrong", "path"),
    [
        ("  inner:", "  iner:", "bin.iner"),
        ("  inner:", "  inside:", "bin.inside"),
        ("bin:", "bni:", "bni"),
        ("scan_configuration:", "scan_config:", "scan_config"),
        ("robot:", "robto:", "robto"),
        ("  urdf:", "  udrf:", "robot.udrf"),
        ("    shape:", "    shap:", "bodies[post].shap"),
    ],
)
def test_a_misspelt_key_is_one_line(
    tmp_path: Path, right: str, wrong: str, path: str
) -> None:
    """It is not called missing as well; what else is missing still is."""
    text = CELL.replace(right, wrong, 1)
    assert text != CELL
    with pytest.raises(CellError, match="did you mean") as caught:
        read_cell(write(tmp_path, text))
    key = right.strip().removesuffix(":")
    (line,) = caught.value.lines
    assert line.endswith(f": {path}: unknown key; did you mean {key!r}?")


def test_a_key_that_no_other_is_like_is_missing(tmp_path: Path) -> None:
    """Two mistakes, two lines."""
    text = CELL.replace("  inner:", "  zzz:", 1)
    with pytest.raises(CellError, match=r"bin\.inner: is missing") as caught:
        read_cell(write(tmp_path, text))
    assert len(caught.value.lines) == 2


def test_files_that_are_missing_are_mistakes_with_places(tmp_path: Path) -> None:
    """URDF, SRDF, limits and meshes are all looked for before anything is said."""
    text = CELL.replace("urdf: mini.urdf", "urdf: none.urdf\n  srdf: none.srdf")
    text = text.replace("  limits:", "  joint_limits: none.yaml\n  limits:")
    text = text.replace("{box: [0.1, 0.1, 1.0]}", "{mesh: {file: none.stl}}")
    path = write(tmp_path, text)
    with pytest.raises(CellError, match=r"none\.urdf") as caught:
        read_cell(path)
    starts = [line.split(": file")[0] for line in caught.value.lines]
    assert starts == [
        f"{path}:5:9: robot.urdf",
        f"{path}:8:17: robot.joint_limits",
        f"{path}:12:26: bodies[post].shape.mesh.file",
    ]
    (tmp_path / "cell.yaml").write_text(text.replace("none.urdf", "mini.urdf"))
    with pytest.raises(CellError, match=r":6:9: robot\.srdf: file 'none\.srdf'"):
        read_cell(path)


def test_group_and_group_state_are_written_out(tmp_path: Path) -> None:
    """Afterwards nobody needs the SRDF to know joints and scan configuration."""
    text = CELL.replace("urdf: mini.urdf", "urdf: mini.urdf\n  srdf: m.srdf")
    text = text.replace("  tcp:", "  group: outer\n  tcp:")
    text = text.replace("q_deg: {turn: 90, slide: 0.1}", "group_state: home")
    path = write(tmp_path, text)
    (tmp_path / "m.srdf").write_text(SRDF)
    loaded = read_cell(path)
    assert loaded.cell.robot.joints == ("turn", "slide")
    assert loaded.cell.robot.group is None
    assert loaded.scan_configuration_rad == {"turn": 0.5, "slide": 0.2}
    stored = cell_from_json(loaded.resolved_json, urdf=loaded.urdf, srdf=loaded.srdf)
    assert stored.sha256 == loaded.sha256
    with pytest.raises(CellError, match="no group_state 'hom' in the SRDF; did you"):
        read_cell(path, ["scan_configuration.group_state=hom"])
    with pytest.raises(CellError, match="the state lacks joints: slide"):
        read_cell(path, ["scan_configuration.group_state=half"])
    with pytest.raises(CellError, match="no group 'al' in the SRDF"):
        read_cell(path, ["robot.group=al"])


def test_a_state_of_more_joints_is_cut_to_those_that_move(tmp_path: Path) -> None:
    """The fingers of a hand are in its group states, too."""
    text = CELL.replace("urdf: mini.urdf", "urdf: mini.urdf\n  srdf: m.srdf")
    text = text.replace("  tcp:", "  locked_joints_deg: {slide: 0.3}\n  tcp:")
    text = text.replace("q_deg: {turn: 90, slide: 0.1}", "group_state: home")
    (tmp_path / "m.srdf").write_text(SRDF)
    assert read_cell(write(tmp_path, text)).scan_configuration_rad == {"turn": 0.5}


def test_a_group_state_needs_an_srdf(tmp_path: Path) -> None:
    """It is said at the state, not later by an engine."""
    text = CELL.replace("q_deg: {turn: 90, slide: 0.1}", "group_state: home")
    with pytest.raises(CellError, match="a group_state needs robot"):
        read_cell(write(tmp_path, text))


def test_degrees_and_metres_of_the_scan_configuration(tmp_path: Path) -> None:
    """q_deg is in degrees for turning joints and in metres for sliding ones."""
    loaded = read_cell(write(tmp_path))
    assert loaded.scan_configuration_rad == {"turn": math.radians(90), "slide": 0.1}


def test_moveit_limits_tighten_and_are_written_out(tmp_path: Path) -> None:
    """The tightest wins, other joints of the file are ignored."""
    text = CELL.replace("  limits:", "  joint_limits: limits.yaml\n  limits:")
    (tmp_path / "limits.yaml").write_text(LIMITS)
    path = write(tmp_path, text)
    limits = read_cell(path).cell.robot.limits
    assert limits.velocity_rad_s == {"turn": 1.0}
    assert limits.acceleration_rad_s2 == {"turn": 1.0, "slide": 1.0}
    low, high = limits.position_deg["turn"]
    assert math.isclose(low, math.degrees(-1.0))
    assert math.isclose(high, math.degrees(1.5))
    tighter = read_cell(path, ["robot.limits.position_deg={turn: [-30, 170]}"])
    assert tighter.cell.robot.limits.position_deg["turn"][0] == -30.0
    assert tighter.cell.robot.joint_limits is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("max_velocity: 1.0", "max_velocity: -1", r"turn\.max_velocity: expected a f"),
        ("max_velocity: 1.0", "max_velocity: .nan", r"max_velocity: expected a finite"),
        (
            "max_velocity: 1.0",
            "max_speed: 1",
            r"has_velocity_limits needs max_velocity",
        ),
        ("max_position: 1.5", "max_position: -2", "min_position must be below"),
        ("joint_limits:", "limits:", "expected a mapping joint_limits"),
    ],
)
def test_wrong_moveit_limits_are_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    """Mistakes in the second file are reported with its lines."""
    text = CELL.replace("  limits:", "  joint_limits: limits.yaml\n  limits:")
    (tmp_path / "limits.yaml").write_text(LIMITS.replace(old, new))
    with pytest.raises(CellError, match=message) as caught:
        read_cell(write(tmp_path, text))
    assert "limits.yaml:" in str(caught.value)


def test_bodies_may_be_named_by_their_side(tmp_path: Path) -> None:
    """As the walls of a bin are: "bin wall +x"."""
    loaded = read_cell(write(tmp_path, CELL.replace("name: post", "name: guard +x")))
    assert "guard +x" in [body.name for body in loaded.cell.bodies]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("turn: 90", "trun: 90", "q_deg.trun: not a joint that moves; did you mean"),
        ("turn: 90, ", "", "q_deg: joints are missing: turn"),
        ("name: post", "name: arm", "'arm' is the name of a link"),
        ("name: post", "name: bin", "'bin' is the name of a link, a frame or the bin"),
        ("name: post", "name: bin wall", r"bodies\[bin wall\]\.name: "),
        ("name: post", "name: bin wall +x", "'bin wall \\+x' is the name of a link"),
        ("name: post", "name: post/1", r"of letters, digits, spaces and \. \+ - _"),
        ("name: post", "name: post\n    touch: [bse]", "no link or body 'bse'"),
        ("name: post", "name: post\n    attach_to: no", "no frame 'no' in the URDF"),
        ("parent: tip", "parent: base", "no joint moves between the base and the TCP"),
        ("  tcp:", "  joints: [turn, sldie]\n  tcp:", "no moving joint 'sldie'; did"),
        ("  tcp:", "  locked_joints_deg: {x: 1}\n  tcp:", "not a joint that moves"),
        ("  tcp:", "  ik: {redundant_joint: q}\n  tcp:", "'q' is not a joint that"),
        ("{parent: tip}", "{parent: tip, rpy_deg: [0, 0, 0], quaternion_wxyz: "
         "[1, 0, 0, 0]}", "give rpy_deg or quaternion_wxyz, not both"),
        ("{parent: tip}", "{parent: tip, quaternion_wxyz: [1, 1, 0, 0]}",
         "must have length 1"),
        ("{box: [0.1, 0.1, 1.0]}", "{box: [1, 1, 1], sphere: {radius: 1}}",
         "give exactly one of box"),
        ("inner: [0.3, 0.2, 0.1]", "inner: [300, 0.2, 0.1]", "lengths are in metres"),
        ("inner: [0.3, 0.2, 0.1]", "inner: [0.3, 0.2]", "a value is missing"),
        ("inner: [0.3, 0.2, 0.1]", "inner: [0.3, 0.2, .nan]", "a finite number"),
        ("inner: [0.3, 0.2, 0.1]", "inner: [0.3, 0.2, true]", r"number \(got true\)"),
        ('format_version: "1.0"', "format_version: 1.0", "write it in quotes"),
        ('format_version: "1.0"', 'format_version: "2.0"', "expected text that match"),
        ("grid: [3, 3]", "grid: [9999, 9999]", "at most 50,000,000 test frames"),
        ("max: [1, 1, 0]", "max: [1, -1, 0]", r"min\.y = 0.* is above max\.y"),
        ("  cubes:", "  orientations: {family: corn}\n  cubes:", "family: one of 'co"),
        ("  cubes:", "  orientations: {family: list}\n  cubes:", "rpy_deg: is missing"),
        ("bodies:", "placement: {x: [2, 1]}\nbodies:", "low <= high"),
    ],
)  # fmt: skip
def test_wrong_cells_are_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    """One clear sentence, at a place of the file."""
    assert old in CELL
    path = write(tmp_path, CELL.replace(old, new))
    with pytest.raises(CellError, match=message) as caught:
        read_cell(path)
    assert len(caught.value.lines) == 1
    assert caught.value.lines[0].startswith(f"{path}:")


def test_meshes_are_hashed_and_their_sizes_questioned(tmp_path: Path) -> None:
    """Ten metres raise a warning, a hundred are refused, in cell and URDF alike."""
    text = CELL.replace("{box: [0.1, 0.1, 1.0]}", "{mesh: {file: post.stl}}")
    path = write(tmp_path, text, '<mesh filename="arm.stl"/>')
    (tmp_path / "arm.stl").write_bytes(triangle_stl(1.0))
    for side, word in ((1.0, ""), (20.0, "20 m large"), (1e-4, "only 0.0001 m")):
        (tmp_path / "post.stl").write_bytes(triangle_stl(side))
        loaded = read_cell(path)
        assert sorted(loaded.files_sha256) == ["arm.stl", "body post: post.stl"]
        assert len(loaded.warnings) == bool(word)
        assert word in "".join(loaded.warnings)
    (tmp_path / "post.stl").write_bytes(triangle_stl(1000.0))
    with pytest.raises(CellError, match="1,000 m large; is it in millimetres"):
        read_cell(path)
    scaled = text.replace("file: post.stl", "file: post.stl, scale: 0.001")
    assert (
        read_cell(write(tmp_path, scaled, '<mesh filename="arm.stl"/>')).warnings == ()
    )
    (tmp_path / "arm.stl").write_bytes(triangle_stl(1.0)[:-1])
    with pytest.raises(CellError, match=r"robot\.urdf: mesh .*truncated"):
        read_cell(path)


def test_large_bodies_raise_a_warning(tmp_path: Path) -> None:
    """A floor of 30 m is allowed, but questioned with its place."""
    path = write(tmp_path)
    loaded = read_cell(path, ["bodies.post.shape.box=[30, 1, 1]", "bin.inner.0=11"])
    assert [line.split(": ", 1)[1] for line in loaded.warnings] == [
        "body 'post' is 30 m large; lengths are in metres",
        "the bin is 11 m large; lengths are in metres",
    ]


def meshed_cell(folder: Path) -> LoadedCell:
    """A cell whose URDF and body each have a mesh."""
    text = CELL.replace("{box: [0.1, 0.1, 1.0]}", "{mesh: {file: post.stl}}")
    path = write(folder, text, '<mesh filename="arm.stl"/>')
    (folder / "arm.stl").write_bytes(triangle_stl(1.0))
    (folder / "post.stl").write_bytes(triangle_stl(1.0))
    return read_cell(path)


def test_the_fingerprint_is_of_contents_not_of_paths(tmp_path: Path) -> None:
    """Another folder and another description change nothing, one byte does."""
    here = meshed_cell(tmp_path / "here")
    there = meshed_cell(tmp_path / "there")
    assert here.sha256 == there.sha256
    described = read_cell(here.source, ["description=other"])
    assert described.sha256 == here.sha256
    assert read_cell(here.source, ["seed=2"]).sha256 != here.sha256
    for name in ("arm.stl", "post.stl", "mini.urdf"):
        path = tmp_path / "there" / name
        before = path.read_bytes()
        path.write_bytes(before + b" ")
        assert read_cell(there.source).sha256 != here.sha256
        path.write_bytes(before)


def test_a_changed_or_missing_mesh_of_an_artefact_is_refused(tmp_path: Path) -> None:
    """What was mapped with other meshes is not continued silently."""
    loaded = meshed_cell(tmp_path)

    def again() -> LoadedCell:
        return cell_from_json(
            loaded.resolved_json,
            urdf=loaded.urdf,
            files_sha256=loaded.files_sha256,
            source="map.h5",
        )

    assert again().sha256 == loaded.sha256
    (tmp_path / "post.stl").write_bytes(triangle_stl(2.0))
    with pytest.raises(CellError, match=r"map\.h5: mesh 'body post: post\.stl' has ch"):
        again()
    (tmp_path / "post.stl").unlink()
    with pytest.raises(
        CellError, match=r"map\.h5: bodies\[post\].*post\.stl.* not found"
    ):
        again()
    stored = stored_cell(loaded.resolved_json).cell
    assert stored == loaded.cell


@pytest.mark.parametrize(
    "text", ["", "[]", "{", "null", '{"format": "reachmap.cell"}', "[" * 100_000, "NaN"]
)
def test_a_broken_cell_in_an_artefact_is_refused(text: str) -> None:
    """Whatever the JSON is, the error names the artefact."""
    with pytest.raises(CellError, match=r"^map\.h5: "):
        cell_from_json(text, urdf="<robot/>", source="map.h5")


def test_changes_have_their_own_fingerprint(tmp_path: Path) -> None:
    """A new bin pose and scan configuration keep full precision and reload."""
    loaded = read_cell(write(tmp_path))
    T_base_bin = yaw_transform(0.1, 0.2, 0.3, 0.7)
    q = {"turn": np.float64(1 / 3), "slide": 0.1}
    changed = loaded.with_changes(bin_pose=T_base_bin, scan_configuration_rad=q)
    assert np.allclose(changed.cell.bin.pose.matrix(), T_base_bin, atol=1e-15)
    assert changed.scan_configuration_rad == {"turn": 1 / 3, "slide": 0.1}
    assert changed.sha256 != loaded.sha256
    again = cell_from_json(changed.resolved_json, urdf=changed.urdf)
    assert again.sha256 == changed.sha256
    assert loaded.with_changes().sha256 == loaded.sha256
    R = np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]])
    turned = loaded.with_changes(bin_pose=transform_from_parts(R, np.zeros(3)))
    assert np.allclose(turned.cell.bin.pose.matrix()[:3, :3], R)


def test_what_is_kept_for_the_artefact_is_complete(tmp_path: Path) -> None:
    """Text as read, overrides in order, resolved JSON with absolute paths."""
    path = write(tmp_path)
    loaded = read_cell(path, ["seed=3", "bin.wall=0.01"])
    assert loaded.text == CELL
    assert loaded.overrides == ("seed=3", "bin.wall=0.01")
    data = json.loads(loaded.resolved_json)
    assert data["robot"]["urdf"] == str(tmp_path / "mini.urdf")
    assert data["seed"] == 3
    assert loaded.resolve("mini.urdf") == tmp_path / "mini.urdf"
    with pytest.raises(CellError, match=r"cell\.yaml: file 'none' not found"):
        loaded.resolve("none")
