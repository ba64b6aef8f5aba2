"""Collision elements of a URDF: used, or named with what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reachmap.cell.files.urdf import parse_urdf
from reachmap.cell.model.shapes import sides
from reachmap.core.collision.solids import SolidCell
from reachmap.errors import CellError
from tests.support.command_line import reachmap
from tests.support.small_cells import joint, link, load, robot

ARM = (joint("j1", "base", "l1"), link("base"))


@pytest.mark.parametrize(
    ("element", "size"),
    [
        ('<box size="0.1 0.2 0.3"/>', [0.1, 0.2, 0.3]),
        ('<sphere radius="0.1"/>', [0.2, 0.2, 0.2]),
        ('<cylinder radius="0.1" length="0.5"/>', [0.2, 0.2, 0.5]),
        ('<capsule radius="0.1" length="0.5"/>', [0.2, 0.2, 0.7]),
    ],
)
def test_every_kind_of_shape_is_read(
    tmp_path: Path, element: str, size: list[float]
) -> None:
    """Its box has the size that the words say; so has what is drawn and checked."""
    urdf = robot(*ARM, link("l1", element))
    (shape,) = parse_urdf(urdf, "a.urdf").collisions
    assert shape.shape is not None
    np.testing.assert_allclose(sides(shape.shape), size)
    cell = SolidCell.build(load(tmp_path, urdf, "l1", ["j1"]))
    (solid,) = [s for s in cell.solids if s.name == "l1"]
    np.testing.assert_allclose(np.ptp(solid.vertices, axis=0), size, rtol=3e-3)


@pytest.mark.parametrize(
    ("elements", "said"),
    [
        (['<cylinder radius="1"/>'], "element 1: <cylinder> needs length"),
        (['<box size="1 1 1"/>', "<plane/>"], "element 2: unknown shape <plane>"),
        ([""], "element 1: expected one shape in <geometry> .got none"),
        (['<sphere radius="1"/><box size="1 1 1"/>'], "got <sphere>, <box>"),
        (['<box size="1 1 -1"/>'], "<box size>: expected metres above 0"),
        (['<box size="1 1 0"/>'], "<box size>: expected metres above 0"),
        (['<box size="200 1 1"/>'], "up to 100"),
        (['<box size="1 1"/>'], "expected 3 finite numbers"),
        (['<sphere radius="nan"/>'], "expected a finite number"),
        (["<mesh/>"], "<mesh> needs a filename"),
        (['<mesh filename="a.stl" scale="0 1 1"/>'], "0 is not a scale"),
        (['<mesh filename="a.stl" scale="1 inf 1"/>'], "expected 3 finite numbers"),
    ],
)
def test_elements_that_cannot_be_used_are_named(elements: list[str], said: str) -> None:
    """With the link and the number of the element, whatever its neighbours are."""
    urdf = robot(*ARM, link("l1", *elements))
    with pytest.raises(CellError, match=rf"a\.urdf: link 'l1': <collision> .*{said}"):
        parse_urdf(urdf, "a.urdf")


def test_a_collision_without_geometry_is_a_fault() -> None:
    """As is one with two."""
    for inside in ("", "<geometry/><geometry/>"):
        urdf = robot(*ARM, f'<link name="l1"><collision>{inside}</collision></link>')
        with pytest.raises(CellError, match="expected one <geometry>"):
            parse_urdf(urdf, "a.urdf")


def test_links_that_can_be_seen_but_not_collide_are_named(tmp_path: Path) -> None:
    """One such link among others, and an arm of nothing else: never without a word."""
    seen = link("l2", '<box size="1 1 1"/>', tag="visual")
    more = joint("j2", "l1", "l2")
    one = robot(*ARM, link("l1", '<box size="0.1 0.1 0.1"/>'), more, seen)
    (warning,) = load(tmp_path, one, "l2", ["j1", "j2"]).warnings
    assert "no <collision> element, so never checked: l2" in warning
    every = robot(*ARM, link("l1"), more, seen)
    loaded = load(tmp_path, every, "l2", ["j1", "j2"])
    assert "NOTHING OF THE ARM IS CHECKED" in loaded.warnings[0]
    assert "l2" in loaded.warnings[0]
    answer = reachmap(tmp_path, "check", "cell.yaml")
    assert "warning: " in answer.stdout
    assert "NOTHING OF THE ARM IS CHECKED" in answer.stdout
    made = reachmap(tmp_path, "new-cell", "arm.urdf", "-o", "n.yaml")
    assert "note: NOTHING OF THE ARM IS CHECKED" in made.stderr
    scan = ("bin-scan", "--cell", "cell.yaml", "--no-progress", "-j", "1")
    scanned = reachmap(tmp_path, *scan, "-o", "b.h5")
    assert "NOTHING OF THE ARM IS CHECKED" in scanned.stderr
    body = "bodies=[{name: b, attach_to: l2, shape: {box: [0.1, 0.1, 0.1]}}]"
    (warning,) = load(tmp_path, every, "l2", ["j1", "j2"], [body]).warnings
    assert "never checked: l2" in warning


def test_an_arm_without_shapes_of_any_kind_is_reported(tmp_path: Path) -> None:
    """Flat URDFs of kinematics alone have neither visuals nor collisions."""
    bare = robot(*ARM, link("l1"))
    (warning,) = load(tmp_path, bare, "l1", ["j1"]).warnings
    assert "NOTHING OF THE ARM IS CHECKED" in warning
    assert "<visual>" not in warning


@pytest.mark.parametrize(
    "axis",
    [*(f'xyz="{xyz}"' for xyz in ("0 0 0", "1e308 0 0", "0 1e-320 0", "1e200 1e200 1")),
     "", 'rpy="0 0 1"'],
)  # fmt: skip
def test_axes_that_are_no_directions_are_refused(axis: str) -> None:
    """Engines divide by their length."""
    urdf = robot(joint("j1", "base", "l1", more=f"<axis {axis}/>"), link("base"))
    urdf = urdf.replace("</robot>", '<link name="l1"/></robot>')
    with pytest.raises(CellError, match="joint 'j1': <axis xyz>: expected a direction"):
        parse_urdf(urdf, "a.urdf")
