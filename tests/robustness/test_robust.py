"""Errors of a cell: what is certified holds, and what is replayed is what happens."""

from __future__ import annotations

import json
from functools import lru_cache

import numpy as np
import pytest
from click.testing import CliRunner

from reachmap.cell.loading import read_cell
from reachmap.cell.model.shapes import triangles_of
from reachmap.cli import group
from reachmap.core.collision.bodies import build_geometry
from reachmap.core.collision.misplacement import MovableBodies
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from reachmap.errors import SettingsError
from reachmap.geometry import inverse_transform, quaternion_wxyz_from_rotation
from reachmap.maps import read_bin_map
from reachmap.maps.robustness.format import read_robustness
from reachmap.motions.motion import best_rows, way_points
from reachmap.plots.curves.robustness import draw_robustness
from reachmap.robustness.errors import (
    Errors,
    ErrorSize,
    misplacement,
    moved_m,
    unit_errors,
)
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.robust import robust
from reachmap.tools.verify import verify
from tests.support.optional import present

# A finger reaches down to 10 mm above the walls of the bin, a shelf beside the arm
# leaves it little room.
FINGER = (
    '{"name":"finger","attach_to":"link_3","shape":{"box":[0.02,0.02,0.15]},'
    '"pose":{"xyz":[0.1,0,-0.135]},"touch":["link_2","link_3"]}'
)
POST = (
    '{"name":"post","attach_to":"world","shape":{"cylinder":{"radius":0.01,'
    '"length":0.1}},"pose":{"xyz":[0.06,0,0]}}'
)
SHELF = (
    '{"name":"shelf","attach_to":"world","shape":{"box":[0.05,0.05,0.1]},'
    '"pose":{"xyz":[0.24,0.57,-0.15]},"touch":["bin"]}'
)
TOY = (f"bodies=[{POST},{FINGER},{SHELF}]", "bin_scan.grid=[4,3]", "bin_scan.repeats=1")
SIZES = Errors(
    bin=ErrorSize(shift_m=0.005, turn_rad=np.radians(1.0)),
    tool=ErrorSize(shift_m=0.002, turn_rad=np.radians(0.5)),
)


def pose_text(T):
    """A pose as an override has it."""
    quaternion = quaternion_wxyz_from_rotation(T[:3, :3]).tolist()
    return json.dumps({"xyz": T[:3, 3].tolist(), "quaternion_wxyz": quaternion})


@lru_cache
def as_designed(cell, overrides):
    """A cell and its robot, which are the same in every cell that is off."""
    loaded = read_cell(cell, overrides)
    return loaded, RobotModel.from_cell(loaded)


def perturbed(cell, overrides, T_base_bin, T_mount_tool, tool):
    """A cell that is off, written down as a user would, with nothing to spare."""
    loaded, robot = as_designed(cell, overrides)
    _, T_joint_mount = robot.frame_placement(loaded.cell.robot.tcp.parent)
    changes = [f"bin.pose={pose_text(T_base_bin)}"]
    for body in loaded.cell.bodies:
        if body.name in tool:
            _, T_joint_frame = robot.frame_placement(body.attach_to)
            T_mount_frame = inverse_transform(T_joint_mount) @ T_joint_frame
            T = T_mount_tool @ T_mount_frame @ body.pose.matrix()
            T = inverse_transform(T_mount_frame) @ T
            changes.append(f"bodies.{body.name}.pose={pose_text(T)}")
    changes += ["collision.safety_margin_m=0", "collision.verification_distance_m=1e-3"]
    return Scene.build(read_cell(cell, [*overrides, *changes]))


def stays_free(record, scene):
    """Whether each best path of a map stays free, shape of its test grasps."""
    free = np.zeros(record.status.shape, bool)
    for place, row in best_rows(record).items():
        planned, way = way_points(record, row)
        path = np.vstack([planned, way[1:]])
        free[place] = scene.motions.path_is_verified(path)
    return free


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    """A bin map of the toy arm with a finger."""
    path = tmp_path_factory.mktemp("toy") / "bin.h5"
    bin_scan(None, path, cell="planar-toy", overrides=TOY)
    return path


