"""Limits of URDF, SRDF and joint_limits.yaml mean what they mean to MoveIt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.loading import LoadedCell
from reachmap.core.planning.timing import execution_time_s
from reachmap.core.robot.model import RobotModel
from reachmap.errors import CellError, SceneError
from tests.support.small_cells import LIMIT, joint, link, load, robot

SOFT = '<safety_controller k_velocity="1" {}/>'
BOX = '<box size="0.1 0.1 0.1"/>'


def arm(
    folder: Path, *overrides: str, more: str = "", kind: str = "revolute"
) -> RobotModel:
    """One joint, with further elements in it."""
    urdf = robot(link("base"), link("l1", BOX), joint("j1", "base", "l1", kind=kind,
                 more=more))  # fmt: skip
    return RobotModel.from_cell(load(folder, urdf, "l1", ["j1"], overrides))


def ends(model: RobotModel) -> tuple[float, float]:
    """Position limits of the first joint [rad or m]."""
    return float(model.lower_rad[0]), float(model.upper_rad[0])


def limits(folder: Path, text: str) -> str:
    """Override that names a joint limits file with this text."""
    (folder / "limits.yaml").write_text(text)
    return "robot.joint_limits=limits.yaml"


@pytest.mark.parametrize(
    ("soft", "expected"),
    [
        ('soft_lower_limit="-1" soft_upper_limit="2"', (-1.0, 2.0)),
        ('soft_lower_limit="-9" soft_upper_limit="9"', (-3.0, 3.0)),
        ('soft_upper_limit="0.5"', (-3.0, 0.5)),
        ("", (-3.0, 3.0)),
    ],
)
def test_soft_limits_narrow_the_hard_ones(
    tmp_path: Path, soft: str, expected: tuple[float, float]
) -> None:
    """Never widen them; a side that is not given does not count."""
    assert ends(arm(tmp_path, more=SOFT.format(soft))) == expected


def test_soft_limits_without_a_range_are_named_and_not_used(tmp_path: Path) -> None:
    """Many files have zeros there."""
    zeros = SOFT.format('soft_lower_limit="0" soft_upper_limit="0"')
    urdf = robot(link("base"), link("l1", BOX), joint("j1", "base", "l1", more=zeros))
    loaded = load(tmp_path, urdf, "l1", ["j1"])
    assert "joint 'j1': the soft limits leave no range" in loaded.warnings[0]
    assert ends(RobotModel.from_cell(loaded)) == (-3.0, 3.0)


@pytest.mark.parametrize(
    ("more", "warning"),
    [
        (SOFT.format('soft_lower_limit="-1"'), "no soft_upper_limit, which MoveIt"),
        (SOFT.format('soft_upper_limit="1"'), "no soft_lower_limit, which MoveIt"),
        ('<limit lower="-170" upper="170" velocity="2"/>', "in radians (got 170)"),
        ('<limit lower="-15.7" upper="15.7" velocity="2"/>', ""),
        ('<limit lower="-1e16" upper="1e16" velocity="2"/>', ""),
    ],
)
def test_limits_that_others_take_differently_are_named(
    tmp_path: Path, more: str, warning: str
) -> None:
    """Soft limits with one end, and degrees where radians belong."""
    urdf = robot(link("base"), link("l1", BOX), joint("j1", "base", "l1", more=more))
    warnings = [w for w in load(tmp_path, urdf, "l1", ["j1"]).warnings if "j1" in w]
    assert len(warnings) == bool(warning), warnings
    assert not warning or warning in warnings[0]


def test_infinite_limits_are_none(tmp_path: Path) -> None:
    """A turning joint then turns without end, a slide has to be given its ends."""
    endless = '<limit lower="-inf" upper="INF" velocity="2" effort="inf"/>'
    assert ends(arm(tmp_path, more=endless)) == pytest.approx((-np.pi, np.pi))
    wide = "robot.limits.position_deg={j1: [-400, 500]}"
    assert ends(arm(tmp_path, wide, more=endless)) == pytest.approx(
        tuple(np.radians([-400, 500]))
    )
    with pytest.raises(SceneError, match="'j1' has no limit in the URDF"):
        arm(tmp_path, more=endless, kind="prismatic")
    slide = "robot.limits.position_deg={j1: [-0.5, 2]}"
    assert ends(arm(tmp_path, slide, more=endless, kind="prismatic")) == (-0.5, 2.0)
    speed = LIMIT.replace('velocity="2"', 'velocity="inf"')
    with pytest.raises(SceneError, match="no velocity limit for j1"):
        arm(tmp_path, more=speed)


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ("max_position: 1.5", (-3.0, 1.5)),
        ("min_position: -0.5", (-0.5, 3.0)),
        ("has_position_limits: yes, min_position: -1, max_position: 2", (-1.0, 2.0)),
        ("has_position_limits: no, min_position: -1, max_position: 2", (-3.0, 3.0)),
        ("has_position_limits: False, min_position: -1", (-3.0, 3.0)),
        ("min_position: !degrees -90, max_position: !radians 1", (-np.pi / 2, 1.0)),
        ("min_position: -30, max_position: 30", (-3.0, 3.0)),
    ],
)
def test_ranges_of_joint_limits_files(
    tmp_path: Path, entry: str, expected: tuple[float, float]
) -> None:
    """Each side by itself, on unless switched off, in the unit of its tag."""
    given = limits(tmp_path, f"joint_limits: {{j1: {{{entry}}}}}")
    assert ends(arm(tmp_path, given)) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("entry", "velocity", "acceleration"),
    [
        ("max_velocity: !degrees 60", np.pi / 3, 5.0),
        ("has_velocity_limits: On, max_velocity: 1.5", 1.5, 5.0),
        ("has_velocity_limits: off, max_velocity: 1.5", 2.0, 5.0),
        ("has_acceleration_limits: yes, max_acceleration: !degrees 180", 2.0, np.pi),
    ],
)
def test_rates_of_joint_limits_files(
    tmp_path: Path, entry: str, velocity: float, acceleration: float
) -> None:
    """In the unit of their tag; the tightest of both files wins."""
    model = arm(tmp_path, limits(tmp_path, f"joint_limits: {{j1: {{{entry}}}}}"))
    assert model.velocity_rad_s[0] == pytest.approx(velocity)
    assert model.acceleration_rad_s2[0] == pytest.approx(acceleration)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("max_velocity: !deg 60", "tags other than !degrees, !radians .*.got !deg"),
        ("max_velocity: !degrees fast", "a number after !degrees .got 'fast'"),
        ("max_velocity: !degrees [1]", "a number after !degrees .got a list"),
        ("max_velocity: !radians {a: 1}", "a number after !radians .got a mapping"),
        ("has_velocity_limits: maybe, max_velocity: 1", "expected true or false"),
        ("has_position_limits: true", "needs min_position or max_position"),
        ("min_position: 2, max_position: 1", "min_position must be below"),
    ],
)
def test_wrong_joint_limits_have_a_place(tmp_path: Path, entry: str, said: str) -> None:
    """File, line and column."""
    with pytest.raises(CellError, match=rf"limits\.yaml:2:\d+: .*{said}"):
        arm(tmp_path, limits(tmp_path, f"joint_limits:\n  j1: {{{entry}}}"))


def test_what_a_joint_limits_file_says_in_vain_is_said(tmp_path: Path) -> None:
    """Joints of another robot, and scaling factors that a cell has for itself."""
    text = (
        "default_velocity_scaling_factor: 0.1\n"
        "default_acceleration_scaling_factor: 1\n"
        "joint_limits:\n  ur_j1: {max_velocity: 1}\n  j1: {max_velocity: 1}\n"
    )
    urdf = robot(link("base"), link("l1", BOX), joint("j1", "base", "l1"))
    loaded = load(tmp_path, urdf, "l1", ["j1"], [limits(tmp_path, text)])
    factor, names = loaded.warnings
    assert "limits.yaml:1:34: default_velocity_scaling_factor: 0.1" in factor
    assert "robot.limits.scaling" in factor
    assert "limits.yaml:4:3: ignored, not joints of the robot: ur_j1" in names


def test_keys_that_are_not_read_are_named(tmp_path: Path) -> None:
    """Each once, at its first place; those that no map depends on are not."""
    text = (
        "joint_limits:\n"
        "  j1: {max_velocities: 1, has_effort_limits: yes, angle_wraparound: true}\n"
        "  j2: {max_velocities: 1, soft_upper_limit: 1}\n"
    )
    urdf = robot(link("base"), link("l1", BOX), joint("j1", "base", "l1"),
                 link("l2", BOX), joint("j2", "l1", "l2"))  # fmt: skip
    given = [limits(tmp_path, text)]
    typo, soft = load(tmp_path, urdf, "l2", ["j1", "j2"], given).warnings
    assert "limits.yaml:2:8: max_velocities is not read; did you mean 'max_v" in typo
    assert "limits.yaml:3:27: soft_upper_limit is not read" in soft


def test_a_range_that_the_file_leaves_empty_names_the_joint(tmp_path: Path) -> None:
    """The URDF ends at 3 rad, before the file's range begins."""
    given = limits(tmp_path, "joint_limits: {j1: {min_position: 4}}")
    with pytest.raises(CellError, match=r"robot\.joint_limits: joint 'j1': no range"):
        arm(tmp_path, given)


