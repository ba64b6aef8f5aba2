"""The commands cells, check and new-cell, through the group."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from reachmap.cell.loading import read_cell, shipped_cells
from reachmap.cell.model.shapes import shape_text
from reachmap.cli import group
from reachmap.errors import CellError, SceneError
from reachmap.tools.check import check

UR5 = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"


def run(*arguments: str) -> Result:
    """Run a command line."""
    return CliRunner().invoke(group, list(arguments))


def test_cells_lists_what_is_shipped() -> None:
    """One line each, and as JSON."""
    result = run("cells")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == list(
        shipped_cells()
    )
    rows = json.loads(run("cells", "--json").stdout)["cells"]
    assert [row["name"] for row in rows] == list(shipped_cells())
    assert all(row["robot"] and row["description"] for row in rows)


def test_listing_does_not_need_the_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    """It works where the meshes are not installed."""
    monkeypatch.setattr("reachmap.cell.files.resources.data_folder", lambda: None)
    assert run("cells").exit_code == 0


def test_check_says_what_is_in_the_toy_cell() -> None:
    """Joints, bodies, pairs, scans; the scan configuration is valid."""
    result = run("check", "planar-toy")
    assert result.exit_code == 0
    for part in (
        "joint_3",
        "post  on world: cylinder r 0.01 m, length 0.1 m",
        "960 test frames, 80 test grasps",
        "scan configuration  valid",
    ):
        assert part in result.stdout
    assert "link_1 | post" not in result.stdout
    assert "link_1 | post" in run("check", "planar-toy", "-v").stdout


def test_check_as_json_has_the_numbers() -> None:
    """Limits in degrees, velocities with the cell's scaling."""
    result = run("check", "planar-toy", "--json", "--set", "robot.limits.scaling=0.5")
    answer = json.loads(result.stdout)
    assert (
        answer["sha256"] == read_cell("planar-toy", ["robot.limits.scaling=0.5"]).sha256
    )
    joint = answer["joints"][0]
    assert joint["name"] == "joint_1"
    assert joint["upper"] == pytest.approx(180)
    assert joint["velocity"] == pytest.approx(57.29578)
    assert joint["scan"] == pytest.approx(60)
    assert answer["approach_at_scan"] == pytest.approx([-0.5, 0.866025, 0.0])
    assert answer["problems"] == []


def test_check_names_the_bodies_that_touch_and_the_joint_outside() -> None:
    """The report is printed all the same; the exit code is 2."""
    change = "scan_configuration.q_deg={joint_1: 5, joint_2: 190, joint_3: 0}"
    result = run("check", "planar-toy", "--set", change)
    assert result.exit_code == 2
    assert "scan configuration  INVALID" in result.stdout
    assert result.stderr.splitlines() == [
        f"reachmap: --set {change}: scan_configuration: joint_2 = 190 deg is outside "
        "its limits [-180, 180]",
        f"reachmap: --set {change}: scan_configuration: link_1 touches post",
    ]


def test_check_of_a_wrong_cell_is_one_line_per_mistake(tmp_path: Path) -> None:
    """Nothing on standard output, exit code 2."""
    path = tmp_path / "cell.yaml"
    path.write_text("format: reachmap.cel\nname: 3\n")
    result = run("check", str(path))
    assert result.exit_code == 2
    assert result.stdout == ""
    assert f"reachmap: {path}:1:9: format: expected 'reachmap.cell'" in result.stderr
    assert f"reachmap: {path}:2:7: name: expected text (got 3)" in result.stderr


@pytest.mark.parametrize("name", ["ur10-eye-in-hand", "panda-eye-in-hand"])
def test_other_arms_can_start_and_look_down(name: str) -> None:
    """The scan configuration is free, the tool points down."""
    answer = check(name)
    assert answer.problems == ()
    assert answer.approach_at_scan == pytest.approx((0, 0, -1), abs=0.01)
    assert answer.warnings == ()
    assert answer.ik_complete == (name == "ur10-eye-in-hand")
    assert ("panda_joint7 sampled" in answer.ik_approximation) != answer.ik_complete


