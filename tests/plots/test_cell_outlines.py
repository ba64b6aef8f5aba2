"""What stands in the cell is drawn to scale, where the cell says it stands."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.cell.model.cell import BinSpec, BodySpec, Cell
from reachmap.geometry import yaw_transform
from reachmap.plots.parts.context import context_of, patch_shape
from reachmap.plots.parts.outlines import (
    base_outline,
    bin_outlines,
    body_outlines,
)
from tests.support.synthetic_maps import cell_json, synthetic_provenance

CELL = Cell.model_validate_json(cell_json())


def area(polygon: np.ndarray) -> float:
    """Area of a polygon by the shoelace formula [m²]."""
    x, y = polygon.T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))


def with_bodies(*bodies: Mapping[str, object], **robot: object) -> Cell:
    """The shipped cell with other bodies and robot settings."""
    records = tuple(BodySpec.model_validate(body) for body in bodies)
    changed = CELL.robot.model_copy(update=robot)
    return CELL.model_copy(update={"bodies": records, "robot": changed})


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ({"box": [0.2, 0.4, 0.6]}, (0.08, 0.6)),
        ({"cylinder": {"radius": 0.1, "length": 0.5}}, (np.pi * 0.01, 0.5)),
        ({"sphere": {"radius": 0.1}}, (np.pi * 0.01, 0.2)),
        ({"capsule": {"radius": 0.1, "length": 0.5}}, (np.pi * 0.01, 0.7)),
    ],
)
def test_outlines_have_the_size_of_the_shape(
    shape: dict[str, object], expected: tuple[float, float]
) -> None:
    """Area from above and height, against the formulae of solids."""
    body = {"name": "thing", "attach_to": "robot_base", "shape": shape}
    (outline,) = body_outlines(with_bodies(body))
    assert area(outline.polygon) == pytest.approx(expected[0], rel=4e-3)
    assert outline.z_high_m - outline.z_low_m == pytest.approx(expected[1], rel=1e-9)


def test_bodies_in_the_world_move_with_the_base_pose() -> None:
    """The picture is in robot_base, whatever the robot stands on in the world."""
    base = CELL.robot.base_pose.model_copy(
        update={"xyz": (0.0, 0.0, 0.8), "rpy_deg": (0.0, 0.0, 90.0)}
    )
    cell = with_bodies(
        {"name": "post", "shape": {"box": [0.2, 0.1, 0.4]}, "pose": {"xyz": [1, 0, 1]}},
        base_pose=base,
    )
    (outline,) = body_outlines(cell)
    # Seen from a base turned by +90°, world +x is its -y.
    np.testing.assert_allclose(outline.polygon.mean(axis=0), [0.0, -1.0], atol=1e-9)
    np.testing.assert_allclose(np.ptp(outline.polygon, axis=0), [0.1, 0.2], atol=1e-9)
    assert (outline.z_low_m, outline.z_high_m) == pytest.approx((0.0, 0.4))


def test_what_the_arm_carries_and_meshes_are_left_out() -> None:
    """A camera housing on the wrist stands nowhere."""
    names = {outline.name for outline in body_outlines(CELL)}
    assert "pedestal" in names
    assert not {"camera housing", "gripper"} & names
    mesh = {"name": "cast", "shape": {"mesh": {"file": "cast.stl"}}}
    assert body_outlines(with_bodies(mesh)) == ()


def test_near_is_crossing_or_within_the_distance() -> None:
    """Heights that the body spans, and a little more."""
    body = {"name": "b", "attach_to": "robot_base", "shape": {"box": [1, 1, 0.2]}}
    (outline,) = body_outlines(with_bodies(body))
    assert outline.near(0.0, 0.0)
    assert outline.near(0.14, 0.05)
    assert not outline.near(0.16, 0.05)


def test_bin_outlines_are_inner_and_outer_rectangle() -> None:
    """Turned and moved with the bin, from under the bottom to the rim."""
    spec = BinSpec(inner=(0.36, 0.26, 0.15), wall=0.005, bottom=0.01)
    outer, inner = bin_outlines(spec, yaw_transform(0.5, 0.1, -0.05, np.pi / 2))
    np.testing.assert_allclose(np.ptp(inner.polygon, axis=0), [0.26, 0.36])
    np.testing.assert_allclose(np.ptp(outer.polygon, axis=0), [0.27, 0.37])
    np.testing.assert_allclose(inner.polygon.mean(axis=0), [0.5, 0.1])
    assert (outer.z_low_m, outer.z_high_m) == pytest.approx((-0.06, 0.10))
    assert (outer.name, inner.name) == ("bin", "")


def test_base_outline_of_the_ur5_is_its_foot() -> None:
    """The published foot is 149 mm across; the cable plug sticks out of it."""
    loaded = read_cell("ur5-eye-in-hand")
    outline = base_outline(loaded.cell, loaded.urdf)
    assert outline.name == "robot base"
    angle = np.arctan2(outline.polygon[:, 1], outline.polygon[:, 0])
    radius = np.linalg.norm(outline.polygon, axis=1)
    away_from_plug = np.abs(angle + np.pi / 2) > 0.3
    np.testing.assert_allclose(radius[away_from_plug], 0.0745, atol=0.002)


URDF = """
<robot name="r">
  <link name="world"/>
  <link name="foot"><collision>
    <origin xyz="0 0 0.05"/><geometry><cylinder radius="0.2" length="0.1"/></geometry>
  </collision></link>
  <link name="plate"><collision>
    <geometry><box size="0.6 0.2 0.02"/></geometry>
  </collision></link>
  <link name="arm"><collision>
    <geometry><sphere radius="5"/></geometry>
  </collision></link>
  <joint name="a" type="fixed"><parent link="world"/><child link="foot"/></joint>
  <joint name="b" type="fixed"><parent link="foot"/><child link="plate"/>
    <origin xyz="0 0 -0.01"/></joint>
  <joint name="c" type="continuous"><parent link="foot"/><child link="arm"/></joint>