@pytest.mark.parametrize("scaling", [0.5, 0.1])
@pytest.mark.parametrize("distance", [0.01, 2.5])
def test_scaling_is_the_speed_slider(
    tmp_path: Path, scaling: float, distance: float
) -> None:
    """Short moves, which only accelerate, and long ones last 1/scaling times as long.

    Closed forms of rest to rest: 2 √(d/a), and d/v + v/a.
    """
    path = np.array([[0.0], [distance]])
    full, slow = arm(tmp_path), arm(tmp_path, f"robot.limits.scaling={scaling}")
    times = [
        execution_time_s(path, model.velocity_rad_s, model.acceleration_rad_s2)
        for model in (full, slow)
    ]
    v, a = 2.0, 5.0
    accelerates = distance < v * v / a
    closed = 2 * np.sqrt(distance / a) if accelerates else distance / v + v / a
    assert times[0] == pytest.approx(closed, rel=1e-3)
    assert times[1] / times[0] == pytest.approx(1 / scaling, rel=1e-3)


SRDF = '<robot name="r">\n<!-- <disable_collisions/> -->\n{}\n</robot>'


@pytest.mark.parametrize(
    ("element", "said"),
    [
        ("<disable_collisions/>", ":3: <disable_collisions> needs link1"),
        ('<disable_collisions link1="l1"/>', ":3: <disable_collisions> needs link2"),
        (
            "<disable_default_collisions/>",
            ":3: <disable_default_collisions> needs link",
        ),
        ('<enable_collisions link2="l1"/>', ":3: <enable_collisions> needs link1"),
    ],
)
def test_pairs_without_links_are_refused(
    tmp_path: Path, element: str, said: str
) -> None:
    """With file and line, comments not counted."""
    (tmp_path / "r.srdf").write_text(SRDF.format(element))
    with pytest.raises(CellError, match=rf"r\.srdf{said}"):
        arm(tmp_path, "robot.srdf=r.srdf")


