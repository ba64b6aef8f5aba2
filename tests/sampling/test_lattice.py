"""Lattices and stitching, against closed forms and brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reachmap.cell.model.cell import CubeSpec
from reachmap.sampling.lattice import (
    Lattice,
    axis_coordinates,
    cube_lattice,
    level_heights,
    pooled_percent,
    stitch,
)


def paper_cubes() -> list[Lattice]:
    """The two cubes of the paper, which share the row y = 0."""
    right = CubeSpec(name="r", min=(-0.1, -0.75, -0.4), max=(0.9, 0, 0.6), grid=(11, 6))
    left = CubeSpec(name="l", min=(-0.1, 0, -0.4), max=(0.9, 0.75, 0.6), grid=(11, 6))
    return [cube_lattice(right, 0.1), cube_lattice(left, 0.1)]


def test_cube_has_the_grid_and_levels_of_the_cell_file() -> None:
    """An 11×6 grid and levels every 0.1 m, ends included, order (z, y, x)."""
    lattice = paper_cubes()[0]
    assert lattice.shape == (11, 6, 11)
    assert lattice.points().shape == (11, 6, 11, 3)
    np.testing.assert_array_equal(lattice.points()[10, 5, 0], [-0.1, 0.0, 0.6])
    np.testing.assert_array_equal(lattice.points()[0, 0, 10], [0.9, -0.75, -0.4])


def test_level_zero_is_exactly_zero() -> None:
    """Steps of 0.1 from -0.4 hit 0 itself, not 5.6e-17 and not -0.0."""
    levels = level_heights(-0.4, 0.6, 0.1)
    assert levels.tolist() == [-0.4, -0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    assert not np.signbit(levels[4])


@settings(max_examples=100, deadline=None)
@given(
    low=st.integers(-200, 200),
    steps=st.integers(0, 60),
    step=st.sampled_from([1, 2, 3, 5, 7, 10, 25]),
    rest=st.floats(0, 0.99),
)
def test_levels_never_lose_or_gain_one(
    low: int, steps: int, step: int, rest: float
) -> None:
    """The count is that of exact arithmetic in hundredths, whatever rounding does."""
    high = (low + steps * step) / 100 + rest * step / 100
    levels = level_heights(low / 100, high, step / 100)
    assert len(levels) == steps + 1
    np.testing.assert_allclose(levels, (low + step * np.arange(steps + 1)) / 100)


def test_a_single_point_lies_in_the_middle() -> None:
    """One point per axis is the centre of the interval, not its lower end."""
    assert axis_coordinates(0.2, 0.8, 1).tolist() == [0.5]


def test_cubes_that_share_a_row_make_an_11_by_11_level() -> None:
    """11 × (6 + 6 - 1) points; the shared row is one row of the union."""
    stitching = stitch(paper_cubes())
    assert stitching.lattice.shape == (11, 11, 11)
    assert (np.diff(stitching.lattice.y) > 0.1).all()
    assert stitching.index[0][1].tolist() == [0, 1, 2, 3, 4, 5]
    assert stitching.index[1][1].tolist() == [5, 6, 7, 8, 9, 10]


def test_points_are_matched_by_position_not_by_index() -> None:
    """Cubes in the other order, and a rounding error apart, stitch to the same."""
    right, left = paper_cubes()
    shaken = Lattice(x=left.x + 3e-13, y=left.y - 2e-13, z=left.z + 1e-13)
    stitching = stitch([shaken, right])
    assert stitching.lattice.shape == (11, 11, 11)
    assert stitching.index[0][1].tolist() == [5, 6, 7, 8, 9, 10]


def test_eq_1_pools_the_frames_of_shared_points() -> None:
    """The share is 100 r / N, r and N added over the cubes; NaN where N is 0."""
    a = Lattice(x=np.array([0.0]), y=np.array([0.0, 1.0]), z=np.array([0.0]))
    b = Lattice(x=np.array([0.0]), y=np.array([1.0, 3.0]), z=np.array([0.0]))
    hits = [np.array([[[3.0], [1.0]]]), np.array([[[6.0], [0.0]]])]
    tried = [np.array([[[4.0], [2.0]]]), np.array([[[8.0], [0.0]]])]
    percent = pooled_percent(stitch([a, b]), hits, tried)
    np.testing.assert_allclose(percent[0, :, 0], [75.0, 70.0, np.nan])


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_pooling_agrees_with_a_dictionary_of_points(data: st.DataObject) -> None:
    """Random overlapping integer lattices against a loop over positions."""
    axis = st.lists(st.integers(0, 6), min_size=1, max_size=4, unique=True).map(sorted)
    lattices, counts = [], []
    expected: dict[tuple[float, ...], float] = {}
    for _ in range(data.draw(st.integers(1, 3))):
        x, y, z = (np.array(data.draw(axis), float) / 10 for _ in range(3))
        lattice = Lattice(x=x, y=y, z=z)
        count = np.arange(1.0, 1 + np.prod(lattice.shape)).reshape(lattice.shape)
        for p, c in zip(lattice.points().reshape(-1, 3), count.ravel(), strict=True):
            expected[tuple(p)] = expected.get(tuple(p), 0.0) + c
        lattices.append(lattice)
        counts.append(count)
    stitching = stitch(lattices)
    pooled = stitching.pool(counts)
    points = stitching.lattice.points().reshape(-1, 3)
    found = {tuple(p): c for p, c in zip(points, pooled.ravel(), strict=True)}
    for point, total in found.items():
        assert total == pytest.approx(expected.pop(point, 0.0))
    assert not expected
