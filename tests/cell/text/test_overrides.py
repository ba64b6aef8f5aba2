"""``--set`` assignments."""

from __future__ import annotations

import pytest

from reachmap.cell.loading import read_cell
from reachmap.errors import CellError


def test_values_are_yaml_and_later_ones_win() -> None:
    """Numbers, lists and tables; indices and names of list entries."""
    cell = read_cell(
        "planar-toy",
        [
            "bin.wall=0.02",
            "bin.wall=3e-2",
            "bin.pose.xyz.1=0.4",
            "bodies.0.pose.xyz=[0, 0.06, 0]",
            "bodies.post.shape={sphere: {radius: 0.01}}",
            "workspace_scan.cubes.left.grid=[3, 2]",
            "camera.parent=link_3",
            " seed = 5 ",
        ],
    ).cell
    assert cell.bin.wall == 0.03
    assert cell.bin.pose.xyz == (0.15, 0.4, -0.2)
    assert cell.bodies[0].pose.xyz == (0.0, 0.06, 0.0)
    assert cell.bodies[0].shape.kind()[0] == "sphere"
    assert cell.workspace_scan.cubes[1].grid == (3, 2)
    assert cell.camera is not None
    assert cell.seed == 5


def test_an_entry_that_is_replaced_by_its_name_keeps_it() -> None:
    """Only what the path says is left out of the value; a name in it wins."""
    body = "attach_to: world, shape: {sphere: {radius: 0.01}}"
    names = [
        read_cell("planar-toy", [f"bodies.{key}={{{more}{body}}}"]).cell.bodies[0].name
        for key, more in (("post", ""), ("post", "name: mast, "), ("0", "name: x, "))
    ]
    assert names == ["post", "mast", "x"]
    with pytest.raises(CellError, match="name: is missing"):
        read_cell("planar-toy", [f"bodies.0={{{body}}}"])


def test_the_result_is_that_of_the_edited_file() -> None:
    """An override that says what the file says changes nothing."""
    plain = read_cell("planar-toy")
    same = read_cell("planar-toy", ["seed=1", "bin.wall=0.01"])
    assert plain.sha256 == same.sha256


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("bin.wal=1", "bin has no key 'wal'; did you mean 'wall'"),
        ("bni.wall=1", "the cell has no key 'bni'; did you mean 'bin'"),
        ("bodies.pots.pose.xyz.0=1", "bodies has no entry 'pots'; did you mean 'post'"),
        ("bodies.7.name=x", r"bodies has 1 entries \(got index 7\)"),
        ("bodies.-1.name=x", "bodies has no entry '-1'"),
        ("seed.x=1", r"seed is a single value \(got \.x after it\)"),
        ("seed", "expected key.path=value"),
        ("=3", "expected key.path=value"),
        ("seed=", r"seed: expected a whole number \(got nothing\)"),
        ("seed=[1", "not valid YAML"),
        ("seed=!x 1", "tags are not supported"),
        ("seed=abc", r"seed: expected a whole number \(got 'abc'\)"),
        ("bin.pose.xyz.2=low", r"bin\.pose\.xyz\.2: expected a number \(got 'low'\)"),
        ("robot.limits={velocity_rad_s: {a: 1, a: 2}}", "key given twice"),
        ("robot.limits.velocity_rad_s={joint_9: 1}", "joint_9: not a joint that moves"),
        ("planner.name=RRTConect", "expected 'LBKPIECE1'"),
        ("scan_configuration.q_rad={}", "give exactly one of q_deg, q_rad"),
        ("tool={roll: yes}", "expected listed, free, or N-fold such as 2-fold .got"),
        ("bodies.0.name=a/b", "expected a name of letters, digits, .* .got 'a/b'"),
    ],
)
def test_wrong_assignments_name_themselves(text: str, message: str) -> None:
    """The place of a mistake is the assignment, not a line of the file."""
    with pytest.raises(CellError, match=message) as caught:
        read_cell("planar-toy", [text])
    if "exactly one" not in message:
        assert all(line.startswith(f"--set {text}") for line in caught.value.lines)


def test_mistakes_of_file_and_assignments_come_together() -> None:
    """Two wrong assignments are two lines."""
    with pytest.raises(CellError, match="seed") as caught:
        read_cell("planar-toy", ["seed=-1", "bin.wall=0"])
    assert caught.value.lines == (
        "--set bin.wall=0: bin.wall: expected a number > 0 (got 0)",
        "--set seed=-1: seed: expected a number >= 0 (got -1)",
    )


def test_the_number_of_assignments_is_bounded() -> None:
    """A thousand are enough for anybody."""
    with pytest.raises(CellError, match="at most 1000 assignments"):
        read_cell("planar-toy", ["seed=1"] * 1001)
