"""What a camera sees of a bin, against a pinhole written out by hand."""

from __future__ import annotations

import re
from itertools import islice

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from reachmap.cell.loading import read_cell
from reachmap.core.collision.bodies import build_geometry
from reachmap.core.collision.camera import Camera
from reachmap.core.collision.static_bodies import PlacedBodies, bodies_at
from reachmap.core.scene import Scene
from reachmap.errors import CellError
from reachmap.geometry import yaw_transform
from reachmap.placement.mapped.exact import PlacedScene
from reachmap.placement.mapped.imaging import (
    can_choose,
    imaging_configurations,
    is_in_picture,
    picture_of,
    why_unseen,
)
from reachmap.placement.mapped.sample import THIN, open_frames, sample_of
from reachmap.placement.mapped.viewpoints import (
    NOT_SEEN,
    camera_poses,
    picture_corners,
    view_of,
    visibility_grades,
)
from tests.support.optional import present
from tests.support.pinhole import corners_of, sees
from tests.support.scenes import scene_of

UR5 = "ur5-eye-in-hand"
CELL = read_cell(UR5).cell


def looking_down(height_m, *, x=0.0, y=0.0, roll_deg=0.0):
    """Pose of a camera that looks straight down."""
    T = np.eye(4)
    turn = Rotation.from_euler("z", roll_deg, degrees=True)
    T[:3, :3] = (turn * Rotation.from_euler("x", 180, degrees=True)).as_matrix()
    T[:3, 3] = x, y, height_m
    return T


@given(
    height=st.floats(0.3, 0.8),
    x=st.floats(-0.3, 0.3),
    y=st.floats(-0.3, 0.3),
    roll=st.floats(0, 360),
    tilt=st.floats(-30, 30),
)
def test_what_is_seen_against_a_pinhole(height, x, y, roll, tilt):
    """Grades say the same as projecting the corners one by one."""
    cell, camera = CELL, present(CELL.camera)
    T = looking_down(height, x=x, y=y, roll_deg=roll)
    T[:3, :3] = Rotation.from_euler("y", tilt, degrees=True).as_matrix() @ T[:3, :3]
    grade = visibility_grades(
        T[None], view_of(cell.bin.inner, cell.bin_scan.layers), camera
    )[0]
    inner = corners_of(cell.bin.inner, cell.bin.inner[2])
    bottom, top = inner[:4], inner[4:]
    volume = np.vstack([bottom, corners_of(cell.bin.inner, 0.05)[4:]])
    seen = all(sees(camera, T, p, in_range="along the axis") for p in volume)
    rim = all(sees(camera, T, p, in_range="") for p in top)
    near = all(sees(camera, T, p, in_range="at all") for p in volume)
    if not seen:
        assert grade == NOT_SEEN
    else:
        bordered = all(sees(camera, T, p, in_range="", border=0.05) for p in top)
        missing = 0 if bordered else 2 if rim else 4
        assert grade == missing + (0 if near else 1)


def test_camera_poses_look_at_the_bin_from_within_range():
    """Every candidate has the bin's middle before it, at the wanted distance."""
    cell = CELL
    view = view_of(cell.bin.inner, cell.bin_scan.layers)
    T = camera_poses(view, (0.5, 0.6))
    assert np.allclose(np.linalg.det(T[:, :3, :3]), 1.0)
    assert (T[:, 2, 2] < -0.95).all()
    height = T[:, 2, 3] - 0.025
    distance = height / -T[:, 2, 2]
    assert distance.min() == pytest.approx(0.525)
    assert distance.max() == pytest.approx(0.575)
    ground = T[:, :2, 3] + distance[:, None] * T[:, :2, 2]
    assert (np.abs(ground) <= np.array([0.25 * 0.18, 0.25 * 0.13]) + 1e-9).all()


def test_a_range_too_short_for_the_bin_still_gives_candidates():
    """The nearest distance is offered, and judged like the others."""
    cell = CELL
    view = view_of(cell.bin.inner, (0.05,))
    T = camera_poses(view, (0.5, 0.51))
    assert len(T)
    camera = read_cell(UR5, ["camera.range_m=[0.5,0.51]"]).cell.camera
    grades = visibility_grades(T, view, present(camera))
    assert (grades == NOT_SEEN).all()


