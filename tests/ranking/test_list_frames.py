"""Grasp lists in their frames: the bin, the world, a body, another bin's place."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reachmap.errors import GraspListError, MapFileError, SettingsError
from reachmap.geometry import (
    inverse_transform,
    quaternion_wxyz_from_rotation,
    transform_from_parts,
    yaw_transform,
)
from reachmap.maps.records import Provenance
from reachmap.ranking.answers.ranked_list import pose_from_numbers
from reachmap.ranking.lists.reading import grasps_from_document
from reachmap.ranking.lookup.queries import frames_of, place_grasps
from tests.support.ranking_maps import make_bin_map

BIN_MAP = make_bin_map()
FRAMES = frames_of(BIN_MAP)
R_GRASP = Rotation.from_rotvec([0.2, 0.4, -0.3]).as_matrix()
POINT = np.array([0.1, -0.05, 0.04])


def grasp_list(frame, **header):
    """One full orientation in a frame."""
    one = {"position": POINT.tolist(), "rotation_matrix": R_GRASP.tolist()}
    start = {"format": "reachmap.grasps", "format_version": "1.0", "frame": frame}
    return grasps_from_document({**start, **header, "grasps": [one]})


def pose_object(T):
    """A pose as documents have it."""
    q = quaternion_wxyz_from_rotation(T[:3, :3])
    return {"position": T[:3, 3].tolist(), "quaternion_wxyz": q.tolist()}


def placed_pose(placed):
    """The one placed grasp as a pose in robot_base."""
    return transform_from_parts(placed.rotations[0], placed.points[0])


@pytest.mark.parametrize("frame", ["bin", "robot_base", "world", "table", "rail"])
def test_frames_of_the_cell(frame):
    """A pose in a standing frame is carried to robot_base by that frame's pose."""
    # The base stands 0.8 m up in the world, turned by 90° about z.
    T_base_world = inverse_transform(yaw_transform(0, 0, 0.8, np.pi / 2))
    T_base_frame = {
        "bin": BIN_MAP.bin_pose,
        "robot_base": np.eye(4),
        "world": T_base_world,
        "table": T_base_world @ yaw_transform(1, 0, 0, 0),
        "rail": yaw_transform(0, 2, 0, 0),
    }[frame]
    np.testing.assert_allclose(FRAMES[frame], T_base_frame, atol=1e-12)
    placed = place_grasps(grasp_list(frame), FRAMES, "+z")
    expected = T_base_frame @ transform_from_parts(R_GRASP, POINT)
    np.testing.assert_allclose(placed_pose(placed), expected, atol=1e-12)
    np.testing.assert_allclose(placed.directions[0], expected[:3, 2], atol=1e-12)


def test_unknown_frames_list_the_known_ones():
    """The camera moves with the arm, so its name alone says too little."""
    assert "camera housing" not in FRAMES
    message = r"'camera' is none of .*\(bin, rail, robot_base, table, world\)"
    with pytest.raises(GraspListError, match=message):
        place_grasps(grasp_list("camera"), FRAMES, "+z")


def test_a_frame_pose_stands_for_an_unknown_frame():
    """Seven numbers place the camera of this image."""
    T = transform_from_parts(Rotation.from_rotvec([0, 3.0, 0.5]).as_matrix(), POINT)
    q = quaternion_wxyz_from_rotation(T[:3, :3])
    T_base_camera = pose_from_numbers([*T[:3, 3], *q])
    np.testing.assert_allclose(T_base_camera, T, atol=1e-12)
    placed = place_grasps(grasp_list("camera"), FRAMES, "+z", T_base_camera)
    expected = T @ transform_from_parts(R_GRASP, POINT)
    np.testing.assert_allclose(placed_pose(placed), expected, atol=1e-12)
    for numbers in ([0.0] * 7, [0.0, 0.0, 0.0, 1.0], [np.nan, 0, 0, 1, 0, 0, 0]):
        with pytest.raises(SettingsError, match="a frame pose is x y z"):
            pose_from_numbers(numbers)


def test_a_pose_that_contradicts_the_name_of_a_frame_is_refused():
    """A list of the bin frame is not moved to where a camera is."""
    pose = transform_from_parts(np.eye(3), POINT)
    for frame in ("bin", "robot_base", "world"):
        with pytest.raises(GraspListError, match=f"'{frame}' is known to the map's"):
            place_grasps(grasp_list(frame), FRAMES, "+z", pose)
        same = place_grasps(grasp_list(frame), FRAMES, "+z", FRAMES[frame])
        named = place_grasps(grasp_list(frame), FRAMES, "+z")
        np.testing.assert_allclose(same.points, named.points)


def test_grasps_move_with_the_bin():
    """With a bin_pose a grasp keeps its place in the bin, whatever its frame."""
    T_frame_bin = transform_from_parts(
        Rotation.from_rotvec([0.1, 0.2, 1.0]).as_matrix(), np.array([0.3, 0.1, -0.4])
    )
    for frame in ("robot_base", "camera at 14:03"):
        grasps = grasp_list(frame, bin_pose=pose_object(T_frame_bin))
        placed = place_grasps(grasps, FRAMES, "+z")
        T_bin_before = inverse_transform(T_frame_bin) @ transform_from_parts(
            R_GRASP, POINT
        )
        T_bin_now = inverse_transform(BIN_MAP.bin_pose) @ placed_pose(placed)
        np.testing.assert_allclose(T_bin_now, T_bin_before, atol=1e-12)


def test_contradictory_placements_are_refused():
    """A bin_pose in the bin's own frame, or with a frame pose, says two things."""
    moved = {"position": [0.1, 0, 0]}
    with pytest.raises(GraspListError, match="in the frame 'bin' the bin is at the"):
        place_grasps(grasp_list("bin", bin_pose=moved), FRAMES, "+z")
    at_origin = {"position": [0, 0, 0]}
    place_grasps(grasp_list("bin", bin_pose=at_origin), FRAMES, "+z")
    with pytest.raises(GraspListError, match="would contradict it"):
        place_grasps(grasp_list("camera", bin_pose=moved), FRAMES, "+z", np.eye(4))


@pytest.mark.parametrize(
    "text", ["[", "3", '{"bodies": [{}]}', '{"robot": 3}', '{"bodies": 3}']
)
def test_a_damaged_cell_in_the_map_is_named(text):
    """What the map says about its cell is data from elsewhere."""
    provenance = Provenance(cell_yaml="", cell_resolved_json=text)
    damaged = dataclasses.replace(BIN_MAP, provenance=provenance)
    with pytest.raises(MapFileError, match="the cell in the bin map is unreadable"):
        frames_of(damaged)
