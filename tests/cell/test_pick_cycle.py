"""The part, the lift and where it goes, as a cell describes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.loading import cell_from_json, read_cell
from reachmap.errors import CellError
from tests.support.optional import present

TOY = "planar-toy"
PART = "part={shape: {box: [0.02, 0.03, 0.04]}}"
PLACE = "drop_off={q_deg: {joint_1: 90, joint_2: 0, joint_3: 0}}"
NAMED = (
    "parts={small: {shape: {sphere: {radius: 0.01}}}, big: {shape: {box: [1, 1, 1]}}}"
)


def test_nothing_of_the_cycle_counts_without_a_part() -> None:
    """Lift, drop-off and waits change no hash without a part, and are said to do so."""
    plain = read_cell(TOY)
    loaded = read_cell(TOY, [PLACE, "cycle.image_s=1", "lift.height=0.1"])
    assert loaded.sha256 == plain.sha256
    said = " ".join(loaded.warnings)
    assert all(f"{n} has no effect" in said for n in ("lift", "drop_off", "cycle"))


@pytest.mark.parametrize(
    "change", ["part.mass_kg=2", "lift.height=0.1", "cycle.io_s=1", "drop_off.name=b"]
)
def test_with_a_part_everything_of_the_cycle_counts(change: str) -> None:
    """Each key of the cycle changes the hash."""
    assert read_cell(TOY, [PART, PLACE]).sha256 != (
        read_cell(TOY, [PART, PLACE, change]).sha256
    )


def test_one_place_is_a_list_of_one() -> None:
    """A single drop-off and a list of it are the same cell."""
    several = PLACE.replace("={q", "=[{q") + "]"
    one, listed = read_cell(TOY, [PART, PLACE]), read_cell(TOY, [PART, several])
    assert one.sha256 == listed.sha256
    assert one.cell.drop_offs == listed.cell.drop_offs


def test_parts_by_name_are_chosen_by_name() -> None:
    """The first counts unless part names another; the others have no effect."""
    first, big = read_cell(TOY, [NAMED]), read_cell(TOY, [NAMED, "part=big"])
    assert present(first.cell.held())[0] == "part small"
    assert present(big.cell.held())[0] == "part big"
    alone = read_cell(TOY, ["part={shape: {box: [1, 1, 1]}}"])
    assert big.sha256 == alone.sha256 != first.sha256


def test_the_cycle_survives_the_artefact(tmp_path: Path) -> None:
    """A cell written out and read again is the same cell, its mesh found anywhere."""
    mesh = tmp_path / "part.stl"
    triangle = "facet normal 0 0 1 outer loop {} endloop endfacet "
    corners = np.vstack([np.zeros(3), 0.1 * np.eye(3)])
    faces = [
        triangle.format(" ".join(f"vertex {x} {y} {z}" for x, y, z in corners[list(f)]))
        for f in ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))
    ]
    mesh.write_text(f"solid s\n{' '.join(faces)}\nendsolid s\n")
    part = f"parts={{wedge: {{shape: {{mesh: {{file: {mesh}}}}}}}}}"
    loaded = read_cell(TOY, [part, PLACE])
    again = cell_from_json(
        loaded.resolved_json,
        urdf=loaded.urdf,
        srdf=loaded.srdf,
        files_sha256=loaded.files_sha256,
    )
    assert again.sha256 == loaded.sha256
    assert "body part wedge: part.stl" in again.files_sha256


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("part=ring", "part: no part 'ring'"),
        ("part.shape={box: [1, 2]}", "part.shape.box.2: a value is missing"),
        ("part.touch=[finger]", "part.touch.0: no link or body 'finger'"),
        ("lift.direction=up", "lift.direction: expected 'vertical', 'tool' or 'bin'"),
        ("lift.height=-1", "lift.height: expected a number > 0"),
        ("lift.contact_allowance_m=-0.1", "expected a number >= 0"),
        ("drop_off.frame=conveyor", "drop_off.frame: 'conveyor' is neither world"),
        ("drop_off.pose={xyz: [1, 0, 0]}", "exactly one of pose, q_deg"),
        ("drop_off.q_deg={joint_1: 0}", "drop_off.q_deg: joints are missing"),
        ("drop_off.group_state=home", "drop_off.group_state: a group_state needs"),
        ("drop_off.free_about=y", "drop_off.free_about: expected 'z'"),
        ("drop_off=[]", "drop_off: expected at least 1 value"),
        ("cycle.image_s=-1", "cycle.image_s: expected a number >= 0"),
        ("cycle.return_to={q_deg: {joint_9: 1}}", "joint_9: not a joint that moves"),
    ],
)
def test_mistakes_are_named(change: str, message: str) -> None:
    """Each mistake is one line with its field."""
    with pytest.raises(CellError, match=r".") as error:
        read_cell(TOY, [PART, PLACE, change])
    assert message in "\n".join(error.value.lines)


def test_two_places_of_one_name_are_refused() -> None:
    """Drop-offs are told apart by name."""
    two = "drop_off=[{pose: {xyz: [1, 0, 0]}}, {pose: {xyz: [0, 1, 0]}}]"
    with pytest.raises(CellError, match="names must differ"):
        read_cell(TOY, [PART, two])
