"""Two maps compared: matched by pose, counted against brute force."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from reachmap.errors import SettingsError
from reachmap.geometry import (
    quaternion_wxyz_from_rotation,
    rotation_angle,
    rotation_from_quaternion_wxyz,
    yaw_transform,
)
from reachmap.maps import CubeMap, Status, WorkspaceMap
from reachmap.maps.comparison.comparison import cell_changes, compare_maps
from reachmap.maps.comparison.pose_matching import frame_table, match_frames
from reachmap.maps.records import workspace_map_from_cubes
from tests.support.synthetic_maps import synthetic_bin_map, synthetic_workspace_map


def random_workspace(seed: int, **settings: Any) -> WorkspaceMap:
    """A map of two cubes with random reachability, 5 × 4 squares on 2 levels."""
    fractions = np.random.default_rng(seed).random((2, 5, 4))
    return synthetic_workspace_map(fractions, shared_row=2, orientations=5, **settings)


def rebuilt(record: WorkspaceMap, cubes: dict[str, CubeMap]) -> WorkspaceMap:
    """The same map made of other cubes."""
    rest = {
        name: getattr(record, name)
        for name in ("scan_configuration", "joint_names", "body_pairs", "method",
                     "stamp", "provenance", "run")
    }  # fmt: skip
    return workspace_map_from_cubes(cubes, **rest)


def turned(cube: CubeMap, order: np.ndarray) -> CubeMap:
    """A cube with its orientations in another order."""
    return dataclasses.replace(
        cube,
        quaternion_wxyz=cube.quaternion_wxyz[order] * -1.0,
        **{
            name: getattr(cube, name)[:, :, :, order]
            for name in ("status", "blocking_pair", "n_ik", "n_ik_free", "attempts",
                         "paths_found", "component", "path_length",
                         "goal_configuration")
        },
    )  # fmt: skip


def outcomes(record: WorkspaceMap) -> dict[tuple[float, ...], bool]:
    """Reachable or not by rounded pose, in loops; equal poses are joined by or."""
    found: dict[tuple[float, ...], bool] = {}
    for cube in record.cubes.values():
        R = rotation_from_quaternion_wxyz(cube.quaternion_wxyz)
        for index in np.ndindex(cube.status.shape):
            iz, iy, ix, io = index
            pose = (cube.x[ix], cube.y[iy], cube.z[iz], *R[io].ravel())
            key = tuple(round(float(value), 6) + 0.0 for value in pose)
            reachable = bool(cube.status[index] == Status.PATH_FOUND)
            found[key] = found.get(key, False) or reachable
    return found


def test_counts_agree_with_a_loop_over_poses() -> None:
    """Common, reached, gained and lost against a dictionary keyed by pose."""
    a, b = random_workspace(1), random_workspace(2)
    before, after = outcomes(a), outcomes(b)
    r = compare_maps(a, b)
    assert r.common == r.frames_before == len(before)
    assert r.reached_before == sum(before.values())
    assert r.reached_after == sum(after.values())
    assert r.gained == sum(after[k] and not before[k] for k in before)
    assert r.lost == sum(before[k] and not after[k] for k in before)
    assert r.squares.frames.sum() == r.common
    assert r.squares.before.sum() == r.reached_before
    assert r.squares.after.sum() == r.reached_after
    assert sum(cause.count for cause in r.losses) == r.lost
    assert sum(cause.count for cause in r.gains) == r.gained


def test_a_map_against_itself_has_not_changed() -> None:
    """Nothing gained, nothing lost, nothing significant."""
    record = random_workspace(1)
    r = compare_maps(record, record)
    assert (r.gained, r.lost, r.change, r.p_value) == (0, 0, 0.0, 1.0)
    assert not r.squares.significant.any()
    assert r.path_length_before == r.path_length_after
    assert r.losses == r.gains == ()
    assert r.cell_changes == ()


def test_frames_are_matched_by_pose_never_by_index() -> None:
    """Cubes and orientations in another order, quaternions of the other sign."""
    record = random_workspace(4)
    order = np.array([3, 0, 4, 2, 1])
    cubes = {
        f"other {name}": turned(cube, order)
        for name, cube in reversed(list(record.cubes.items()))
    }
    r = compare_maps(record, rebuilt(record, cubes))
    assert r.common == r.frames_before
    assert (r.gained, r.lost) == (0, 0)


def test_lattices_that_overlap_are_compared_where_they_do() -> None:
    """A map of fewer rows, columns and levels has its own frames in common."""
    status = np.random.default_rng(0).choice([1, 2, 4], (3, 5, 4, 3))
    x, y, z = (np.round(0.1 * np.arange(n), 12) for n in (4, 5, 3))
    whole = synthetic_workspace_map(status == 1, status=status, x=x, y=y, z=z)
    part = synthetic_workspace_map(
        status[1:, 2:, ::2] == 1, status=status[1:, 2:, ::2], x=x[::2], y=y[2:], z=z[1:]
    )
    r = compare_maps(whole, part)
    assert r.common == r.frames_after == 2 * 3 * 2 * 3
    assert (r.gained, r.lost) == (0, 0)
    np.testing.assert_array_equal(r.squares.x, [0.0, 0.2])
    np.testing.assert_array_equal(r.squares.z, [0.1, 0.2])


def test_tolerances_bound_position_and_angle() -> None:
    """Matches lie within both tolerances, and all that do are found."""
    rng = np.random.default_rng(5)
    a = frame_table(synthetic_bin_map(0.5, shape=(2, 3, 3, 4, 1)))
    shift = rng.uniform(-8e-5, 8e-5, (len(a), 3))
    angle = np.radians(rng.uniform(-0.15, 0.15, len(a)))
    turn = np.stack([yaw_transform(0, 0, 0, float(v))[:3, :3] for v in angle])
    b = dataclasses.replace(a, position=a.position + shift, rotation=turn @ a.rotation)
    in_a, in_b = match_frames(a, b, 1e-4, 0.1)
    np.testing.assert_array_equal(in_a, in_b)
    near = (np.linalg.norm(shift, axis=1) <= 1e-4) & (
        rotation_angle(a.rotation, b.rotation) <= np.radians(0.1)
    )
    assert 5 < near.sum() < len(a) - 5
    np.testing.assert_array_equal(in_a, np.flatnonzero(near))


def test_frames_without_attempt_or_with_errors_do_not_count() -> None:
    """What one of the maps does not know is compared with nothing."""
    status = np.full((1, 1, 3, 2), Status.PATH_FOUND, np.uint8)
    known = synthetic_workspace_map(status == 1, status=status)
    status = status.copy()
    status[0, 0, 1] = Status.ERROR
    status[0, 0, 2] = Status.NOT_ATTEMPTED
    partly = synthetic_workspace_map(status == 1, status=status)
    r = compare_maps(known, partly)
    assert (r.common, r.frames_before, r.frames_after) == (2, 6, 2)
    assert (r.gained, r.lost) == (0, 0)


def test_causes_name_the_bodies_that_came_into_the_way() -> None:
    """Lost frames have the cause that the map after gives, gained ones that before."""
    before = np.array([[[[1, 1, 1, 3]]]], np.uint8)
    after = np.array([[[[1, 3, 3, 1]]]], np.uint8)
    a, b = (synthetic_workspace_map(s == 1, status=s) for s in (before, after))
    r = compare_maps(a, b)
    assert [(c.state, c.count) for c in r.losses] == [
        ("every IK solution in collision", 1)
    ] * 2
    assert [c.pair for c in r.losses] == [b.body_pairs[1], b.body_pairs[2]]
    assert [c.pair for c in r.gains] == [a.body_pairs[0]]


def test_squares_that_changed_by_more_than_chance_are_named() -> None:
    """One square of forty falls from all to nothing; it alone is significant."""
    before = np.full((1, 5, 8), 0.5)
    after = before.copy()
    before[0, 2, 3], after[0, 2, 3] = 1.0, 0.0
    a, b = (synthetic_workspace_map(f, orientations=27) for f in (before, after))
    r = compare_maps(a, b)
    assert np.argwhere(r.squares.significant).tolist() == [[0, 2, 3]]
    assert r.squares.percent("before")[0, 2, 3] == 100.0
    assert r.squares.percent("after")[0, 2, 3] == 0.0
    assert r.change == pytest.approx(-100.0 / 40)
    # All frames of one place are one fact: one standard deviation, two-sided.
    assert r.p_value == pytest.approx(0.3173, abs=1e-4)
    assert r.change_low < r.change < 0.0 < r.change_high


def test_bins_in_other_places_are_compared_relative_to_the_bin() -> None:
    """No pose in common in robot_base; all of them in the frame of the bin."""
    a = synthetic_bin_map(0.5, bin_pose=yaw_transform(0.5, 0.1, 0.0, 0.3))
    b = synthetic_bin_map(0.5, bin_pose=yaw_transform(0.4, -0.2, 0.1, 1.9))
    with pytest.raises(SettingsError, match="if the bin was moved, --frame bin"):
        compare_maps(a, b)
    r = compare_maps(a, b, frame="bin")
    assert r.common == a.status.size
    assert (r.gained, r.lost) == (0, 0)
    np.testing.assert_array_equal(r.squares.z, a.layer)
    np.testing.assert_allclose(r.squares.x, a.x)


def test_path_lengths_are_means_over_frames_that_both_reach() -> None:
    """Each frame's mean over its attempts, then the mean over common frames."""
    a = synthetic_bin_map(0.5, seed=1)
    b = synthetic_bin_map(0.5, seed=2)
    with np.errstate(invalid="ignore"):
        means = [
            np.nansum(r.path_length, axis=-1) / (~np.isnan(r.path_length)).sum(axis=-1)
            for r in (a, b)
        ]
    both = ~np.isnan(means[0]) & ~np.isnan(means[1])
    r = compare_maps(a, b)
    assert r.path_length_before == pytest.approx(means[0][both].mean())
    assert r.path_length_after == pytest.approx(means[1][both].mean())


