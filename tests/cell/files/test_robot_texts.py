"""URDF, SRDF and xacro as the loader reads them."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import pinocchio as pin
import pytest

from reachmap.cell.files.resources import Resolver, data_folder
from reachmap.cell.files.robot_text import robot_text
from reachmap.cell.files.srdf import parse_srdf
from reachmap.cell.files.urdf import parse_urdf
from reachmap.cell.loading import read_cell
from reachmap.errors import CellError, MissingExtraError

JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>{4}</joint>'
)
LIMIT = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'


def robot(*parts: str, links: Iterable[str] = "abcd") -> str:
    """A URDF of single-letter links and the given joints."""
    inside = "".join(f'<link name="{name}"/>' for name in links) + "".join(parts)
    return f'<robot name="r">{inside}</robot>'


CHAIN = (
    JOINT.format("ab", "revolute", "a", "b", LIMIT),
    JOINT.format("bc", "fixed", "b", "c", ""),
    JOINT.format("bd", "continuous", "b", "d", ""),
)


@pytest.mark.parametrize(
    "name",
    [
        "ur_description/urdf/ur5_joint_limited_robot.urdf",
        "ur_description/urdf/ur10_robot.urdf",
        "panda_description/urdf/panda.urdf",
        "kinova_description/robots/kinova.urdf",
        "talos_data/robots/talos_full_v2.urdf",
    ],
)
def test_structure_agrees_with_pinocchio(name: str) -> None:
    """Moving joints, their limits and the links are those that the engine finds."""
    folder = data_folder()
    assert folder is not None
    path = folder / "example-robot-data" / "robots" / name
    found = parse_urdf(path.read_text(), path.name)
    model = pin.buildModelFromUrdf(str(path))
    moving = {n: j for n, j in found.joints.items() if j.type != "fixed"}
    assert set(moving) == set(model.names) - {"universe"}
    bodies = {f.name for f in model.frames if f.type == pin.FrameType.BODY}
    assert set(found.links) <= bodies | {found.root}
    for joint_name, joint in moving.items():
        index = model.joints[model.getJointId(joint_name)].idx_q
        if joint.lower is not None and joint.upper is not None:
            assert model.lowerPositionLimit[index] == joint.lower
            assert model.upperPositionLimit[index] == joint.upper


def test_chains_leave_out_what_does_not_move() -> None:
    """Fixed and mimic joints are on the way, but not in the chain."""
    mimic = '<mimic joint="ab"/>' + LIMIT
    text = robot(*CHAIN, JOINT.format("de", "revolute", "d", "e", mimic), links="abcde")
    found = parse_urdf(text, "r.urdf")
    assert found.root == "a"
    assert found.chain("a", "c") == ("ab",)
    assert found.chain("a", "e") == ("ab", "bd")
    assert found.chain("b", "e") == ("bd",)
    assert found.chain("c", "c") == ()
    assert found.chain("c", "e") == ("bd",)
    assert found.chain("ab", "de") == found.chain("b", "e")
    assert found.leaves() == ("c", "e")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not valid XML"),
        ("<robot>", r"r\.urdf:1:8: not valid XML"),
        ("<model/>", "root element <robot>"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "document type declarations"),
        (robot(), r"one root link \(got 4: a, b, c, d\)"),
        (robot(*CHAIN, links="abcdd"), "link 'd' is given twice"),
        (robot(*CHAIN, CHAIN[0]), "'b' is the child of two joints"),
        (robot(*CHAIN, links="abc"), "unknown child link 'd'"),
        (robot(JOINT.format("x", "prismatic", "a", "b", ""), links="ab"), "needs <li"),
        (robot(JOINT.format("x", "screw", "a", "b", ""), links="ab"), "unknown type"),
        (
            robot(
                JOINT.format("x", "fixed", "b", "a", ""),
                JOINT.format("y", "fixed", "a", "b", ""),
                links="abc",
            ),
            "cycle",
        ),
        (robot(*CHAIN).replace('"-1"', '"nan"'), "lower: expected a finite number"),
        (robot(*CHAIN).replace('"-1"', '"2"'), "limit 2 is above 1"),
        (
            robot(*CHAIN, '<gazebo><origin xyz="1 2 x"/></gazebo>'),
            "<origin xyz>: expected 3 finite numbers",
        ),
        (
            robot(*CHAIN).replace(
                LIMIT, LIMIT + '<mimic joint="ab" multiplier="inf"/>'
            ),
            "multiplier: expected a finite number",
        ),
        (robot(*CHAIN).replace('"ab"', '"universe"'), "Pinocchio keeps this name"),
        (robot(links=[f"l{i}" for i in range(2001)]), "more than 2,000 links"),
    ],
)  # fmt: skip
def test_broken_urdfs_are_refused(text: str, message: str) -> None:
    """What an engine would choke on is a sentence."""
    with pytest.raises(CellError, match=message) as caught:
        parse_urdf(text, "r.urdf")
    assert all(line.startswith("r.urdf") for line in caught.value.lines)


def test_groups_of_an_srdf() -> None:
    """Joints, chains, links and subgroups; fixed joints are left out."""
    found = parse_srdf(
        """<robot name="r">
        <group name="joints"><joint name="ab"/><joint name="bc"/></group>
        <group name="chain"><chain base_link="a" tip_link="d"/></group>
        <group name="links"><link name="d"/></group>
        <group name="both"><group name="joints"/><group name="chain"/></group>
        <group name="loop"><group name="loop"/><joint name="bd"/></group>
        <disable_collisions link1="a" link2="c" reason="Never"/>
        </robot>""",
        "r.srdf",
        parse_urdf(robot(*CHAIN), "r.urdf"),
    )
    assert found.groups == {
        "joints": ("ab",),
        "chain": ("ab", "bd"),
        "links": ("bd",),
        "both": ("ab", "bd"),
        "loop": ("bd",),
    }
    assert found.disabled_pairs == (("a", "c"),)


@pytest.mark.parametrize("value", ["", "x", "nan", "1e999", "0 1"])
def test_a_state_holds_finite_numbers(value: str) -> None:
    """What is none is left out and named; values of virtual joints are nobody's."""
    text = f"""<robot name="r"><group_state name="home" group="g">
        <joint name="ab" value="{value}"/><joint name="virtual" value="{value}"/>
        <joint name="bd" value="0.5"/></group_state></robot>"""
    found = parse_srdf(text, "r.srdf", parse_urdf(robot(*CHAIN), "r.urdf"))
    assert found.states == {"home": {"bd": 0.5}}
    (note,) = found.notes
    assert note.startswith("r.srdf:2: group_state 'home': joint 'ab': expected one")


