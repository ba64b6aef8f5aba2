"""Joints beside the chain that follow one of it: springs, rods, parallelograms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from reachmap.core.collision.bodies import build_geometry
from reachmap.core.scene import Scene
from reachmap.errors import CellError, SceneError
from reachmap.tools.new_cell import new_cell
from tests.support.small_cells import LIMIT, joint, link, load, robot

BOX = '<box size="0.05 0.05 0.2"/>'
ARM = (
    link("base"),
    link("l1", 'xyz="0 0 0.1"|' + BOX),
    link("l2", 'xyz="0 0 0.1"|' + BOX),
    link("l3", 'xyz="0 0 0.1"|' + BOX),
    joint("j1", "base", "l1", more='<axis xyz="0 0 1"/>'),
    joint("j2", "l1", "l2", more='<origin xyz="0 0 0.25"/><axis xyz="0 1 0"/>'),
    joint("j3", "l2", "l3", more='<origin xyz="0 0 0.25"/><axis xyz="0 1 0"/>'),
)
# A rod that turns with j2 and carries a slide that follows j3: alphabetically first,
# so that Pinocchio numbers both before their leaders.
ROD = (
    link("a_rod", 'xyz="0 0.1 0.1"|' + BOX),
    link("a_slide", 'xyz="0 0.1 0.3"|<sphere radius="0.04"/>'),
    joint(
        "a_rod_joint",
        "l1",
        "a_rod",
        more='<origin xyz="0.1 0 0.1"/><axis xyz="0 1 0"/>'
        '<mimic joint="j2" multiplier="-0.5" offset="0.2"/>',
    ),
    joint(
        "a_slide_joint",
        "a_rod",
        "a_slide",
        kind="prismatic",
        more='<axis xyz="0 0 1"/><mimic joint="j3" multiplier="0.1" offset="-0.05"/>',
    ),
)
JOINTS = ("j1", "j2", "j3")


def scene(folder: Path, *elements: str, overrides: tuple[str, ...] = ()) -> Scene:
    """Scene of the arm with more elements."""
    loaded = load(folder, robot(*ARM, *elements), "l3", JOINTS, overrides)
    return Scene.build(loaded)


def test_followers_are_where_their_leaders_put_them(tmp_path: Path) -> None:
    """Against Pinocchio's model of all joints, with the positions put in by hand."""
    arm = scene(tmp_path, *ROD).robot
    full = pin.buildModelFromXML(robot(*ARM, *ROD))
    data, ours = full.createData(), arm.body_model.createData()
    rng = np.random.default_rng(4)
    for _ in range(20):
        q = rng.uniform(-3, 3, 3)
        by_name = dict(zip(JOINTS, q, strict=True))
        by_name["a_rod_joint"] = -0.5 * q[1] + 0.2
        by_name["a_slide_joint"] = 0.1 * q[2] - 0.05
        q_full = np.array([by_name[name] for name in list(full.names)[1:]])
        pin.framesForwardKinematics(full, data, q_full)
        pin.forwardKinematics(arm.body_model, ours, arm.body_configuration(q))
        for name in ("l1", "l2", "l3", "a_rod", "a_slide"):
            number, T_joint_link = arm.link_placement(name)
            T = ours.oMi[number].homogeneous @ T_joint_link
            expected = data.oMf[full.getFrameId(name)].homogeneous
            np.testing.assert_allclose(T, expected, atol=1e-12)


def test_no_point_of_a_follower_moves_further_than_is_promised(tmp_path: Path) -> None:
    """Random motions, straight from one configuration to another, sampled."""
    built = scene(tmp_path, *ROD)
    arm, checker = built.robot, built.checker
    rng = np.random.default_rng(5)
    number, T_joint_link = arm.link_placement("a_slide")
    corner = T_joint_link @ np.array([0.04, 0.14, 0.34, 1.0])
    data = arm.body_model.createData()

    def place(q: np.ndarray) -> np.ndarray:
        pin.forwardKinematics(arm.body_model, data, arm.body_configuration(q))
        return np.asarray(data.oMi[number].homogeneous @ corner)

    for _ in range(60):
        middle, half = rng.uniform(-2, 2, 3), rng.normal(size=3) * 0.2
        promised = float(checker.bound.displacement_m(middle[None], half)[0])
        for part in np.linspace(-1, 1, 9):
            moved = np.linalg.norm(place(middle + part * half) - place(middle))
            assert moved <= promised + 1e-9
            assert moved <= np.abs(half) @ checker.reach_m + 1e-9