def test_no_error_moves_a_point_further_than_its_bound():
    """Corners of bin and tool of the shipped cell, displaced at random."""
    loaded = read_cell("ur5-eye-in-hand")
    robot = RobotModel.from_cell(loaded)
    bodies = build_geometry(robot, loaded, with_bin=True)
    movable = MovableBodies(robot, loaded, bodies)
    errors = Errors(
        bin=ErrorSize(shift_m=0.004, turn_rad=0.05),
        camera=ErrorSize(shift_m=0.001, turn_rad=0.02),
        tool=ErrorSize(turn_rad=0.1),
    )
    T_base_bin, T_base_camera = loaded.cell.T_base_bin(), np.eye(4)
    T_base_camera[:3, 3] = [0.4, 0.1, 0.6]
    bounds = moved_m(errors, movable, T_base_bin, T_base_camera)
    farthest = np.zeros(2)
    for unit in unit_errors(200, seed=5):
        moved = movable.moved(misplacement(errors, unit, T_base_bin, T_base_camera))
        for k, mask in enumerate((movable.is_bin, movable.is_tool)):
            for body in np.flatnonzero(mask).tolist():
                before, after = (
                    geometry.geometryObjects[body].placement.homogeneous
                    for geometry in (bodies.geometry, moved.geometry)
                )
                points = triangles_of(bodies.shapes[body]).vertices
                corners = np.column_stack([points, np.ones(len(points))])
                step = np.linalg.norm(corners @ (after - before).T, axis=1).max()
                farthest[k] = max(farthest[k], step)
    assert (farthest <= bounds).all()
    assert (farthest > 0.7 * np.array(bounds)).all()


def test_a_tool_is_what_the_flange_carries():
    """Not the link that the last joint ends in, and nothing that stands."""
    loaded = read_cell("ur5-eye-in-hand")
    robot = RobotModel.from_cell(loaded)
    bodies = build_geometry(robot, loaded, with_bin=True)
    movable = MovableBodies(robot, loaded, bodies)
    tool = {bodies.names[k] for k in np.flatnonzero(movable.is_tool)}
    assert tool == {"ee_link", "camera housing", "gripper body", "suction tube"}


def test_certified_paths_never_fail_and_replays_are_right(toy, tmp_path):
    """Against cells with other numbers in their files, one for each sample."""
    record = read_bin_map(toy)
    found = robust(toy, tmp_path / "r.h5", errors=SIZES, samples=4)
    certified = 0
    for step, scale in enumerate(found.scale):
        kept = np.zeros(record.status.shape, int)
        for sample in range(4):
            scene = perturbed(
                "planar-toy",
                TOY,
                found.bin_pose[step, sample],
                found.tool_pose[step, sample],
                {"finger"},
            )
            free = stays_free(record, scene)
            kept += free
            assert found.reachability[step, sample] == pytest.approx(100 * free.mean())
        assert not (found.is_certified[step] & (kept < 4)).any()
        np.testing.assert_array_equal(found.kept[step], kept, err_msg=f"x {scale}")
        certified += int(found.is_certified[step].sum())
    assert 0 < certified < found.is_certified.size
    assert found.reachability[-1].mean() < found.reachability[0].mean()
    assert read_robustness(tmp_path / "r.h5").certified[3] == found.certified[3]
    assert not verify([tmp_path / "r.h5"]).verdicts[0].problems


def test_the_seed_decides(toy, tmp_path):
    """Same seed, same file; another seed, other cells, the same certificates."""
    a, b, c = (
        robust(toy, tmp_path / f"{k}.h5", errors=SIZES, samples=4, seed=seed)
        for k, seed in enumerate((3, 3, 4))
    )
    np.testing.assert_array_equal(a.kept, b.kept)
    assert not np.allclose(a.bin_pose, c.bin_pose)
    np.testing.assert_array_equal(a.certificate, c.certificate)