def test_maps_that_cannot_be_compared_are_refused() -> None:
    """Two kinds, a frame that is not there, nothing in common."""
    workspace, bin_map = random_workspace(1), synthetic_bin_map()
    with pytest.raises(SettingsError, match="cannot be compared"):
        compare_maps(workspace, bin_map)
    with pytest.raises(SettingsError, match="only bin maps"):
        compare_maps(workspace, workspace, frame="bin")
    far = random_workspace(1, x=np.array([5.0, 6.0, 7.0, 8.0]))
    with pytest.raises(
        SettingsError, match=r"no test frame in common \(within 0\.1 mm"
    ):
        compare_maps(workspace, far)


def test_half_turns_are_matched() -> None:
    """Quaternions with w = 0 have no preferred sign; rotations need none."""
    record = random_workspace(1)
    cube = record.cubes["left"]
    half = np.diag([1.0, -1.0, -1.0])
    R = half @ rotation_from_quaternion_wxyz(cube.quaternion_wxyz)
    q = quaternion_wxyz_from_rotation(R)
    cubes = [
        {"left": dataclasses.replace(cube, quaternion_wxyz=sign * q)}
        for sign in (1.0, -1.0)
    ]
    r = compare_maps(*(rebuilt(record, c) for c in cubes))
    assert r.common == cube.status.size