def test_misspelt_elements_of_an_srdf_are_named() -> None:
    """Those of the format that say nothing to a map are not."""
    text = """<robot name="r"><disable_collision link1="a" link2="c"/>
        <virtual_joint name="v"/><passive_joint name="ab"/><joint_property/>
        <end_effector name="e"/><link_sphere_approximation link="a"/></robot>"""
    found = parse_srdf(text, "r.srdf", parse_urdf(robot(*CHAIN), "r.urdf"))
    (note,) = found.notes
    assert "<disable_collision> is not read; did you mean 'disable_collisions'" in note


XACRO = """<robot name="toy" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="length" default="1.0"/>
  <xacro:property name="half" value="${float('$(arg length)') / 2}"/>
  <link name="base"/>
  <link name="tip"><collision>
    <origin xyz="${half} 0 0"/>
    <geometry><mesh filename="package://parts/arm.stl"/></geometry>
  </collision></link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/>
  </joint>
</robot>
"""
XACRO_CELL = """\
format: reachmap.cell
format_version: "1.0"
name: toy
resources: {packages: {parts: vendor}}
robot:
  urdf: toy.urdf.xacro
  xacro_args: {length: 0.5}
  tcp: {parent: tip}
bin: {inner: [0.3, 0.2, 0.1]}
scan_configuration: {q_deg: {turn: 0}}
workspace_scan:
  cubes: [{name: one, min: [0, 0, 0], max: [1, 1, 0], grid: [3, 3]}]
"""


