"""The flange is found past grippers, whatever they are made of."""

from __future__ import annotations

from itertools import pairwise

import pytest

from reachmap.cell.files.moveit_config import planning_group
from reachmap.cell.files.resources import data_folder
from reachmap.cell.files.srdf import parse_srdf
from reachmap.cell.files.urdf import UrdfDescription, parse_urdf
from reachmap.cell.guesses import finger_joints, guess_base, guess_tip, other_tips


def robot(*joints: str, arm: int = 6) -> UrdfDescription:
    """An arm ``l0`` … ``lN`` with more joints: ``parent>child kind [mimicked]``."""
    rows = [f"l{k}>l{k + 1} revolute" for k in range(arm)] + list(joints)
    links, text = ["l0"], ""
    for row in rows:
        ends, kind, *mimic = row.split()
        parent, _, child = ends.partition(">")
        links.append(child)
        inner = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
        inner += f'<mimic joint="{mimic[0]}"/>' if mimic else ""
        text += (
            f'<joint name="j_{child}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="{child}"/>{inner}</joint>'
        )
    text += "".join(f'<link name="{name}"/>' for name in links)
    return parse_urdf(f'<robot name="r">{text}</robot>', "r")


@pytest.mark.parametrize(
    ("joints", "tip"),
    [
        ((), "l6"),
        (("l6>l7 fixed",), "l7"),
        (("l6>flange fixed", "flange>tool0 fixed"), "tool0"),
        (("l6>tool0 fixed", "tool0>hand fixed", "hand>hand_tcp fixed"), "hand_tcp"),
        (("l6>left_tool0 fixed",), "left_tool0"),
        # a leader with followers beside it, as in most grippers
        (("l6>g fixed", "g>a revolute", "g>b revolute j_a"), "l6"),
        (("l6>tcp fixed", "tcp>a revolute", "g>b revolute j_a", "tcp>g fixed"), "tcp"),
        # one follower hangs on its leader, as in Robotiq's inner fingers
        (("l6>p revolute", "p>q revolute j_p", "l6>r revolute j_p"), "l6"),
        # prismatic pairs
        (("l6>a prismatic", "l6>b prismatic"), "l6"),
        # fingers of two joints each, with names that say nothing
        (("l6>a revolute", "a>b revolute", "l6>c revolute", "c>d revolute"), "l6"),
        # fingers by name
        (("l6>finger_1 revolute",), "l6"),
        (("l6>gripper revolute", "gripper>x revolute"), "l6"),
        (("l6>ee_link fixed", "ee_link>moving_jaw revolute"), "ee_link"),
        # a tool point at a finger is no flange
        (("l6>finger revolute", "finger>finger_tcp fixed"), "l6"),
    ],
)
def test_fingers_are_no_axes(joints: tuple[str, ...], tip: str) -> None:
    """Neither leaders, pairs, branches nor names make an arm longer."""
    found = robot(*joints)
    assert guess_tip(found, guess_base(found)) == tip


@pytest.mark.parametrize(
    ("joints", "tip"),
    [
        # a gas spring follows the second joint, as in the IRB 6640
        (("l1>rod revolute j_l2",), "l6"),
        # a parallelogram keeps the last link level, as in palletisers
        (("l6>level revolute j_l2", "level>t revolute", "t>tool0 fixed"), "tool0"),
        (("l6>level revolute j_l6",), "level"),
        # a SCARA's quill
        (("l6>quill prismatic",), "quill"),
        # a torso that branches into arms
        (("l6>a revolute", "a>b revolute", "b>c revolute", "c>d revolute",
          "d>e revolute", "l6>head revolute"), "e"),
        # a rod leads the last link, as in Dobot's MG400
        (
            ("l1>p revolute j_l2", "p>s revolute j_p", "l6>f revolute j_s",
             "f>g revolute"),
            "g",
        ),
    ],
)  # fmt: skip
def test_axes_are_no_fingers(joints: tuple[str, ...], tip: str) -> None:
    """Followers and branches that arms have do not shorten them."""
    found = robot(*joints)
    assert guess_tip(found, guess_base(found)) == tip


