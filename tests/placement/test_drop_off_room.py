"""Whether bins leave room where parts are put down."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.core.scene import Scene
from reachmap.geometry import yaw_transform
from reachmap.placement.room import DropOffRoom
from tests.support.scenes import scene_of

PART = "part={shape: {box: [0.04, 0.04, 0.06]}, pose: {xyz: [0, 0, 0.03]}}"
DOWN = "rpy_deg: [180, 0, 0]"


def room_at(*drop_offs: str) -> DropOffRoom:
    """The UR5 cell with drop-offs, 100 mm above robot_base."""
    scene: Scene = scene_of(
        "ur5-eye-in-hand", PART, f"drop_off=[{', '.join(drop_offs)}]", with_bin=False
    )
    return DropOffRoom(scene)


BELT = f"{{name: belt, frame: robot_base, pose: {{xyz: [0.5, 0.5, 0.1], {DOWN}}}}}"


def test_a_bin_under_the_part_or_beside_it():
    """The box around the bin counts, its inside too, up to the part's lower side."""
    room = room_at(BELT)
    rim_m = 0.05
    assert room.taken(yaw_transform(0.5, 0.5, 0.0, 0.0)) == "belt"
    # 60 mm of the part hang below the tool point; the tool itself ends above it.
    assert room.taken(yaw_transform(0.5, 0.5, 0.04 - rim_m - 0.01, 0.0)) == ""
    assert room.taken(yaw_transform(0.5, 0.5, 0.04 - rim_m + 0.01, 0.0)) == "belt"
    assert room.taken(yaw_transform(0.5, -0.3, 0.0, 0.0)) == ""


def test_any_of_the_equivalent_turns_will_do():
    """A bin that the camera housing meets in one turn leaves room in another."""
    beside = yaw_transform(0.5 + 0.18 + 0.03, 0.5, 0.24, 0.0)
    fixed = [
        room_at(
            "{name: belt, frame: robot_base, pose: "
            f"{{xyz: [0.5, 0.5, 0.1], rpy_deg: [180, 0, {yaw}]}}}}"
        ).taken(beside)
        for yaw in (0, 90, 180, 270)
    ]
    assert sorted(set(fixed)) == ["", "belt"]
    free = BELT.replace("name: belt", "name: belt, free_about: z")
    assert room_at(free).taken(beside) == ""


def test_every_drop_off_counts_but_those_in_the_bin():
    """Joint values say where the tool is, too."""
    second = BELT.replace("belt", "second").replace("0.5, 0.5", "0.5, -0.5")
    inside = "{name: inside, frame: bin, pose: {xyz: [0, 0, 0.06], " + DOWN + "}}"
    room = room_at(BELT, second, inside)
    assert room.taken(yaw_transform(0.5, -0.5, 0.0, 0.0)) == "second"
    assert room.taken(yaw_transform(0.5, 0.0, 0.0, 0.0)) == ""
    scene = scene_of("ur5-eye-in-hand", with_bin=False)
    q = dict(zip(scene.robot.joint_names, scene.scan_configuration, strict=True))
    joints = ", ".join(f"{name}: {value}" for name, value in q.items())
    x, y, z = scene.kinematics.forward(scene.scan_configuration)[:3, 3]
    room = room_at(f"{{name: rest, q_rad: {{{joints}}}}}")
    assert room.taken(yaw_transform(x, y, z - 0.05, 0.0)) == "rest"
    assert room.taken(yaw_transform(x, y + 0.8, z - 0.05, 0.0)) == ""


def test_a_drop_off_in_a_bin_that_is_not_there_yet_has_no_place(tmp_path):
    """Once that bin stands, others leave its drop-off room wherever that is."""
    other = "{inner: [0.3, 0.2, 0.1], pose: {xyz: [0.5, 0.5, 0.0]}}"
    text = read_cell("ur5-eye-in-hand").text
    head, rest = text.split("\nbin:\n")
    rest = rest[rest.index("\nscan_configuration:") :]
    bins = f"bins:\n  full: {other.replace('0.5, 0.5', '0.5, -0.2')}\n  goal: {other}"
    (tmp_path / "two.yaml").write_text(f"{head}\n{bins}{rest}")
    inside = "{frame: goal, pose: {xyz: [0, 0, 0.07], " + DOWN + "}}"
    loaded = read_cell(str(tmp_path / "two.yaml"), [PART, f"drop_off={inside}"])
    alone, both = (
        DropOffRoom(Scene.build(beside, with_bin=False))
        for beside in (loaded.with_other_bins({}), loaded)
    )
    for x, y in ((0.5, 0.5), (0.5, -0.5)):
        assert alone.taken(yaw_transform(x, y, 0.0, 0.0)) == ""
    assert both.taken(yaw_transform(0.5, 0.5, 0.0, 0.0)) == "drop-off"
    assert both.taken(yaw_transform(0.5, -0.5, 0.0, 0.0)) == ""


@pytest.mark.parametrize("angle_deg", [0.0, 37.0, 90.0])
def test_turning_bin_and_drop_off_together_changes_nothing(angle_deg: float):
    """What counts is where they stand to each other."""
    angle = np.radians(angle_deg)
    turn = yaw_transform(0.0, 0.0, 0.0, angle)
    x, y = turn[:2, :2] @ [0.5, 0.5]
    room = room_at(
        "{name: belt, frame: robot_base, pose: "
        f"{{xyz: [{x}, {y}, 0.1], rpy_deg: [180, 0, {angle_deg}]}}}}"
    )
    for offset in np.linspace(-0.4, 0.4, 9):
        bin_pose = turn @ yaw_transform(0.5 + offset, 0.5, 0.0, 0.3)
        assert room.taken(bin_pose) == room_at(BELT).taken(
            yaw_transform(0.5 + offset, 0.5, 0.0, 0.3)
        )
