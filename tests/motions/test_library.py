"""The motion library: what it serves is free, ends at the grasp, and is its map's."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import reachmap
from reachmap.errors import MapFileError, SettingsError
from reachmap.geometry import quaternion_wxyz_from_rotation, rotation_angle
from reachmap.maps import read_bin_map
from reachmap.motions.library import MotionLibrary, ServedMotion
from reachmap.motions.motion import best_rows, way_points
from reachmap.tools.bin_scan import bin_scan
from tests.support.dense_checks import DenseCheck
from tests.support.kinematics_arms import Link, serial_urdf
from tests.support.toy_artefacts import toy_bin_map
from tests.support.toy_truth import OVERRIDES, clear_rows, slack_of


@pytest.fixture(scope="module")
def map_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of the toy cell, its bin at the edge of what the arm reaches."""
    path = tmp_path_factory.mktemp("library") / "bin.h5"
    bin_scan(None, path, cell="planar-toy", overrides=OVERRIDES)
    return path


@pytest.fixture(scope="module")
def library(map_path: Path) -> MotionLibrary:
    """Its library."""
    return MotionLibrary.from_map(map_path)


def serve(library: MotionLibrary, row: np.ndarray, **options: bool) -> object:
    """Serve a toy grasp x, y, yaw."""
    x, y, yaw = row
    q = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
    return library.serve([x, y, 0.0], quaternion_wxyz=q, **options)


def test_what_is_served_is_free_and_ends_at_the_grasp(library: MotionLibrary) -> None:
    """Replayed by Pinocchio alone, from the scan configuration to the very pose."""
    scene = library.scenes[0]
    check = DenseCheck(scene, margin_m=0.0)
    rows = [row for row in clear_rows(60, seed=4) if slack_of(*row) > 0]
    served = [serve(library, row) for row in rows]
    found = [(row, one) for row, one in zip(rows, served, strict=True) if one]
    assert len(found) >= 0.8 * len(rows)
    for row, one in found:
        assert isinstance(one, ServedMotion)
        assert one.verified
        np.testing.assert_array_equal(one.planned[0], scene.scan_configuration)
        np.testing.assert_array_equal(one.planned[-1], one.approach[0])
        T = scene.kinematics.forward(one.approach[-1])
        np.testing.assert_allclose(T[:2, 3], row[:2], atol=1e-6)
        assert rotation_angle(T[:3, :3], one.T_base_tcp[:3, :3]) < 1e-6
        assert check.path_is_free(np.vstack([one.planned, one.approach[1:]]))


def test_nothing_is_served_where_the_arm_cannot_be(library: MotionLibrary) -> None:
    """The closed form of the toy arm says where that is."""
    rows = [row for row in clear_rows(60, seed=5) if slack_of(*row) < 0]
    assert len(rows) > 10
    assert not any(serve(library, row) for row in rows)


def test_a_test_grasp_gets_its_own_path(library: MotionLibrary, map_path: Path) -> None:
    """Where the grasp is the test grasp, the stored path leads to it."""
    record = read_bin_map(map_path)
    for place, row in list(best_rows(record).items())[::7]:
        served = library.serve(
            record.position[place[:3]], quaternion_wxyz=record.quaternion_wxyz[place]
        )
        assert served is not None
        planned, way = way_points(record, row)
        np.testing.assert_allclose(served.approach[-1], way[-1], atol=1e-5)
        np.testing.assert_allclose(served.planned[0], planned[0])
        assert served.test_grasp == place


def test_times_are_those_of_exported_motions(library: MotionLibrary) -> None:
    """They rise, and no joint is faster than its limit."""
    row = next(row for row in clear_rows(60, seed=4) if slack_of(*row) > 0.05)
    served = serve(library, row)
    assert isinstance(served, ServedMotion)
    motion = served.motion
    steps = np.diff(motion.time_s)
    assert (steps > 0).all()
    speed = np.abs(np.diff(motion.configuration, axis=0)) / steps[:, None]
    assert (speed <= library.scenes[0].robot.velocity_rad_s * (1 + 1e-6)).all()


def test_without_a_check_it_says_so(library: MotionLibrary) -> None:
    """The last piece is worked out and not verified."""
    row = next(row for row in clear_rows(60, seed=4) if slack_of(*row) > 0.05)
    served = serve(library, row, check=False)
    assert isinstance(served, ServedMotion)
    assert not served.verified


def test_outside_the_map_there_is_nothing(library: MotionLibrary) -> None:
    """A point half a metre away has no stored path near it."""
    point = library.table.points[0] + [0.5, 0.5, 0.0]
    assert library.serve(point, quaternion_wxyz=[1, 0, 0, 0]) is None


@pytest.mark.parametrize(
    "rows", [np.zeros((0, 3)), np.zeros((2, 3)), np.full((1, 3), np.nan)]
)
def test_one_grasp_at_a_time(library: MotionLibrary, rows: np.ndarray) -> None:
    """Lists and rows that are no grasps are refused."""
    with pytest.raises(SettingsError):
        library.serve(rows, np.ones_like(rows))