HOME = (
    '<group_state name="home" group="g">\n<joint name="j1" value="{}"/></group_state>'
)


def state_of_one_joint(folder: Path, *states: str) -> LoadedCell:
    """An arm of one joint whose scan configuration is the state ``home``."""
    (folder / "r.srdf").write_text(SRDF.format("\n".join(states)))
    urdf = robot(link("base"), link("l1", BOX), joint("j1", "base", "l1"))
    return load(folder, urdf, "l1", ["j1"], [
        "robot.srdf=r.srdf", "scan_configuration={group_state: home}"])  # fmt: skip


def test_a_joint_with_two_values_is_named_with_its_line(tmp_path: Path) -> None:
    """Not as a state that lacks the joint; lines of comments count."""
    with pytest.raises(CellError, match=r"r\.srdf:5: .*'home': joint 'j1': .*'1 2'"):
        state_of_one_joint(tmp_path, "<!--\n-->" + HOME.format("1 2"))


def test_states_of_one_name_belong_together(tmp_path: Path) -> None:
    """Each group has its own; where they differ, the first counts and it is said."""
    other = HOME.replace("j1", "j9").format(2)
    loaded = state_of_one_joint(tmp_path, HOME.format(0.5), other)
    assert loaded.scan_configuration_rad == {"j1": 0.5}
    assert not loaded.warnings
    loaded = state_of_one_joint(tmp_path, HOME.format(0.5), HOME.format(0.7))
    assert loaded.scan_configuration_rad == {"j1": 0.5}
    assert "another value of 'j1'" in loaded.warnings[0]


