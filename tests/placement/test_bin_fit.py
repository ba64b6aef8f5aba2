"""Can the bin stand: contacts, against boxes written out by hand."""

from __future__ import annotations

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from reachmap.core.collision.bin_fit import BinFit, ToolFit
from reachmap.core.scene import Scene
from reachmap.errors import SceneError
from reachmap.geometry import yaw_transform
from tests.support.scenes import scene_of

UR5 = "ur5-eye-in-hand"
SCENE = scene_of(UR5, with_bin=False)
FIT = BinFit(SCENE.robot, SCENE.loaded, None)


def overlap_of_rectangles(centre, half, yaw, other_half):
    """Whether a turned rectangle meets one around the origin (separating axes)."""
    c, s = np.cos(yaw), np.sin(yaw)
    axes = np.array([[1, 0], [0, 1], [c, s], [-s, c]])
    turned = np.array([[c, s], [-s, c]]) * np.array(half)[:, None]
    upright = np.diag(other_half)
    for axis in axes:
        reach = np.abs(turned @ axis).sum() + np.abs(upright @ axis).sum()
        if abs(centre @ axis) >= reach:
            return False
    return True


@given(
    x=st.floats(0.2, 0.7),
    y=st.floats(-0.7, 0.7),
    z=st.floats(-0.6, -0.05),
    yaw=st.floats(0, np.pi),
)
def test_a_bin_meets_the_pedestal_where_two_rectangles_do(x, y, z, yaw):
    """Below the pedestal's top the answer is that of two rectangles in the plane."""
    outer = np.array([0.36, 0.26]) / 2 + 0.006
    centre = np.array([x, y])
    wide, narrow = (
        overlap_of_rectangles(centre, outer + slack, yaw, (0.275, 0.275))
        for slack in (2e-4, -2e-4)
    )
    contact = FIT.contact(yaw_transform(x, y, z, yaw))
    met = contact is not None and contact.other == "pedestal"
    assert met or not narrow
    assert wide or not met


def tray():
    """Bottom and walls of the tray of 6 mm, as sides and middle of boxes."""
    x, y, z, wall = 0.36, 0.26, 0.05, 0.006
    outer = (x + 2 * wall, y + 2 * wall)
    yield (*outer, wall), (0, 0, -wall / 2)
    for sign in (1, -1):
        yield (wall, outer[1], z), (sign * (x + wall) / 2, 0, z / 2)
        yield (outer[0], wall, z), (0, sign * (y + wall) / 2, z / 2)


def test_the_tool_meets_the_bin_where_its_bodies_meet_boxes():
    """The first of its bodies that is within the margin of one, wrist included."""
    fit, rng = ToolFit(SCENE.robot, SCENE.loaded), np.random.default_rng(2)
    boxes = [(coal.Box(*sides), np.array(middle, float)) for sides, middle in tray()]
    request = coal.CollisionRequest()
    request.security_margin = SCENE.checker.safety_margin_m
    T = np.tile(np.eye(4), (400, 1, 1))
    tilts = rng.uniform(-1.0, 1.0, (400, 3)) * [0.6, 0.6, np.pi]
    T[:, :3, :3] = (
        Rotation.from_euler("x", np.pi) * Rotation.from_rotvec(tilts)
    ).as_matrix()
    # Down to where the wrist is in the bin.
    T[:, :3, 3] = rng.uniform([-0.22, -0.17, -0.25], [0.22, 0.17, 0.06], (400, 3))
    wanted = np.full(400, -1)
    for row, index in np.ndindex(400, len(fit.bodies)):
        body = fit.bodies[index]
        place = T[row] @ body.T
        placed = coal.Transform3s(place[:3, :3], place[:3, 3])
        for box, middle in boxes:
            result = coal.CollisionResult()
            at = coal.Transform3s(np.eye(3), middle)
            coal.collide(body.shape, placed, box, at, request, result)
            if result.isCollision() and wanted[row] < 0:
                wanted[row] = index
    found = fit.first_hit(T, fit.bodies)
    np.testing.assert_array_equal(found, wanted)
    np.testing.assert_array_equal(fit.blocked(T), wanted >= 0)
    hit = [fit.bodies[index].name for index in {*wanted.tolist()} - {-1}]
    assert {"wrist_3_link", "camera housing", "suction tube"} <= {*hit}
    assert (wanted == -1).any()


