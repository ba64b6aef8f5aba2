"""The place of an arm: symmetry, invariance, and what is found by brute force."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.base_pose import T_world_bin_of, with_base_at, with_world_at
from reachmap.cell.loading import read_cell
from reachmap.core.scene import Scene
from reachmap.errors import CellError, SettingsError
from reachmap.geometry import yaw_transform
from reachmap.maps.base.format import read_base, write_base
from reachmap.maps.summary.base import summarise_base
from reachmap.placement.base.fit import BaseFit
from reachmap.placement.base.lattice import (
    base_lattice,
    base_region,
    facing,
    smoothed,
)
from reachmap.placement.base.mounting import AS_IT_IS, Mounting
from reachmap.runtime.options import RunOptions
from reachmap.tools.bin_scan import load_placed_cell
from reachmap.tools.place_robot import RobotChoice, place_robot
from reachmap.tools.verify import verify

QUIET = RunOptions(quiet=True, overwrite=True)
TOY = "planar-toy"
SMALL = RobotChoice(fixed={"z": 0.0}, top=2)
# A turn about the vertical and a shift, as overrides of the toy.
MOVED = yaw_transform(1.3, -2.1, 0.4, np.radians(37.0))


def placed(tmp_path, *overrides, choice=SMALL, cell=TOY):
    """Where the arm of the toy goes."""
    return place_robot(
        cell, tmp_path / "robot.h5", choice=choice, overrides=overrides, run=QUIET
    )


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    """The toy's place, and its file."""
    folder = tmp_path_factory.mktemp("toy")
    return placed(folder), folder / "robot.h5"


def pose_text(T):
    """A pose as an override."""
    loaded = read_cell(TOY)
    moved = with_base_at(loaded, T, ())
    return json.dumps(moved.cell.robot.base_pose.model_dump(mode="json"))


def test_the_place_is_at_least_as_good_as_the_cells_own(toy):
    """The own place is mapped as well, so nothing worse can be chosen."""
    placement, _ = toy
    assert placement.present >= 0
    assert placement.score[placement.chosen] >= placement.score[placement.present]
    summary = summarise_base(placement)
    assert summary.exact == len([k for k in placement.exact if k]) < summary.candidates
    assert summary.gain is not None
    assert summary.gain >= 0.0
    assert summary.runner_up is not None
    assert summary.runner_up.row != summary.chosen.row
    apart = (
        placement.candidate_position[placement.chosen]
        - placement.candidate_position[placement.runner_up]
    )
    assert np.linalg.norm(apart) >= 0.2


def test_bounds_are_those_of_the_closed_form(toy):
    """A planar arm without obstacles near reaches what lies in its annulus."""
    placement, _ = toy
    rows = np.flatnonzero((placement.exact == 0) & ~np.isnan(placement.score))
    away = np.linalg.norm(
        placement.candidate_position[rows, :2] - placement.bin_pose[:2, 3], axis=1
    )
    # The longest way to a test grasp: half a bin's diagonal nearer than its centre,
    # and 0.7 m at full stretch; beyond it nothing is reached.
    diagonal = np.hypot(0.18, 0.13)
    assert (placement.score[rows][away > 0.7 + diagonal] == 0.0).all()
    assert (placement.score[rows] <= placement.reachable_share[rows] + 1e-9).all()
    assert placement.score[rows].max() > 90.0


def test_only_out_of_its_plane_has_the_toy_no_margin(toy):
    """Higher or lower it reaches nothing, and in its plane no body is near."""
    margin = toy[0].margin
    assert {name for name, value in margin.items() if value == 0.0} == {"+z", "-z"}
    assert len(margin) == 8


def test_a_cell_that_is_moved_and_turned_gives_the_same(toy, tmp_path):
    """All scores and margins are equal to the bit; places turn with the cell."""
    first, _ = toy
    loaded = read_cell(TOY)
    post = MOVED @ loaded.cell.bodies[0].pose.matrix()
    p = [round(float(v), 9) for v in post[:3, 3]]
    second = placed(
        tmp_path,
        f"robot.base_pose={pose_text(MOVED)}",
        f"bodies.post.pose={json.dumps({'xyz': p, 'rpy_deg': [0, 0, 37.0]})}",
        choice=dataclasses.replace(SMALL, fixed={"z": 0.4}),
    )
    for name in ("score", "score_error", "worst_point", "exact", "reachable_share"):
        assert np.array_equal(
            getattr(first, name), getattr(second, name), equal_nan=True
        )
    assert first.margin == second.margin
    assert (first.chosen, first.runner_up) == (second.chosen, second.runner_up)
    expected = first.candidate_position @ MOVED[:3, :3].T + MOVED[:3, 3]
    assert np.allclose(second.candidate_position, expected, atol=1e-8)
    assert np.allclose(second.base_pose, MOVED @ first.base_pose, atol=1e-8)


