"""Which pairs of links are checked, and that links are where Pinocchio has them."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from reachmap.core.collision.bodies import build_geometry
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from tests.support.kinematics_arms import SHARE, ur5, urdf_text
from tests.support.scenes import scene_of
from tests.support.small_cells import joint, link, load, robot

BOX = '<box size="0.05 0.05 0.12"/>'
JOINTS = ("j1", "j2", "j3")
ARM = (
    link("base", '<box size="0.2 0.2 0.1"/>'),
    link("l1", BOX),
    link("l2", BOX, 'xyz="0.1 0 0"|' + BOX),
    link("l3"),
    link("bracket", 'xyz="0 0 -0.15"|<box size="0.02 0.02 0.2"/>'),
    joint("j1", "base", "l1", more='<origin xyz="0 0 0.2"/><axis xyz="0 0 1"/>'),
    joint("j2", "l1", "l2", more='<origin xyz="0 0 0.2"/><axis xyz="0 1 0"/>'),
    joint("j3", "l2", "l3", more='<origin xyz="0.1 0 0.1"/><axis xyz="1 0 0"/>'),
    joint("mount", "l3", "bracket", kind="fixed", more='<origin xyz="0.05 0 0"/>'),
)


def scene(folder: Path, *elements: str, overrides: tuple[str, ...] = ()) -> Scene:
    """Scene of an arm given by the elements of its URDF."""
    return Scene.build(load(folder, robot(*elements), "l3", JOINTS, overrides))


def all_pairs(built: Scene) -> set[frozenset[str]]:
    """Pairs, those that were proved never to meet included."""
    names = (*built.checker.body_pairs, *built.checker.proved_pairs)
    return {frozenset(name.split(" | ")) for name in names}


def test_neighbours_are_links_that_a_joint_joins(tmp_path: Path) -> None:
    """A tool fixed to the last link is checked against the link before it."""
    pairs = all_pairs(scene(tmp_path, *ARM))
    links = {frozenset(p) for p in itertools.combinations(["base", "l1", "l2"], 2)}
    joined = {frozenset(("base", "l1")), frozenset(("l1", "l2"))}
    tool = {frozenset(("bracket", name)) for name in ("base", "l1", "l2")}
    arm = {p for p in pairs if not any(name.startswith("bin") for name in p)}
    assert arm == (links - joined) | tool


def test_a_bracket_is_the_same_in_the_urdf_and_in_the_cell(tmp_path: Path) -> None:
    """The same answers for random configurations, both of which occur."""
    inside = scene(tmp_path, *ARM)
    bare = [e for e in ARM if "bracket" not in e]
    body = (
        "bodies=[{name: bracket, attach_to: l3, shape: {box: [0.02, 0.02, 0.2]}, "
        "pose: {xyz: [0.05, 0, -0.15]}}]"
    )
    outside = scene(tmp_path, *bare, overrides=(body,))
    Q = np.random.default_rng(1).uniform(-3, 3, (600, 3))
    free = inside.checker.free_mask(Q)
    np.testing.assert_array_equal(free, outside.checker.free_mask(Q))
    assert 100 < free.sum() < 580


def test_pairs_do_not_depend_on_the_order_of_elements(tmp_path: Path) -> None:
    """Pairs taken out one after another must not hide each other."""
    expected = all_pairs(scene(tmp_path, *ARM))
    rng = np.random.default_rng(0)
    for _ in range(5):
        shuffled = [ARM[k] for k in rng.permutation(len(ARM))]
        assert all_pairs(scene(tmp_path, *shuffled)) == expected


def test_what_a_locked_joint_holds_is_rigid(tmp_path: Path) -> None:
    """Links on both sides of it never move against each other; others do."""
    locked = ("robot.locked_joints_deg={j3: 30}", "scan_configuration.q_deg={j1: 0, "
              "j2: 0}")  # fmt: skip
    pairs = all_pairs(scene(tmp_path, *ARM, overrides=locked))
    assert frozenset(("bracket", "l2")) not in pairs
    assert frozenset(("bracket", "l1")) in pairs


@pytest.mark.parametrize(
    ("text", "gone"),
    [
        ('<disable_collisions link1="l2" link2="base"/>', {"base | l2"}),
        (
            '<disable_default_collisions link="bracket"/>',
            {"base | bracket", "bracket | l1", "bracket | l2"},
        ),
        (
            '<disable_default_collisions link="bracket"/>'
            '<enable_collisions link1="bracket" link2="l1"/>',
            {"base | bracket", "bracket | l2"},
        ),
    ],
)
def test_srdf_elements_take_out_pairs_of_links(
    tmp_path: Path, text: str, gone: set[str]
) -> None:
    """Those that are named, and no pair with a body of the cell or the bin."""
    (tmp_path / "r.srdf").write_text(f'<robot name="r">{text}</robot>')
    before = all_pairs(scene(tmp_path, *ARM))
    after = all_pairs(scene(tmp_path, *ARM, overrides=("robot.srdf=r.srdf",)))
    assert {" | ".join(sorted(pair)) for pair in before - after} == gone


def test_links_are_where_pinocchio_has_them() -> None:
    """Placements of the UR5's meshes, against Pinocchio's own reader of the URDF."""
    built = scene_of("ur5-eye-in-hand", with_bin=False)
    loaded, arm = built.loaded, RobotModel.from_cell(built.loaded)
    full = pin.buildModelFromXML(urdf_text("ur_description/urdf/ur5_robot.urdf"))
    theirs = pin.buildGeomFromUrdfString(
        full,
        urdf_text("ur_description/urdf/ur5_robot.urdf"),
        pin.GeometryType.COLLISION,
        package_dirs=[str(SHARE)],
    )
    ours = build_geometry(arm, loaded, with_bin=False)
    here = {
        (name, tuple(np.round(body.placement.homogeneous.ravel(), 9)))
        for name, body in zip(ours.names, ours.geometry.geometryObjects, strict=True)
    }
    for body in theirs.geometryObjects:
        place = tuple(np.round(body.placement.homogeneous.ravel(), 9))
        assert (body.name.rpartition("_")[0], place) in here
    assert ur5().joint_names == arm.joint_names