def test_the_planning_group_says_which_joints() -> None:
    """A link that its last joint moves, by its well-known name if it has one."""
    found = robot("l3>side_tool0 fixed", "l6>tool0 fixed")
    assert guess_tip(found, "l0", ["j_l1", "j_l2", "j_l3"]) == "side_tool0"
    assert guess_tip(found, "l0", ["j_l3", "j_l4"]) == "l4"


def test_no_planning_group_with_fingers_is_the_arm() -> None:
    """Arm and hand together are a longer chain where one finger follows the other."""
    grip = ("l6>hand fixed", "hand>a prismatic", "hand>b prismatic j_a")
    found = robot(*grip)
    srdf = """<robot name="r">
    <group name="arm"><chain base_link="l0" tip_link="l6"/></group>
    <group name="hand"><joint name="j_a"/></group>
    <group name="arm_hand"><group name="arm"/><group name="hand"/></group>
    </robot>"""
    groups = parse_srdf(srdf, "r.srdf", found)
    fingers = finger_joints(found, "l0")
    assert planning_group(found, groups, fingers) == tuple(
        f"j_l{k}" for k in range(1, 7)
    )


@pytest.mark.parametrize(
    ("name", "tip"),
    [
        ("panda_description/urdf/panda", "panda_hand_tcp"),
        ("ur_description/urdf/ur3_gripper", "tool0"),
        ("z1_description/urdf/z1", "link06"),
        ("so_arm_description/urdf/so101", "gripper_link"),
        ("tiago_description/robots/tiago", "arm_tool_link"),
        ("kinova_description/robots/kinova", "j2s6s200_end_effector"),
        ("xarm_description/urdf/xarm7", "link_eef"),
    ],
)
def test_flanges_of_published_arms(name: str, tip: str) -> None:
    """Those that people mean."""
    folder = data_folder()
    assert folder is not None
    path = folder / "example-robot-data" / "robots" / f"{name}.urdf"
    if not path.is_file():
        pytest.skip("not in this version of example-robot-data")
    found = parse_urdf(path.read_text(), path.name)
    assert guess_tip(found, guess_base(found)) == tip


def test_the_other_arms_are_named() -> None:
    """One on the base, one beyond a shared joint; no fingers, necks or own links."""
    second = [f"{a}>{b} revolute" for a, b in pairwise(["l0", *"abcdef"])]
    third = [f"{a}>{b} revolute" for a, b in pairwise(["l1", *"uvwxy"])]
    grip = ("f>g fixed", "g>p prismatic", "g>q prismatic", "f>f_tool0 fixed")
    found = robot("l6>tool0 fixed", *second, *third, *grip, "l0>neck revolute")
    (note,) = other_tips(found, "l0", "tool0")
    assert (
        note == "the arm that ends at tool0 was chosen; --tip takes another: f_tool0, y"
    )
    assert (
        other_tips(
            robot("l6>tool0 fixed", "l6>p prismatic", "l6>q prismatic"), "l0", "tool0"
        )
        == []
    )


def test_the_fingers_of_another_arm_are_no_arms() -> None:
    """However many joints they have, they are beyond its flange."""
    second = [f"{a}>{b} revolute" for a, b in pairwise(["l0", *"abcdef"])]
    hand = [f"f>f_{finger}1 revolute" for finger in "pqr"]
    hand += [f"f_{x}{k}>f_{x}{k + 1} revolute" for x in "pqr" for k in range(1, 6)]
    found = robot("l6>tool0 fixed", *second, "f>f_tool_link fixed", *hand)
    (note,) = other_tips(found, "l0", "tool0")
    assert note.endswith("--tip takes another: f_tool_link")