def test_the_file_is_whole_and_holds_the_cell_to_scan(toy):
    """It verifies, reads back as it was, and gives bin-scan the cell it found."""
    placement, path = toy
    assert not verify([path]).verdicts[0].problems
    again = read_base(path)
    for item in dataclasses.fields(placement):
        before, after = getattr(placement, item.name), getattr(again, item.name)
        if isinstance(before, np.ndarray):
            assert np.array_equal(before, after, equal_nan=True), item.name
        elif item.name not in ("stamp", "run"):
            assert before == after, item.name
    loaded, source = load_placed_cell(path, None, ())
    assert source == again.stamp.content_sha256
    assert np.allclose(
        loaded.cell.robot.base_pose.matrix(), placement.base_pose, atol=1e-9
    )
    assert np.allclose(T_world_bin_of(loaded.cell), placement.bin_pose, atol=1e-9)
    scene = Scene.build(loaded)
    assert scene.scan_problems() == ()


def test_a_file_that_contradicts_itself_is_refused(toy, tmp_path):
    """A chosen row whose pose is not base_pose is not written."""
    placement, _ = toy
    T = placement.base_pose.copy()
    T[0, 3] += 0.1
    wrong = dataclasses.replace(placement, base_pose=T)
    with pytest.raises(Exception, match="base_pose must be that of the chosen"):
        write_base(tmp_path / "wrong.h5", wrong)


def test_moving_the_world_is_the_same_as_building_the_cell():
    """Collision of a scene whose world was moved is that of a scene built there."""
    loaded = read_cell("ur5-eye-in-hand")
    moving = Scene.build(loaded, with_bin=True, world_moves=True)
    rng = np.random.default_rng(5)
    Q = rng.uniform(moving.robot.lower_rad, moving.robot.upper_rad, (60, 6))
    for pose in ((0.1, -0.2, 0.15, 0.7), (-0.2, 0.1, -0.1, 2.0)):
        there = with_base_at(loaded, yaw_transform(*pose), ("pedestal",))
        moved, built = moving.with_world_of(there), Scene.build(there, with_bin=True)
        assert np.array_equal(moved.checker.free_mask(Q), built.checker.free_mask(Q))
        assert np.allclose(moved.T_base_bin, built.T_base_bin)


def test_a_stand_reaches_from_the_floor_to_the_base():
    """Raised by 0.15 m, the pedestal is longer by as much, and its foot stays."""
    loaded = read_cell("ur5-eye-in-hand")
    raised = with_base_at(loaded, yaw_transform(0.3, 0.0, 0.15, 0.5), ("pedestal",))
    before, after = (
        next(b for b in x.cell.bodies if b.name == "pedestal") for x in (loaded, raised)
    )
    assert before.shape.box is not None
    assert after.shape.box is not None
    assert after.shape.box[2] == pytest.approx(before.shape.box[2] + 0.15)
    foot = before.pose.xyz[2] - before.shape.box[2] / 2
    assert after.pose.xyz[2] - after.shape.box[2] / 2 == pytest.approx(foot)
    assert after.pose.xyz[0] == pytest.approx(0.3)
    assert np.allclose(T_world_bin_of(raised.cell), T_world_bin_of(loaded.cell))
    with pytest.raises(CellError, match="no length is left of pedestal"):
        with_base_at(loaded, yaw_transform(0.0, 0.0, -0.9, 0.0), ("pedestal",))


def test_the_base_meets_what_stands_in_its_way():
    """A base in the back wall or with its pedestal in the bin is refused, by name."""
    loaded = read_cell("ur5-eye-in-hand")
    fit = BaseFit(loaded, Mounting.of(AS_IT_IS, np.eye(3), ("pedestal",)))
    assert fit.reason_against((0.0, 0.0, 0.0, 0.0)) == ""
    assert "back structure" in fit.reason_against((-0.5, 0.0, 0.0, 0.0))
    assert "bin" in fit.reason_against((0.45, 0.0, 0.05, 0.0))


def test_the_same_cell_in_another_world_is_the_same_cell():
    """Relative poses of base, bin and bodies survive a change of the world."""
    loaded = read_cell("ur5-eye-in-hand")
    seen = with_world_at(loaded, MOVED)
    for a, b in zip(loaded.cell.bodies, seen.cell.bodies, strict=True):
        if a.attach_to == "world":
            before = loaded.cell.T_base_world() @ a.pose.matrix()
            after = seen.cell.T_base_world() @ b.pose.matrix()
            assert np.allclose(before, after, atol=1e-8)
    assert np.allclose(loaded.cell.T_base_bin(), seen.cell.T_base_bin(), atol=1e-8)


def test_the_base_faces_the_bin_as_before():
    """Whatever the place, the bin lies in the same direction of the base."""
    own = (-0.5, 0.1, 0.0, 0.0)
    region = base_region(own, 1.0, {}, {})
    seen = np.arctan2(-own[1], -own[0])
    for x, y in ((0.4, 0.3), (-0.2, -0.7), (0.6, -0.1)):
        bearing = np.arctan2(-y, -x) - facing(region, own, x, y)
        assert np.cos(bearing - seen) == pytest.approx(1.0)


