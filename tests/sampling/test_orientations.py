"""Families of orientations, against the geometry they promise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reachmap.cell.loading import read_cell
from reachmap.cell.model.orientations import ConeFamily, ListFamily
from reachmap.geometry import approach_directions, rotation_angle, rotation_from_rpy_deg
from reachmap.ranking.lookup.queries import align
from reachmap.sampling.orientations import orientation_set, straight_down_orientation

AXES = ["+x", "-x", "+y", "-y", "+z", "-z"]


@pytest.mark.parametrize("axis", AXES)
def test_the_default_family_has_27_distinct_rotations(axis: str) -> None:
    """27 rotation matrices, each at least 20 degrees from every other."""
    R = orientation_set(ConeFamily(), axis)
    assert R.shape == (27, 3, 3)
    np.testing.assert_allclose(
        R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    angles = rotation_angle(R[:, None], R[None, :]) + 10 * np.eye(27)
    assert np.degrees(angles.min()) > 20


@pytest.mark.parametrize("axis", AXES)
def test_approach_directions_follow_tilt_and_azimuth(axis: str) -> None:
    """Ring, then azimuth, then roll: the direction is the closed form of each."""
    family = ConeFamily(
        tilts_deg=(0, 25), azimuths=(1, 4), azimuth_offset_deg=10, rolls=2
    )
    a = approach_directions(orientation_set(family, axis), axis)
    tilts = np.radians([0, 25, 25, 25, 25]).repeat(2)
    azimuths = np.radians([10, 10, 100, 190, 280]).repeat(2)
    expected = np.stack(
        [
            np.sin(tilts) * np.cos(azimuths),
            np.sin(tilts) * np.sin(azimuths),
            -np.cos(tilts),
        ],
        axis=1,
    )
    np.testing.assert_allclose(a, expected, atol=1e-15)


@pytest.mark.parametrize(
    ("axis", "expected"),
    [
        ("+z", [[1, 0, 0], [0, -1, 0], [0, 0, -1]]),
        ("-z", [[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
        ("+x", [[0, 1, 0], [0, 0, -1], [-1, 0, 0]]),
    ],
)
def test_straight_down_puts_the_next_axis_along_x(
    axis: str, expected: list[list[int]]
) -> None:
    """The approach axis points down, the next one in cyclic order along +x."""
    np.testing.assert_array_equal(straight_down_orientation(axis), expected)


def test_the_tilt_is_the_least_rotation() -> None:
    """Roll 0 of each direction is exactly its tilt away from straight down."""
    R = orientation_set(
        ConeFamily(tilts_deg=(0, 30, 70), azimuths=(1, 8, 5), rolls=1), "+z"
    )
    angle = rotation_angle(R, np.broadcast_to(straight_down_orientation("+z"), R.shape))
    np.testing.assert_allclose(np.degrees(angle), [0] + [30] * 8 + [70] * 5, atol=1e-12)


def test_rolls_turn_about_the_approach_direction() -> None:
    """Rolls share the direction and differ by a third of a turn each."""
    R = orientation_set(ConeFamily(), "+y").reshape(9, 3, 3, 3)
    a = approach_directions(R, "+y")
    np.testing.assert_allclose(a, np.broadcast_to(a[:, :1], a.shape), atol=1e-15)
    step = rotation_angle(R, np.roll(R, 1, axis=1))
    np.testing.assert_allclose(np.degrees(step), 120.0)


@settings(max_examples=50, deadline=None)
@given(
    offset=st.floats(-180, 180),
    span=st.floats(10, 360),
    rolls=st.integers(1, 6),
    axis=st.sampled_from(AXES),
)
def test_roll_offset_and_span_are_honoured(
    offset: float, span: float, rolls: int, axis: str
) -> None:
    """Straight down, roll k turns the tool by offset + k span / rolls about -z."""
    family = ConeFamily(
        tilts_deg=(0,),
        azimuths=(1,),
        rolls=rolls,
        roll_offset_deg=offset,
        roll_span_deg=span,
    )
    R = orientation_set(family, axis)
    for k in range(rolls):
        turn = rotation_from_rpy_deg(np.array([0, 0, -(offset + k * span / rolls)]))
        np.testing.assert_allclose(
            R[k], turn @ straight_down_orientation(axis), atol=1e-14
        )


def test_rolls_may_differ_from_ring_to_ring() -> None:
    """A family with its own rolls in each ring is its rings, one after the other."""
    family = ConeFamily(
        tilts_deg=(0, 20, 35),
        azimuths=(1, 4, 8),
        azimuth_offset_deg=10,
        rolls=(3, 1, 2),
        roll_offset_deg=(120, 180, -15),
        roll_span_deg=90,
    )
    rings = [
        ConeFamily(
            tilts_deg=(tilt,),
            azimuths=(count,),
            azimuth_offset_deg=10,
            rolls=rolls,
            roll_offset_deg=offset,
            roll_span_deg=90,
        )
        for tilt, count, rolls, offset in (
            (0, 1, 3, 120),
            (20, 4, 1, 180),
            (35, 8, 2, -15),
        )
    ]
    assert family.count() == 3 + 4 + 16
    np.testing.assert_array_equal(
        orientation_set(family), np.concatenate([orientation_set(r) for r in rings])
    )


@pytest.mark.parametrize("name", ["azimuths", "rolls", "roll_offset_deg"])
def test_what_is_given_ring_by_ring_is_given_for_every_ring(name: str) -> None:
    """A list of another length than the tilts is a mistake, and its name is said."""
    with pytest.raises(ValueError, match=rf"tilts_deg and {name} .* \(got 2 and 3\)"):
        ConeFamily(**{"tilts_deg": (0, 30), name: (1, 2, 3)})


def test_the_shipped_cell_keeps_the_published_number_and_wrist_of_each_tilt() -> None:
    """27 orientations; one roll for tilted tools, the middle one of straight down."""
    loaded = read_cell("ur5-eye-in-hand", ())
    family = loaded.cell.bin_scan.orientations
    assert isinstance(family, ConeFamily)
    R = orientation_set(family, "+z")
    assert len(R) == family.count() == 27
    a = approach_directions(R, "+z")
    back = align(R, np.broadcast_to([0.0, 0.0, -1.0], a.shape), "+z")
    np.testing.assert_allclose(back[3:], np.broadcast_to(R[1], (24, 3, 3)), atol=1e-12)


def test_a_list_is_taken_as_it_stands() -> None:
    """Listed orientations are those of the TCP, whatever its approach axis."""
    family = ListFamily(family="list", rpy_deg=((180, 0, 0), (0, 90, 45)))
    R = orientation_set(family, "-x")
    np.testing.assert_allclose(R, rotation_from_rpy_deg(np.array(family.rpy_deg)))


def test_twice_is_the_same_to_the_bit() -> None:
    """The set is deterministic, so indices keep their meaning."""
    assert (
        orientation_set(ConeFamily()).tobytes()
        == orientation_set(ConeFamily()).tobytes()
    )


def test_a_ring_without_tilt_has_one_direction() -> None:
    """Eight azimuths of straight down would be one frame counted eight times."""
    with pytest.raises(ValueError, match="tilt 0 has one direction"):
        ConeFamily(tilts_deg=(0, 30), azimuths=(8, 8))