def test_followers_are_checked_for_collision(tmp_path: Path) -> None:
    """A post that only the rod can reach is hit exactly where the rod is."""
    post = (
        "bodies=[{name: post, attach_to: l1, shape: {sphere: {radius: 0.01}}, "
        "pose: {xyz: [0.25, 0.1, 0.2]}}]"
    )
    checker = scene(tmp_path, *ROD, overrides=(post,)).checker
    assert "a_rod | post" in checker.body_pairs
    hits = []
    for q2 in np.linspace(-3, 3, 121):
        names = [
            checker.body_pairs[k]
            for k in checker.touching_pairs(np.array([0.0, q2, 0.0]))
        ]
        hits.append("a_rod | post" in names)
        # In the rod's frame, whose angle is -q2/2 + 0.2 about y.
        angle = -0.5 * q2 + 0.2
        c, s = np.cos(angle), np.sin(angle)
        x, z = c * 0.15 - s * 0.1, s * 0.15 + c * 0.1
        outside = np.maximum(np.abs([x, z - 0.1]) - [0.025, 0.1], 0.0)
        gap = np.linalg.norm(outside) - 0.01
        if abs(gap - 0.002) > 1e-5:
            assert hits[-1] == (gap < 0.002)
    assert 5 < sum(hits) < 115


def test_pairs_that_never_meet_hold_for_followers(tmp_path: Path) -> None:
    """No sampled configuration brings a proved pair together."""
    built = scene(tmp_path, *ROD)
    assert built.checker.proved_pairs
    loaded = built.loaded
    bodies = build_geometry(built.robot, loaded, with_bin=True)
    proved = set(built.checker.proved_pairs)
    data = bodies.geometry.createData()
    model = built.robot.body_model
    rng = np.random.default_rng(6)
    for q in rng.uniform(-3, 3, (300, 3)):
        pin.computeCollisions(
            model,
            model.createData(),
            bodies.geometry,
            data,
            built.robot.body_configuration(q),
            False,
        )
        touching = {
            name
            for name, result in zip(
                bodies.pair_names(), data.collisionResults, strict=True
            )
            if result.isCollision()
        }
        assert not touching & proved


def test_a_locked_follower_stands_still_and_one_of_a_locked_leader_follows(
    tmp_path: Path,
) -> None:
    """Either may be locked; then nothing follows any more."""
    locked = scene(
        tmp_path, *ROD, overrides=("robot.locked_joints_deg={a_rod_joint: 30}",)
    ).robot
    assert list(locked.body_model.names)[4:] == ["a_slide_joint"]
    leader = (
        "robot.locked_joints_deg={j2: 90}",
        "scan_configuration.q_deg={j1: 0, j3: 0}",
    )
    arm = scene(tmp_path, *ROD, overrides=leader).robot
    assert arm.joint_names == ("j1", "j3")
    _, T = arm.link_placement("a_rod")
    angle = -0.5 * np.pi / 2 + 0.2
    np.testing.assert_allclose(T[0, 0], np.cos(angle), atol=1e-12)
    np.testing.assert_allclose(T[0, 2], np.sin(angle), atol=1e-12)


def test_followers_of_followers_are_composed(tmp_path: Path) -> None:
    """2 (3 q + 1) + 0.5; and a circle is refused."""
    chain = (
        link("a"),
        link("b", BOX),
        joint("ja", "base", "a", more='<mimic joint="j1" multiplier="3" offset="1"/>'),
        joint("jb", "base", "b", more='<mimic joint="ja" multiplier="2" offset=".5"/>'),
    )
    arm = scene(tmp_path, *chain).robot
    q = arm.body_configuration(np.array([0.1, 0.0, 0.0]))
    names = list(arm.body_model.names)[1:]
    assert q[names.index("jb")] == pytest.approx(2 * (3 * 0.1 + 1) + 0.5)
    circle = [e.replace('<mimic joint="j1"', '<mimic joint="jb"') for e in chain]
    with pytest.raises((CellError, SceneError), match="circular mimics"):
        scene(tmp_path, *circle)