def test_a_rail_is_searched_to_its_ends():
    """Positions on a rail are no distances from the bin, so reach does not end them."""
    own = (0.5, 0.0, 0.0, 0.0)
    zero = {"y": 0.0, "z": 0.0, "yaw": 0.0}
    region = base_region(own, 1.0, {"x": (0.0, 3.0)}, zero)
    along = [pose[0] for pose in base_lattice(region, own, 1.0, around_bin=False)]
    assert min(along) < 0.15
    assert max(along) > 2.85
    assert own[0] in along
    around = [pose[0] for pose in base_lattice(region, own, 1.0)]
    assert max(around) <= 1.0


def test_smoothing_prefers_the_middle_of_a_plateau():
    """Of equal bounds, the one with equal ones around it promises most."""
    poses = [(0.1 * k, 0.0, 0.0, 0.0) for k in range(5)]
    values = smoothed(poses, [0.0, 90.0, 90.0, 90.0, 0.0])
    assert np.argmax(values) == 2


def test_arms_are_compared_in_one_call(tmp_path):
    """A fragment with a tighter elbow cannot beat the arm it is made from."""
    fragment = tmp_path / "stiff.yaml"
    fragment.write_text("robot: {limits: {position_deg: {joint_2: [50, 70]}, "
                        "acceleration_rad_s2: 4.0}}\n")  # fmt: skip
    choice = dataclasses.replace(SMALL, arms=(fragment,), top=1)
    placement = placed(tmp_path, choice=choice)
    assert placement.arms == ("the cell's own", "stiff")
    own, stiff = (int(row) for row in placement.best_of[:, 0])
    assert placement.score[own] > placement.score[stiff]
    assert placement.chosen == own
    assert placement.score[placement.runner_up] >= placement.score[stiff]


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        (RobotChoice(mountings=("roof",)), "--mount 'roof'.*floor, wall, ceiling"),
        (RobotChoice(rail="joint_1"), "--rail 'joint_1'.*prismatic"),
        (RobotChoice(moves=("table",)), "'table' is not a body on the world"),
        (RobotChoice(fixed={"roll": 1.0}), "--fix roll"),
        (RobotChoice(limits={"x": (1.0, 0.0)}), "x from 1 to 0: .*smaller one first"),
        (RobotChoice(limits={"z": (np.nan, 0.0)}), "z from nan to 0: expected two num"),
        (RobotChoice(limits={"z": (0.0, np.inf)}), "z from 0 to inf: expected two num"),
        (RobotChoice(fixed={"yaw": np.nan}), "--fix yaw=nan: expected a number"),
        (RobotChoice(rail="x", mountings=("floor",)), "--rail: the base stays"),
    ],
)
def test_wrong_settings_are_refused(tmp_path, choice, said):
    """Each is one clear line, and nothing is written."""
    with pytest.raises(SettingsError, match=said):
        placed(tmp_path, choice=choice)
    assert not (tmp_path / "robot.h5").exists()


def test_a_fragment_that_is_none_is_refused(tmp_path):
    """A key that no cell has is named, with the file."""
    fragment = tmp_path / "arm.yaml"
    fragment.write_text("robots: {urdf: x.urdf}\n")
    with pytest.raises(CellError, match=r"arm.yaml: robots: .*'robot'"):
        placed(tmp_path, choice=RobotChoice(arms=(Path(fragment),)))


def test_places_out_of_reach_of_the_drop_off_are_excluded(tmp_path: Path) -> None:
    """The toy reaches 0.7 m; the drop-off stays in the world, 1 m from the bin."""
    at = [0.75, 0.35, 0.0]
    placement = placed(
        tmp_path,
        f"drop_off={json.dumps({'pose': {'xyz': at, 'rpy_deg': [0, 0, 0]}})}",
    )
    no_way = np.array(placement.reason) == "no drop-off can be reached"
    away = np.linalg.norm(placement.candidate_position[:, :2] - at[:2], axis=1)
    assert no_way[away > 0.71].all()
    # What a base link meets comes first as a reason.
    free = ~np.isnan(placement.score)
    assert (away[free] <= 0.7 + 1e-6).all()
    assert no_way.any()
    assert free.any()
    assert away[placement.chosen] <= 0.7 + 1e-6


def test_only_the_cells_own_mounting_has_a_present_place(tmp_path: Path) -> None:
    """Upside down at its own place the arm is not the cell as it is."""
    choice = dataclasses.replace(SMALL, mountings=("ceiling", "floor"), top=1)
    placement = placed(tmp_path, choice=choice)
    assert placement.mountings[placement.mounting[placement.present]] == "floor"
    assert np.allclose(placement.candidate_position[placement.present], 0.0)
    summary = summarise_base(placement)
    assert [item.mounting for item in summary.best_of] == ["ceiling", "floor"]
    with pytest.raises(SettingsError, match="--mount"):
        placed(tmp_path, choice=dataclasses.replace(choice, mountings=("200",)))