def test_the_bin_may_stand_on_something():
    """A bin whose bottom lies on the pedestal's top touches nothing."""
    top = -0.002
    # Turned so that no wall reaches the robot's base.
    pose = yaw_transform(0.0, 0.4, top + 0.006, 0.0)
    assert FIT.contact(pose) is None
    lower = FIT.contact(yaw_transform(0.0, 0.4, top + 0.005, 0.0))
    assert lower is not None
    assert lower.pair == "bin bottom touches pedestal"
    assert lower.reason == "the bin collides with pedestal"


def test_a_body_inside_the_bin_is_in_the_way():
    """What stands inside, clear of walls and bottom, is met by the bin itself."""
    post = (
        'bodies.pedestal={"name":"post","attach_to":"world",'
        '"shape":{"box":[0.02,0.02,0.02]},"pose":{"xyz":[0.5,0,0.03]}}'
    )
    scene = scene_of(UR5, post, "bodies.floor.touch=[]", with_bin=False)
    contact = BinFit(scene.robot, scene.loaded, None).contact(
        yaw_transform(0.5, 0.0, 0.0, 0.3)
    )
    assert contact is not None
    assert contact.pair == "bin touches post"
    divider = BinFit(scene.robot, scene.loaded, None, empty=False)
    assert divider.contact(yaw_transform(0.5, 0.0, 0.0, 0.3)) is None


def test_the_arm_counts_only_where_its_configuration_is_known():
    """A bin in the camera housing is refused with the arm, and not without it."""
    q = SCENE.scan_configuration
    T_base_tcp = SCENE.kinematics.forward(q)
    x, y, z = T_base_tcp[:3, 3]
    pose = yaw_transform(x, y, z, 0.0)
    assert FIT.contact(pose) is None
    contact = BinFit(SCENE.robot, SCENE.loaded, q).contact(pose)
    assert contact is not None
    assert contact.at_scan
    assert contact.pair.endswith("at the scan configuration")


@settings(max_examples=10)
@given(
    x=st.floats(0.0, 0.7),
    y=st.floats(-0.5, 0.5),
    z=st.floats(-0.2, 0.5),
    yaw=st.floats(0, np.pi),
)
def test_the_arm_at_rest_against_the_whole_scene(x, y, z, yaw):
    """What is said of the arm is what the scene with the bin in it says."""
    pose = yaw_transform(x, y, z, yaw)
    contact = BinFit(SCENE.robot, SCENE.loaded, SCENE.scan_configuration).contact(pose)
    scene = Scene.build(SCENE.loaded.with_changes(bin_pose=pose), with_bin=True)
    pairs = [
        scene.checker.body_pairs[k]
        for k in scene.checker.touching_pairs(scene.scan_configuration)
    ]
    if contact is None:
        assert not pairs
    elif contact.at_scan:
        assert any(contact.other in pair and contact.part in pair for pair in pairs)


def test_a_scene_refuses_a_bin_in_a_body_that_stands_still():
    """A bin moved into the pedestal by hand is refused with both names."""
    scene = scene_of(UR5, "bin.pose.xyz=[0.25,0.3,-0.1]")
    with pytest.raises(SceneError, match=r"bin\.pose: bin .* touches pedestal"):
        scene.require_free_scan_configuration()
    allowed = scene_of(UR5, "bin.pose.xyz=[0.25,0.3,-0.1]", "bin.touch=[pedestal]")
    allowed.require_free_scan_configuration()


def test_a_moved_bin_is_checked_like_one_that_was_built_there():
    """Configurations and pairs are judged as in a scene that was built again."""
    rng = np.random.default_rng(11)
    moving = Scene.build(SCENE.loaded, with_bin=True, bin_moves=True)
    for pose in ((0.5, 0.1, -0.1, 0.4), (0.3, -0.3, 0.3, 1.2)):
        loaded = SCENE.loaded.with_changes(bin_pose=yaw_transform(*pose))
        moving, built = moving.with_bin_of(loaded), Scene.build(loaded, with_bin=True)
        assert np.allclose(moving.T_base_bin, built.T_base_bin)
        assert set(built.checker.body_pairs) <= set(moving.checker.body_pairs)
        hits = 0
        for q in rng.uniform(-2.5, 2.5, (300, 6)):
            one, two = (
                {scene.checker.body_pairs[k] for k in scene.checker.touching_pairs(q)}
                for scene in (moving, built)
            )
            assert one == two
            assert moving.checker.is_free(q) == built.checker.is_free(q)
            hits += any("bin" in pair for pair in one)
        assert hits > 3