def test_what_differs_between_the_cells_is_named() -> None:
    """Fields by path, elements of lists by name, values as JSON."""
    record = random_workspace(1)
    text = '{"bodies": [{"name": "housing", "shape": {"box": [1, 2]}}], "seed": 1}'
    other = '{"bodies": [{"name": "housing", "shape": {"box": [1, 3]}}], "more": {}}'
    a, b = (
        dataclasses.replace(record.provenance, cell_resolved_json=item)
        for item in (text, other)
    )
    assert cell_changes(a, b) == (
        ("bodies.housing.shape.box", "[1, 2]", "[1, 3]"),
        ("seed", "1", "-"),
    )
    odd = dataclasses.replace(record.provenance, cell_resolved_json="{")
    assert cell_changes(a, odd) == ()


def test_in_the_world_frames_are_those_that_stand_where_they_stood():
    """A robot a step further, and cubes a step back: the same frames, none changed."""
    before = dataclasses.replace(random_workspace(3), T_world_base=np.eye(4))
    step = float(before.x[1] - before.x[0])
    cubes = {
        name: dataclasses.replace(cube, x=cube.x - step)
        for name, cube in before.cubes.items()
    }
    after = dataclasses.replace(
        rebuilt(before, cubes), T_world_base=yaw_transform(step, 0.0, 0.0, 0.0)
    )
    found = compare_maps(before, after, frame="world")
    assert found.common == found.frames_before == found.frames_after
    assert (found.gained, found.lost) == (0, 0)
    assert found.frame == "world"
    seen_from_base = compare_maps(before, after)
    assert seen_from_base.common < found.common
    assert seen_from_base.gained + seen_from_base.lost > 0


def test_in_the_world_a_turned_robot_has_turned_frames():
    """Poses turn with the base: positions and orientations, not squares of a bin."""
    T = yaw_transform(0.4, -0.2, 0.1, 0.7)
    record = dataclasses.replace(random_workspace(4), T_world_base=T)
    own, world = frame_table(record), frame_table(record, "world")
    assert np.allclose(world.position, own.position @ T[:3, :3].T + T[:3, 3])
    assert np.allclose(world.rotation, T[:3, :3] @ own.rotation)
    bins = dataclasses.replace(synthetic_bin_map(), T_world_base=T)
    assert np.allclose(frame_table(bins, "world").square, frame_table(bins).square)