def test_the_picture_on_a_level_is_the_field_of_view():
    """Straight down from 0.5 m the picture is 2·0.5·tan(half the angle) wide."""
    camera = present(CELL.camera)
    corners = present(picture_corners(looking_down(0.5, x=0.2), camera, 0.0))
    size = np.ptp(corners, axis=0)
    wanted = 2 * 0.5 * np.tan(np.radians(camera.field_of_view_deg) / 2)
    assert np.allclose(size, wanted)
    assert np.allclose(corners.mean(axis=0), [0.2, 0.0])
    sideways = looking_down(0.5)
    sideways[:3, :3] = Rotation.from_euler("y", 90, degrees=True).as_matrix()
    assert picture_corners(sideways, camera, 0.0) is None


def placed_ur5(pose, *overrides):
    """Scene of the UR5 cell with its bin at a pose."""
    loaded = read_cell(UR5, overrides)
    scene = Scene.build(loaded, with_bin=True, bin_moves=True)
    sample = sample_of(loaded.cell, THIN, open_frames(scene.robot, loaded))
    return PlacedScene(scene, pose, sample)


def test_imaging_configurations_see_the_whole_bin_and_are_free():
    """Each of them projects all inner corners into the picture, within range."""
    placed = placed_ur5((0.45, 0.1, 0.02, 1.2))
    scene, camera = placed.scene, placed.scene.loaded.cell.camera
    T_flange_camera = np.eye(4)
    T_flange_camera[:3, 3] = camera.xyz
    T_tcp_flange = np.eye(4)
    T_tcp_flange[2, 3] = -0.275
    found = list(imaging_configurations(placed.scene, *placed.grasps))
    assert len(found) >= 4
    inner = scene.loaded.cell.bin.inner
    corners = corners_of(inner, inner[2]) @ scene.T_base_bin[:3, :3].T
    corners = corners + scene.T_base_bin[:3, 3]
    for k, q in enumerate(found):
        T = scene.kinematics.forward(q) @ T_tcp_flange @ T_flange_camera
        assert all(sees(camera, T, p, in_range="along the axis") for p in corners)
        assert scene.checker.is_free(q)
        assert all(np.linalg.norm(q - other) >= 0.4 for other in found[:k])


def test_something_in_the_line_of_sight_leaves_no_configuration():
    """A plate above the bin that the arm need not touch hides it from everywhere."""
    plate = (
        'bodies.pedestal={"name":"pedestal","attach_to":"world",'
        '"shape":{"box":[0.5,0.5,0.002]},"pose":{"xyz":[0.45,0,0.12]}}'
    )
    placed = placed_ur5((0.45, 0.0, 0.0, 1.57), plate)
    assert next(imaging_configurations(placed.scene, *placed.grasps), None) is None


STANDING = (
    "camera.parent=world",
    "camera.xyz=[0.5,0,1.0]",
    "camera.rpy_deg=[180,0,90]",
    "camera.range_m=[0.6,1.4]",
)


def test_a_standing_camera_sees_what_a_pinhole_sees():
    """The bin is in the picture where all corners of its pick volume are."""
    cell = read_cell(UR5, STANDING).cell
    T_world_camera = present(cell.camera).matrix()
    rng = np.random.default_rng(5)
    seen = []
    for x, y, yaw in rng.uniform([0.0, -0.6, 0.0], [1.0, 0.6, np.pi], (200, 3)):
        T = yaw_transform(x, y, 0.0, yaw)
        height = min(max(cell.bin_scan.layers), cell.bin.inner[2])
        corners = corners_of(cell.bin.inner, height) @ T[:3, :3].T + T[:3, 3]
        wanted = all(
            sees(cell.camera, T_world_camera, p, in_range="along the axis")
            for p in corners
        )
        assert is_in_picture(cell, T_world_camera, T) == wanted
        seen.append(wanted)
    assert 0.05 < np.mean(seen) < 0.8