def test_the_command_reads_lengths_and_angles(toy, tmp_path):
    """`--bin 5mm 1deg` is one option with two quantities; the answer is a table."""
    out = tmp_path / "r.h5"
    words = ["robust", "--bin", "5mm", "1deg", "--tool", "0.2cm", str(toy), "-j", "1"]
    words += ["--samples", "2", "-o", str(out), "--picture", str(tmp_path / "r.png")]
    answer = CliRunner().invoke(group, [*words, "--no-progress", "--json"])
    assert answer.exit_code == 0, answer.output
    facts = json.loads(answer.stdout)
    assert facts["errors"] == {"bin": pytest.approx([5, 1]), "tool": [2, 0]}
    assert [step["scale"] for step in facts["steps"]] == [0, 0.25, 0.5, 1, 1.5, 2]
    info = CliRunner().invoke(group, ["info", str(out)])
    assert "bin 5 mm and 1 deg, tool 2 mm off" in info.output
    assert (tmp_path / "r.png").stat().st_size > 10_000


def test_the_legend_of_the_curve_is_beside_it(toy, tmp_path):
    """No line can run through it: all of them are within the axes."""
    record = robust(toy, tmp_path / "r.h5", errors=SIZES, samples=4)
    figure = draw_robustness(record)
    figure.draw_without_rendering()
    legend, axes = figure.legends[0].get_window_extent(), figure.axes[0]
    assert axes.get_legend() is None
    assert not legend.overlaps(present(axes.get_tightbbox()))
    assert figure.bbox.x0 < legend.x0 < legend.x1 < figure.bbox.x1
    assert figure.bbox.y0 < legend.y0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "give an error"),
        (["--bin", "5"], "expected a number with its unit"),
        (["--bin", "5mm 3mm"], "one length and one angle"),
        (["--camera", "1mm"], "the cell has no camera"),
        (["--bin", "5mm", "--tool", "2m"], "--tool: errors must be 0 to 500 mm"),
        (["--bin=5mm", "--bin=3deg"], "--bin: given twice; two quantities follow one"),
        (["--bin", "5mm", "--margin", "3mm"], "collision.safety_margin_m"),
        (["--bin", "5mm", "--samples", "1"], "--samples must be"),
    ],
)
def test_wrong_errors_are_refused(toy, tmp_path, words, message):
    """One line each, exit code 2, nothing written."""
    out = tmp_path / "r.h5"
    answer = CliRunner().invoke(group, ["robust", str(toy), "-o", str(out), *words])
    assert answer.exit_code == 2
    assert message in answer.stderr
    assert not out.exists()


def test_a_map_without_paths_has_nothing_to_keep(tmp_path):
    """A bin out of reach."""
    far = [*TOY[1:], "bin.pose.xyz=[2,2,-0.2]"]
    bin_scan(None, tmp_path / "bin.h5", cell="planar-toy", overrides=far)
    with pytest.raises(SettingsError, match="no test grasp has a path"):
        robust(tmp_path / "bin.h5", tmp_path / "r.h5", errors=SIZES)


@pytest.mark.slow
def test_two_hundred_perturbed_cells(tmp_path):
    """No certified grasp fails; the predicted yield is that of cells never seen."""
    cell = "ur5-eye-in-hand"
    overrides = ("bin_scan.grid=[4,3]", "bin_scan.repeats=1", "tool.roll=listed")
    record = bin_scan(None, tmp_path / "bin.h5", cell=cell, overrides=overrides)
    found = robust(tmp_path / "bin.h5", tmp_path / "r.h5", errors=SIZES)
    given = found.scale.tolist().index(1.0)
    loaded, tool = read_cell(cell, overrides), {"camera housing", "gripper body"}
    tool.add("suction tube")
    shares = []
    for unit in unit_errors(200, seed=99):
        off = misplacement(SIZES, unit, loaded.cell.T_base_bin(), None)
        scene = perturbed(cell, overrides, off.T_base_bin, off.T_mount_tool, tool)
        free = stays_free(record, scene)
        assert not (found.is_certified[given] & ~free).any()
        shares.append(100 * free.mean())
    assert found.certified[given] > 20
    assert found.reachability[given].mean() == pytest.approx(np.mean(shares), abs=1.5)