def test_another_cells_map_is_refused(map_path: Path) -> None:
    """By its hash; the part that differs is named. The map's own cell is accepted."""
    MotionLibrary.from_map(map_path, cell="planar-toy")
    change = ["bodies.post.shape.cylinder.radius=0.03"]
    with pytest.raises(MapFileError, match=r"another cell than planar-toy.*bodies"):
        MotionLibrary.from_map(map_path, cell="planar-toy", overrides=change)


def test_a_map_without_paths_is_refused(tmp_path: Path) -> None:
    """Nothing could be served."""
    record = toy_bin_map()
    assert record.best is not None
    nowhere = dataclasses.replace(record.best, row=np.full_like(record.best.row, -1))
    path = tmp_path / "bin.h5"
    with pytest.raises(MapFileError, match="has no stored path"):
        MotionLibrary(dataclasses.replace(record, best=nowhere), str(path))


def test_a_free_roll_is_turned_until_it_fits(map_path: Path) -> None:
    """A direction alone is served at some roll about it."""
    library = reachmap.MotionLibrary.from_map(map_path)
    record = read_bin_map(map_path)
    assert record.approach_axis == "+x"
    place, _ = next(iter(best_rows(record).items()))
    T = library.scenes[0].kinematics.forward(record.goal_configuration[place])
    served = library.serve(record.position[place[:3]], T[:3, 0])
    assert served is not None
    np.testing.assert_allclose(served.T_base_tcp[:3, 0], T[:3, 0], atol=1e-6)
    assert quaternion_wxyz_from_rotation(served.T_base_tcp[:3, :3]).shape == (4,)


def test_a_map_that_names_no_best_paths_serves_the_shortest(map_path: Path) -> None:
    """As maps of version 1.0 do."""
    record = read_bin_map(map_path)
    old = MotionLibrary(dataclasses.replace(record, best=None))
    place, row = next(iter(best_rows(dataclasses.replace(record, best=None)).items()))
    served = old.serve(
        record.position[place[:3]], quaternion_wxyz=record.quaternion_wxyz[place]
    )
    assert served is not None
    np.testing.assert_allclose(
        served.approach[-1], way_points(record, row)[1][-1], atol=1e-5
    )


FOUR_AXES = """\
format: reachmap.cell
format_version: "1.0"
name: four axes
robot:
  urdf: arm.urdf
  tcp: {parent: link_4, xyz: [0, 0, 0.1], approach_axis: "+z"}
  limits: {acceleration_rad_s2: 4.0}
tool: {roll: free}
bodies:
  - name: rod
    attach_to: link_4
    shape: {cylinder: {radius: 0.01, length: 0.09}}
    pose: {xyz: [0, 0, 0.045]}
bin: {inner: [0.2, 0.2, 0.04], wall: 0.01, pose: {xyz: [0.4, 0, -0.1]}}
scan_configuration: {q_deg: {joint_1: 0, joint_2: 0, joint_3: 120, joint_4: 60}}
workspace_scan:
  cubes: [{name: all, min: [0.2, -0.2, 0], max: [0.6, 0.2, 0], grid: [3, 3]}]
  z_step: 0.1
  orientations: {family: list, rpy_deg: [[180, 0, 0]]}
bin_scan:
  grid: [4, 4]
  layers: [0.02]
  orientations: {family: list, rpy_deg: [[180, 0, 0]]}
  repeats: 1
  approach_distance_m: 0.05
"""


def test_an_arm_of_four_axes_is_served_at_its_own_roll(tmp_path: Path) -> None:
    """Its yaw follows from the place: point and direction are met, and free."""
    turn_y = [Link(xyz=(0, 0, z), axis=(0, 1, 0)) for z in (0.0, 0.3, 0.3)]
    (tmp_path / "arm.urdf").write_text(serial_urdf([Link(xyz=(0, 0, 0.1)), *turn_y]))
    (tmp_path / "cell.yaml").write_text(FOUR_AXES)
    bin_scan(None, tmp_path / "bin.h5", cell=str(tmp_path / "cell.yaml"))
    library = MotionLibrary.from_map(tmp_path / "bin.h5")
    scene = library.scenes[0]
    check = DenseCheck(scene, margin_m=0.0)
    rng = np.random.default_rng(6)
    for x, y in rng.uniform(-0.07, 0.07, (20, 2)):
        point = [0.4 + x, y, -0.08]
        served = library.serve(point, [0.0, 0.0, -1.0])
        assert served is not None
        T = scene.kinematics.forward(served.approach[-1])
        np.testing.assert_allclose(T[:3, 3], point, atol=1e-6)
        np.testing.assert_allclose(T[:3, 2], [0, 0, -1], atol=1e-6)
        assert served.approach[-1][0] == pytest.approx(np.arctan2(y, 0.4 + x), abs=1e-5)
        assert check.path_is_free(np.vstack([served.planned, served.approach[1:]]))