def test_states_of_virtual_joints_are_passed_over(tmp_path: Path) -> None:
    """Theirs have several values; a state of the arm is used all the same."""
    text = (
        '<virtual_joint name="v" type="planar" parent_frame="w" child_link="base"/>'
        '<group_state name="home" group="g"><joint name="v" value="0 0 0"/>'
        '<joint name="j1" value="0.5"/></group_state>'
        '<disable_collisions link1="l1" link2="gone"/>'
    )
    (tmp_path / "r.srdf").write_text(SRDF.format(text))
    urdf = robot(link("base"), link("l1", BOX), joint("j1", "base", "l1"))
    loaded = load(tmp_path, urdf, "l1", ["j1"], [
        "robot.srdf=r.srdf", "scan_configuration={group_state: home}"])  # fmt: skip
    assert loaded.scan_configuration_rad == {"j1": 0.5}
    assert "collisions of links not in the URDF" in loaded.warnings[0]


@pytest.mark.parametrize(
    ("rates", "acceleration", "jerk"),
    [
        ('acceleration="3" deceleration="2" jerk="40"', 2.0, 40.0),
        ('acceleration="3"', 3.0, np.inf),
        ('acceleration="9" jerk="900"', 5.0, 900.0),
        ('acceleration="0" deceleration="0" jerk="0"', 5.0, np.inf),
        ('acceleration="inf" jerk="inf"', 5.0, np.inf),
    ],
)
def test_accelerations_and_jerks_of_a_urdf_tighten_those_of_the_cell(
    tmp_path: Path, rates: str, acceleration: float, jerk: float
) -> None:
    """Version 1.2 of the format has them; zeros stand for none."""
    model = arm(tmp_path, more=LIMIT.replace("/>", f" {rates}/>"))
    assert float(model.acceleration_rad_s2[0]) == acceleration
    assert float(model.jerk_rad_s3[0]) == jerk


def test_a_cell_needs_no_acceleration_where_the_urdf_has_one(tmp_path: Path) -> None:
    """Neither does one of a lower scaling, which counts squared and cubed."""
    rates = LIMIT.replace("/>", ' acceleration="3" jerk="40"/>')
    limits = "robot.limits={scaling: 0.5}"
    model = arm(tmp_path, limits, more=rates)
    assert float(model.acceleration_rad_s2[0]) == 0.75
    assert float(model.jerk_rad_s3[0]) == 5.0


def test_a_velocity_that_can_hardly_be_in_radians_is_named(tmp_path: Path) -> None:
    """Degrees a second are; what stands for no limit is not."""
    for given, named in (("120", True), ("20", False), ("1e9", False)):
        more = LIMIT.replace('velocity="2"', f'velocity="{given}"')
        urdf = robot(
            link("base"), link("l1", BOX), joint("j1", "base", "l1", more=more)
        )
        warnings = load(tmp_path, urdf, "l1", ["j1"]).warnings
        assert any("velocity is in rad/s (got 120)" in w for w in warnings) == named


def test_limits_of_a_follower_that_are_swapped_are_not_used(tmp_path: Path) -> None:
    """A finger beside the arm goes where its leader goes; of others it is a mistake."""
    swapped = LIMIT.replace('"-3"', '"1"').replace('"3"', '"0"')
    finger = joint("j2", "l1", "l2", more=swapped + '<mimic joint="j1"/>')
    parts = [link("base"), link("l1", BOX), link("l2", BOX), joint("j1", "base", "l1")]
    loaded = load(tmp_path, robot(*parts, finger), "l1", ["j1"])
    (warning,) = loaded.warnings
    assert "joint 'j2': limit 1 is above 0; not used" in warning
    assert ends(RobotModel.from_cell(loaded)) == (-3.0, 3.0)
    with pytest.raises(CellError, match="limit 1 is above 0"):
        load(tmp_path, robot(*parts, joint("j2", "l1", "l2", more=swapped)), "l1", [])