@pytest.fixture
def xacro_cell(tmp_path: Path) -> Path:
    """Path of a cell with a xacro file and a mesh in a package."""
    (tmp_path / "vendor").mkdir()
    ascii_stl = "solid a\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendsolid"
    (tmp_path / "vendor" / "arm.stl").write_text(ascii_stl)
    (tmp_path / "toy.urdf.xacro").write_text(XACRO)
    (tmp_path / "cell.yaml").write_text(XACRO_CELL)
    return tmp_path / "cell.yaml"


def test_xacro_is_expanded_with_its_arguments(xacro_cell: Path) -> None:
    """The text that is kept is the expanded one, without paths of this machine."""
    pytest.importorskip("xacro")
    loaded = read_cell(str(xacro_cell))
    assert 'xyz="0.25 0 0"' in loaded.urdf
    assert str(xacro_cell.parent) not in loaded.urdf
    assert sorted(loaded.files_sha256) == ["package://parts/arm.stl"]
    longer = read_cell(str(xacro_cell), ["robot.xacro_args.length=2"])
    assert 'xyz="1.0 0 0"' in longer.urdf
    assert longer.sha256 != loaded.sha256


@pytest.mark.parametrize(
    ("key", "hint"),
    [("lenght", "did you mean 'length'"), ("x", "known: length")],
)
def test_an_unknown_xacro_argument_is_a_mistake(
    xacro_cell: Path, key: str, hint: str
) -> None:
    """It would be left unused, and the robot be another than was meant."""
    pytest.importorskip("xacro")
    with pytest.raises(CellError, match=rf"xacro_args\.{key}: no such arg.*{hint}"):
        read_cell(str(xacro_cell), [f"robot.xacro_args.{key}=2"])


def test_a_plain_urdf_takes_no_xacro_arguments(xacro_cell: Path) -> None:
    """Arguments that nothing reads are a mistake, too."""
    (xacro_cell.parent / "toy.urdf").write_text(robot(*CHAIN))
    with pytest.raises(CellError, match=r"xacro_args\.length: .*the URDF takes none"):
        read_cell(str(xacro_cell), ["robot.urdf=toy.urdf"])


def test_a_xacro_that_does_not_expand_is_one_line(xacro_cell: Path) -> None:
    """An expression that fails is reported at the reference."""
    pytest.importorskip("xacro")
    broken = XACRO.replace("${half}", "${missing_name}")
    (xacro_cell.parent / "toy.urdf.xacro").write_text(broken)
    with pytest.raises(CellError, match=r"cell\.yaml:6:9: robot\.urdf: .*missing_name"):
        read_cell(str(xacro_cell))


def test_without_the_extra_the_message_names_it(
    xacro_cell: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The missing package is an error of its own kind, with the command to install."""
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(
        MissingExtraError, match=r"pip install 'reachmap-cells\[xacro\]"
    ):
        read_cell(str(xacro_cell))


@pytest.mark.parametrize(
    ("inside", "found"),
    [
        ('<link name="${prefix}a"/>', "'[$]{prefix}a'"),
        ('<xacro:include filename="b.xacro"/>', "<xacro:include>"),
        ('<link name="a"/><!-- ${x} --><xacro:macro name="m"><link name="${x}"/>'
         "</xacro:macro>", ""),
    ],
)  # fmt: skip
def test_a_urdf_that_is_to_be_expanded_says_so(
    tmp_path: Path, inside: str, found: str
) -> None:
    """Expressions outside definitions, which are left over in expanded files."""
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="r" xmlns:xacro="x">{inside}</robot>')
    resolver = Resolver(directory=tmp_path)
    if not found:
        assert robot_text(path, {}, resolver).text == path.read_text()
        return
    with pytest.raises(CellError, match=f"has {found}, which .*arm.urdf.xacro"):
        robot_text(path, {}, resolver)