def test_shapes_in_words() -> None:
    """Each kind with its size."""
    cell = read_cell(
        "planar-toy",
        [
            "bodies=[{name: a, shape: {box: [1, 2, 3]}}, "
            "{name: b, shape: {sphere: {radius: 0.5}}}, "
            "{name: c, shape: {capsule: {radius: 0.1, length: 1}}}]"
        ],
    ).cell
    assert [shape_text(body.shape) for body in cell.bodies] == [
        "box 1 × 2 × 3 m",
        "sphere r 0.5 m",
        "capsule r 0.1 m, length 1 m",
    ]


def test_new_cell_of_a_small_robot_checks_without_edits(tmp_path: Path) -> None:
    """Relative reference, chain, free scan configuration; comments at guesses."""
    urdf = shipped_cells()["planar-toy"].parent / "planar-toy" / "planar_arm.urdf"
    (tmp_path / "arm.urdf").write_text(urdf.read_text())
    output = tmp_path / "cell.yaml"
    result = run("new-cell", str(tmp_path / "arm.urdf"), "-o", str(output))
    assert result.exit_code == 0, result.stderr
    assert "3 joints from base to link_3" in result.stdout
    text = output.read_text()
    assert "urdf: arm.urdf\n" in text
    assert text.count("GUESS") >= 4
    answer = check(str(output))
    assert answer.problems == ()
    assert [joint.name for joint in answer.joints] == ["joint_1", "joint_2", "joint_3"]
    again = run("new-cell", str(tmp_path / "arm.urdf"), "-o", str(output))
    assert again.exit_code == 2
    assert "exists already" in again.stderr
    assert output.read_text() == text


def uncommented(text: str) -> str:
    """A starter cell whose example camera and bodies are made real."""
    lines, part = [], ""
    for line in text.splitlines():
        if line.startswith("# camera:"):
            part = "camera"
        elif line.startswith("bodies: []"):
            part, line = "bodies", line.replace("[]", "", 1)
        elif line.startswith("bin:"):
            part = ""
        elif part == "bodies":
            line = line.replace("#", " ", 1)
        lines.append(line.removeprefix("# ") if part == "camera" else line)
    return "\n".join(lines) + "\n"


def test_the_examples_in_a_starter_cell_work(tmp_path: Path) -> None:
    """The comments, made real as they say, are a camera, a gripper and a table."""
    output = tmp_path / "cell.yaml"
    urdf = "package://example-robot-data/robots/ur_description/urdf/ur3_robot.urdf"
    assert run("new-cell", urdf, "-o", str(output)).exit_code == 0
    output.write_text(uncommented(output.read_text()))
    answer = check(str(output))
    assert answer.problems == ()
    assert [body.name for body in answer.bodies][:2] == ["gripper", "table"]
    assert read_cell(str(output)).cell.camera is not None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5_robot", "ur10_robot", "panda"])
def test_new_cell_of_published_arms_checks_without_edits(
    name: str, tmp_path: Path
) -> None:
    """Six and seven joints; the hand's fingers are locked."""
    folder = "panda_description" if name == "panda" else "ur_description"
    urdf = f"package://example-robot-data/robots/{folder}/urdf/{name}.urdf"
    output = tmp_path / "cell.yaml"
    result = run("new-cell", urdf, "-o", str(output), "--json")
    made = json.loads(result.stdout)
    assert made["tip"] == ("panda_hand_tcp" if name == "panda" else "tool0")
    assert made["problems"] == []
    assert check(str(output)).problems == ()