def test_the_arm_waits_where_it_does_not_hide_the_bin():
    """The cell's own configuration is left for one past which every corner is seen."""
    placed = placed_ur5((0.5, 0.0, 0.0, 1.57), *STANDING)
    scene = placed.scene
    own = scene.scan_configuration
    assert "hides part of the bin" in picture_of(scene, own)
    found = list(islice(imaging_configurations(scene, *placed.grasps), 4))
    assert len(found) == 4
    geometry = build_geometry(scene.robot, scene.loaded, with_bin=False)
    inner = scene.loaded.cell.bin.inner
    corners = 0.95 * corners_of(inner, 0.05) + [0.0, 0.0, 0.005]
    corners = corners @ scene.T_base_bin[:3, :3].T + scene.T_base_bin[:3, 3]
    lens = np.array([0.5, 0.0, 1.0])
    for q, is_free in [(own, False), *((q, True) for q in found)]:
        arm = PlacedBodies(bodies_at(scene.robot, geometry, q))
        ways = [
            lens + share * (corner - lens)
            for corner in corners
            for share in np.linspace(0.02, 0.98, 200)
        ]
        hits = [
            arm.first_touched(coal.Sphere(1e-4), yaw_transform(x, y, z, 0.0)) >= 0
            for x, y, z in np.array(ways)
        ]
        assert (not any(hits)) == is_free


def test_parts_in_the_bin_do_not_hide_what_is_picked_above_them():
    """The same configurations image a bin with parts under the pick volume."""
    filled = "bin.heap=0.028", "bin_scan.layers=[0.03]"
    empty = placed_ur5((0.5, 0.0, 0.0, 1.57), filled[1]).scene
    full = placed_ur5((0.5, 0.0, 0.0, 1.57), *filled).scene
    wanted = list(islice(imaging_configurations(empty), 3))
    found = list(islice(imaging_configurations(full), 3))
    np.testing.assert_array_equal(found, wanted)
    assert [picture_of(full, q) for q in found] == ["", "", ""]


def test_what_hides_the_bin_everywhere_is_named():
    """A plate over the bin with room for the arm above it; a range out of reach."""
    plate = (
        "{name: plate, attach_to: world, touch: [bin], shape: {box: [0.5, 0.5, 0.01]}"
    )
    plate = f"bodies=[{plate}, pose: {{xyz: [0.6, 0.0, 0.12]}}}}]"
    scene = placed_ur5((0.6, 0.0, 0.0, 1.57), plate).scene
    assert next(imaging_configurations(scene), None) is None
    assert re.fullmatch(r"plate hides it from (\d+) of \1 conf.*", why_unseen(scene))
    far = placed_ur5((0.6, 0.0, 0.0, 1.57), "camera.range_m=[2.4,2.5]").scene
    assert "nowhere within its range" in why_unseen(far)


def test_a_camera_may_be_fixed_to_a_body():
    """On a mast it is where it would be in the world; an unknown name is a mistake."""
    mast = (
        'bodies.pedestal={"name":"pedestal","shape":{"box":[0.02,0.02,0.02]},'
        '"pose":{"xyz":[0.4,0.1,1.2]}}'
    )
    scene = scene_of(UR5, *STANDING[1:], mast, "camera.parent=pedestal", with_bin=False)
    T = Camera(scene.robot, scene.loaded).T_base_camera(scene.scan_configuration)
    T_base_world = scene.loaded.cell.T_base_world()
    mast_pose = T_base_world @ yaw_transform(0.4, 0.1, 1.2, 0.0)
    camera = present(scene.loaded.cell.camera)
    np.testing.assert_allclose(T, mast_pose @ camera.matrix())
    with pytest.raises(CellError, match="no frame 'most'"):
        read_cell(UR5, (*STANDING, "camera.parent=most"))


def test_a_cell_without_a_camera_keeps_its_configuration():
    """A camera on the tool or one that stands gives a choice; on the forearm, none."""
    assert can_choose(scene_of(UR5, with_bin=False))
    assert not can_choose(scene_of("planar-toy", with_bin=False))
    fixed = ("camera.parent=world", "camera.xyz=[0.5,0,1.0]")
    assert can_choose(scene_of(UR5, *fixed, with_bin=False))
    assert not can_choose(scene_of(UR5, "camera.parent=forearm_link", with_bin=False))