def test_coupled_joints_of_the_chain_are_refused_in_a_sentence(tmp_path: Path) -> None:
    """A palletiser's wrist; with the leader locked there is nothing to couple."""
    coupled = ARM[6].replace(LIMIT, LIMIT + '<mimic joint="j2" multiplier="-1"/>')
    urdf = robot(*ARM[:6], coupled)
    with pytest.raises(SceneError, match=r"'j3' .* follows 'j2'; arms with coupled"):
        Scene.build(load(tmp_path, urdf, "l3", ("j1", "j2")))
    locked = ("robot.locked_joints_deg={j2: 30}", "scan_configuration.q_deg={j1: 0}")
    arm = Scene.build(load(tmp_path, urdf, "l3", ("j1",), locked)).robot
    assert arm.joint_names == ("j1",)


def test_a_joint_of_the_chain_led_from_beside_is_an_axis_too(tmp_path: Path) -> None:
    """Held still without a word it would be another arm; locked, it is meant."""
    led = ARM[6].replace(LIMIT, LIMIT + '<mimic joint="motor" multiplier="-1"/>')
    urdf = robot(*ARM[:6], led, link("rod"), joint("motor", "base", "rod"))
    with pytest.raises(SceneError, match=r"'j3' .* follows 'motor'; arms with coupled"):
        Scene.build(load(tmp_path, urdf, "l3", ("j1", "j2")))
    locked = ("robot.locked_joints_deg={motor: 30}",)
    arm = Scene.build(load(tmp_path, urdf, "l3", ("j1", "j2"), locked)).robot
    _, T = arm.link_placement("l3")
    np.testing.assert_allclose(T[0, 0], np.cos(np.pi / 6), atol=1e-12)
    (tmp_path / "arm.urdf").write_text(urdf)
    written = new_cell(tmp_path / "arm.urdf", output=tmp_path / "new.yaml", tip="l3")
    assert "'j3' is between base and TCP and follows 'motor'" in written.problems[0]


@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [
        ("revolute", 172, "at 172 deg is outside of its limits -171.9"),
        ("prismatic", 20, "at 20 m is outside of its limits -3 … 3 m"),
        ("revolute", 171.88, ""),
        ("continuous", 720, ""),
    ],
)
def test_joints_are_locked_where_they_can_be(
    tmp_path: Path, kind: str, value: float, said: str
) -> None:
    """Within their limits, copied with few digits; continuous ones anywhere."""
    urdf = robot(*ARM, link("rod"), joint("motor", "base", "rod", kind=kind))
    locked = (f"robot.locked_joints_deg={{motor: {value}}}",)
    loaded = load(tmp_path, urdf, "l3", JOINTS, locked)
    if said:
        with pytest.raises(SceneError, match=said):
            Scene.build(loaded)
    else:
        Scene.build(loaded)


def test_a_slide_whose_ends_are_left_out_says_what_that_means(tmp_path: Path) -> None:
    """As ROS has it they are 0, which leaves no range."""
    rail = joint("rail", "base", "foot", kind="prismatic").replace(
        'lower="-3" upper="3" ', ""
    )
    foot = ARM[4].replace('"base"', '"foot"')
    urdf = robot(*ARM[:4], link("foot"), rail, foot, *ARM[5:])
    with pytest.raises(
        SceneError, match=r"'rail' has no range left .* leaves out are 0"
    ):
        Scene.build(load(tmp_path, urdf, "l3", ("rail", *JOINTS)))


def test_a_value_for_a_locked_joint_says_that_it_is_locked(tmp_path: Path) -> None:
    """Not that it may be a misspelt one."""
    locked = ("robot.locked_joints_deg={j2: 30}",)
    with pytest.raises(
        CellError, match=r"q_deg.j2: .* held by robot.locked_joints_deg"
    ):
        load(tmp_path, robot(*ARM), "l3", JOINTS, locked)


def test_a_joint_that_mimics_nothing_is_one_of_its_own(tmp_path: Path) -> None:
    """As MoveIt has it, and said in a warning."""
    stray = ARM[6].replace(LIMIT, LIMIT + '<mimic joint="gone"/>')
    loaded = load(tmp_path, robot(*ARM[:6], stray), "l3", JOINTS)
    assert "joint 'j3' mimics 'gone', which is not a moving joint" in loaded.warnings[0]
    assert Scene.build(loaded).robot.joint_names == JOINTS