def test_new_cell_disables_links_that_always_touch(tmp_path: Path) -> None:
    """An SRDF beside the cell names them, and the cell refers to it."""
    links = "".join(
        f'<link name="l{k}"><collision><geometry><sphere radius="0.3"/></geometry>'
        "</collision></link>"
        for k in range(3)
    )
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/>'
        f'<child link="l{k + 1}"/><origin xyz="0.1 0 0"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="0"/></joint>'
        for k in range(2)
    )
    (tmp_path / "fat.urdf").write_text(
        f'<robot name="fat &amp; co">{links}{joints}</robot>'
    )
    output = tmp_path / "fat.yaml"
    result = run("new-cell", str(tmp_path / "fat.urdf"), "-o", str(output))
    assert result.exit_code == 0, result.stderr
    assert 'link1="l0" link2="l2"' in (tmp_path / "fat.srdf").read_text()
    cell = read_cell(str(output)).cell
    assert cell.robot.srdf == str(tmp_path / "fat.srdf")
    assert cell.robot.limits.velocity_rad_s == {"j0": 1.0, "j1": 1.0}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("none.urdf",), "not found"),
        ((UR5, "--tip", "tool1"), "no link 'tool1'; did you mean 'tool0'"),
        ((UR5, "--base", "tool0"), "no joint that moves anything relative to 'tool0'"),
        ((UR5, "--tip", "base"), "no joint moves between 'base_link' and 'base'"),
        ((UR5, "-o", "/nowhere/cell.yaml"), "does not exist"),
    ],
)
def test_new_cell_refuses_what_cannot_work(
    arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    """One line, exit code 2, nothing written."""
    extra = () if "-o" in arguments else ("-o", str(tmp_path / "cell.yaml"))
    result = run("new-cell", *arguments, *extra)
    assert result.exit_code == 2
    assert message in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_starter_is_refused_by_name_only(tmp_path: Path) -> None:
    """A robot without joints that move is no arm."""
    (tmp_path / "box.urdf").write_text('<robot name="box"><link name="a"/></robot>')
    result = run("new-cell", str(tmp_path / "box.urdf"), "-o", str(tmp_path / "c.yaml"))
    assert result.exit_code == 2
    assert "no joint that moves" in result.stderr
    with pytest.raises(CellError, match="no such file"):
        read_cell(str(tmp_path / "c.yaml"))


NAMESAKES = (
    '<robot name="n"><link name="base"/><link name="{0}"/><link name="tool"/>'
    '<link name="{1}"/>{{}}</robot>'
)
TURN = (
    '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/>'
    '<origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>'
    '<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>'
)


def test_joints_and_links_may_share_names(tmp_path: Path) -> None:
    """A URDF has two name spaces: the TCP is where it is with other names."""

    def tcp(arm: str, finger: str) -> tuple[float, ...]:
        joints = (
            TURN.format(arm, "base", "arm")
            + TURN.format("elbow", "arm", "tool")
            + TURN.format(finger, "tool", "finger")
        )
        urdf = NAMESAKES.format("arm", "finger").format(joints)
        (tmp_path / "n.urdf").write_text(urdf)
        output = tmp_path / "n.yaml"
        run("new-cell", str(tmp_path / "n.urdf"), "--tip", "tool", "-o", str(output),
            "--overwrite")  # fmt: skip
        q = f"scan_configuration.q_deg={{{arm}: 30, elbow: 45}}"
        locked = f"robot.locked_joints_deg={{{finger}: 10}}"
        body = "{name: b, attach_to: arm, shape: {sphere: {radius: 0.01}}}"
        answer = check(str(output), [q, locked, f"bodies=[{body}]"])
        assert [row.name for row in answer.joints] == [arm, "elbow"]
        return answer.tcp_at_scan_m

    assert tcp("arm", "finger") == tcp("arm", "tool") == tcp("j1", "j3")


def test_infinite_limits_count_as_not_given(tmp_path: Path) -> None:
    """Both: the joint turns without end. One: the cell must say, and is obeyed."""
    text = NAMESAKES.format("arm", "finger").format(
        TURN.format("a", "base", "arm").replace('"-2" upper="2"', '"-inf" upper="INF"')
        + TURN.format("b", "arm", "tool").replace('"2"', '"inf"')
        + TURN.format("c", "tool", "finger").replace('effort="1"', 'effort="inf"')
    )
    (tmp_path / "n.urdf").write_text(text)
    output = tmp_path / "n.yaml"
    made = run("new-cell", str(tmp_path / "n.urdf"), "-o", str(output))
    assert made.exit_code == 0, made.stderr
    rows = {row.name: (row.lower, row.upper) for row in check(str(output)).joints}
    assert rows["a"] == (-180.0, 180.0)
    assert rows["b"] == pytest.approx((-114.59, 180.0), abs=0.01)
    with pytest.raises(SceneError, match=r"position_deg: joint 'b' has no limit"):
        check(str(output), ["robot.limits.position_deg={a: [-90, 90]}"])