</robot>
"""


def test_base_outline_joins_the_links_that_stand_still() -> None:
    """Fixed joints are followed, moving ones are not."""
    outline = base_outline(CELL, URDF)
    np.testing.assert_allclose(np.ptp(outline.polygon, axis=0), [0.6, 0.4], atol=0.01)
    assert (outline.z_low_m, outline.z_high_m) == pytest.approx((-0.02, 0.1))


@pytest.mark.parametrize(
    "urdf",
    [
        "",
        "<robot>",
        "<robot name='empty'/>",
        "<!DOCTYPE r [<!ENTITY a 'b'>]><robot name='r'/>",
        URDF.replace('<box size="0.6 0.2 0.02"/>', '<mesh filename="no/such.stl"/>'),
        URDF.replace('radius="0.2"', 'radius="wide"'),
    ],
)
def test_a_base_that_cannot_be_read_is_a_circle_at_the_origin(urdf: str) -> None:
    """A picture on another machine shows where the base is, and says so."""
    outline = base_outline(CELL, urdf)
    assert outline.name == "robot base (origin)"
    np.testing.assert_allclose(np.linalg.norm(outline.polygon, axis=1), 0.05)


def test_an_artefact_with_a_strange_cell_still_gives_pictures() -> None:
    """The numbers are worth a picture without outlines."""
    context = context_of(synthetic_provenance(cell_resolved_json='{"new": "kind"}'))
    assert context.cell is None
    assert context.standing == ()


def test_patch_is_about_the_size_of_the_bin() -> None:
    """The paper's bin covers 3×3 squares of 0.10 m by 0.15 m."""
    spec = BinSpec(inner=(0.36, 0.26, 0.15))
    turned = bin_outlines(spec, yaw_transform(0.5, 0.0, 0.0, np.pi / 2))
    x, y = np.linspace(-0.1, 0.9, 11), np.linspace(-0.75, 0.75, 11)
    assert patch_shape(turned, x, y) == (3, 3)
    assert patch_shape(turned, x / 2, y / 2) == (5, 5)
    assert patch_shape((), x, y) == (3, 3)
    assert patch_shape(turned, x * 10, y * 10) == (1, 1)
