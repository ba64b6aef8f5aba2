"""Predicted scores against direct evaluation and against maps with a known answer."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial.transform import Rotation

from reachmap.errors import MapFileError
from reachmap.placement.predicted.places import (
    best_at_each_place,
    pose_grid,
    spread_out,
)
from reachmap.placement.predicted.prediction import (
    Footprint,
    PoseGrid,
    ReachField,
    field_of,
    linear_weights,
    predict,
)
from reachmap.placement.predicted.region import Region
from tests.support.optional import present
from tests.support.synthetic_maps import synthetic_workspace_map

DOWN = Rotation.from_euler("x", 180, degrees=True)


def tilted(azimuths_deg, tilt_deg=20.0):
    """Tool orientations that lean towards some directions, shape (n, 3, 3)."""
    angles = np.radians(np.atleast_1d(azimuths_deg))
    turns = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0]))
    return (turns * Rotation.from_euler("y", tilt_deg, degrees=True) * DOWN).as_matrix()


def rectangle(length, width, R, *, per_side=3):
    """Footprint of points that fill a rectangle along the bin's x."""
    u = np.linspace(-length / 2, length / 2, per_side)
    v = np.linspace(-width / 2, width / 2, per_side)
    points = np.array([(a, b, 0.0) for a in u for b in v])
    return Footprint(
        points=points,
        weights=np.full(len(points), 1.0 / len(points)),
        R=R,
        open=np.ones((len(points), len(R)), bool),
    )


class Direct:
    """Scores of poses one by one: loops, angles between rotations, scipy's grid."""

    def __init__(self, field, footprint):
        self.field, self.footprint = field, footprint
        axes = (field.z, field.y, field.x)
        self.path, self.ik = (
            [
                RegularGridInterpolator(
                    axes, of_one, bounds_error=False, fill_value=0.0
                )
                for of_one in values
            ]
            for values in (field.path, field.ik)
        )

    def nearest(self, turn, R):
        """Orientation of the map at the smallest angle from a turned one."""
        tool = turn * Rotation.from_matrix(R)
        away = (tool.inv() * Rotation.from_matrix(self.field.R)).magnitude()
        return int(np.argmin(np.round(away, 9)))

    def score(self, x, y, z, yaw):
        """Score, worst point and IK share of one pose."""
        footprint, turn = self.footprint, Rotation.from_euler("z", yaw)
        nearest = [self.nearest(turn, R) for R in footprint.R]
        points, shares = [], []
        for p, point in enumerate(footprint.points):
            at = np.add(turn.apply(point), (x, y, z))[::-1]
            found = share = 0.0
            for o, k in enumerate(nearest):
                if footprint.open[p, o]:
                    found += self.path[k](at)[0]
                share += self.ik[k](at)[0]
            points.append(100.0 * found / len(nearest))
            shares.append(100.0 * share / len(nearest))
        weights = footprint.weights
        return float(weights @ points), min(points), float(weights @ shares)


def random_field(rng):
    """A field of five orientations on a small lattice."""
    shape = (5, 3, 5, 6)
    path = (rng.random(shape) < 0.6).astype(float)
    return ReachField(
        x=np.linspace(0.0, 1.0, 6),
        y=np.linspace(-0.5, 0.5, 5),
        z=np.linspace(-0.1, 0.1, 3),
        R=tilted(72.0 * np.arange(5)),
        path=path,
        ik=np.maximum(path, rng.random(shape) < 0.3),
    )


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_every_pose_of_a_grid_against_direct_evaluation(seed):
    """Score, worst point and IK share are those of plain loops, at the edge as well."""
    rng = np.random.default_rng(seed)
    field = random_field(rng)
    footprint = Footprint(
        points=rng.uniform(-0.2, 0.2, (4, 3)),
        weights=rng.dirichlet(np.ones(4)),
        R=tilted(rng.uniform(0, 360, 3)),
        open=(rng.random((4, 3)) < 0.7).astype(float),
    )
    grid = PoseGrid(
        x=rng.uniform(-0.1, 1.1, 2),
        y=rng.uniform(-0.6, 0.6, 2),
        z=rng.uniform(-0.2, 0.2, 2),
        yaw=rng.uniform(0, np.pi, 2),
    )
    prediction, direct = predict(field, footprint, grid), Direct(field, footprint)
    for k, iz, iy, ix in itertools.product(range(2), repeat=4):
        wanted = direct.score(grid.x[ix], grid.y[iy], grid.z[iz], grid.yaw[k])
        place = (k, iz, iy, ix)
        assert prediction.score[place] == pytest.approx(wanted[0], abs=1e-9)
        assert prediction.worst_point[place] == pytest.approx(wanted[1], abs=1e-9)
        assert prediction.reachable_share[place] == pytest.approx(wanted[2], abs=1e-9)


def block_and_decoy():
    """A map with one block of good squares, and a perfect square among bad ones."""
    share = np.full((3, 11, 11), 0.25)
    share[1, 6:9, 3:8] = 1.0
    share[1, 0:4, 6:10] = 0.0
    share[1, 2, 8] = 1.0
    return synthetic_workspace_map(
        share,
        x=np.round(0.1 * np.arange(11), 12),
        y=np.round(-0.5 + 0.1 * np.arange(11), 12),
        z=np.array([-0.1, 0.0, 0.1]),
    )


def region_of_map(workspace):
    """Everywhere on a map, at any angle."""
    low = [workspace.x[0], workspace.y[0], workspace.z[0], 0.0]
    high = [workspace.x[-1], workspace.y[-1], workspace.z[-1], np.pi]
    return Region(low=np.array(low), high=np.array(high))


def test_the_known_best_footprint_is_found_and_the_decoy_left():
    """A bin that fits the block in just one pose is put there, by search and loops."""
    workspace = block_and_decoy()
    field = field_of(workspace)
    # As large as the block from outermost point to outermost point.
    footprint = rectangle(0.4, 0.2, field.R)
    grid = pose_grid(
        region_of_map(workspace), workspace.x, workspace.y, np.array([0.0, 0.1])
    )
    prediction = predict(field, footprint, grid)
    places = list(best_at_each_place(prediction, lambda pose: ""))
    best = spread_out(places, 2, 0.2)
    assert best[0].pose == pytest.approx((0.5, 0.2, 0.0, 0.0))
    assert present(best[0].score).score == pytest.approx(100.0)
    assert present(best[1].score).score < 90.0
    direct = Direct(field, footprint)
    scores = {
        (x, y): direct.score(x, y, 0.0, 0.0)[0]
        for x in np.round(np.arange(0.0, 1.001, 0.1), 9)
        for y in np.round(np.arange(-0.5, 0.501, 0.1), 9)
    }
    assert max(scores, key=scores.__getitem__) == pytest.approx((0.5, 0.2))
    assert sorted(scores.values())[-2] < 90.0
    assert scores[(0.8, -0.3)] < 30.0


def test_a_reason_against_the_best_gives_the_next_and_keeps_the_reason():
    """Excluded places have their reason and no score; the best of the rest wins."""
    workspace = block_and_decoy()
    field = field_of(workspace)
    grid = pose_grid(region_of_map(workspace), workspace.x, workspace.y, workspace.z)
    prediction = predict(field, rectangle(0.4, 0.2, field.R), grid)

    def reason(pose):
        return "the bin meets a post" if pose[0] > 0.41 else ""

    places = list(best_at_each_place(prediction, reason))
    assert len(places) == len(grid.x) * len(grid.y)
    assert all((c.score is None) == (c.pose[0] > 0.41) for c in places)
    assert {c.reason for c in places} == {"", "the bin meets a post"}
    best = spread_out(places, 1, 0.2)[0]
    free = prediction.score[..., grid.x <= 0.41]
    assert present(best.score).score == pytest.approx(free.max())


@pytest.mark.parametrize("yaw_deg", [0.0, 45.0, 90.0, 135.0])
def test_a_bar_is_found_at_its_angle(yaw_deg):
    """Where only a turned bar is reachable, the long bin is turned like it."""
    x, y = np.meshgrid(np.linspace(0, 1, 41), np.linspace(-0.5, 0.5, 41))
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    u, v = c * (x - 0.5) + s * y, -s * (x - 0.5) + c * y
    bar = (np.abs(u) <= 0.21) & (np.abs(v) <= 0.06)
    workspace = synthetic_workspace_map(
        bar[None].astype(float), x=x[0], y=y[:, 0], z=np.array([0.0])
    )
    field = field_of(workspace)
    region = region_of_map(workspace)
    grid = pose_grid(region, np.linspace(0, 1, 6), np.linspace(-0.5, 0.5, 6), field.z)
    prediction = predict(field, rectangle(0.36, 0.08, field.R), grid)
    places = best_at_each_place(prediction, lambda pose: "")
    best = spread_out(list(places), 1, 0.2)[0]
    assert present(best.score).score > 99.0
    assert best.pose[:2] == pytest.approx((0.5, 0.0), abs=0.051)
    assert np.degrees(best.pose[3]) == pytest.approx(yaw_deg)
    others = prediction.score[np.abs(np.degrees(grid.yaw) - yaw_deg) > 1.0]
    assert others.max() < present(best.score).score - 2.0


@pytest.mark.parametrize("reachable", [0, 1, 2])
def test_yaw_turns_the_tools_to_what_is_reachable(reachable):
    """Where one orientation alone has paths, the bin is turned until its tools have it.

    The tools of the bin lean towards its x axis, those of the map that have a path to
    0, 60 or 120 degrees: half a turn is not the same for a tool that leans.
    """
    paths = np.zeros((3, 1, 5, 5))
    paths[reachable] = 1.0
    field = ReachField(
        x=np.linspace(0.0, 1.0, 5),
        y=np.linspace(-0.5, 0.5, 5),
        z=np.array([0.0]),
        R=tilted(60.0 * np.arange(3)),
        path=paths,
        ik=paths,
    )
    region = Region(
        low=np.array([0.4, -0.1, 0.0, 0.0]), high=np.array([0.6, 0.1, 0.0, np.pi])
    )
    grid = pose_grid(region, field.x, field.y, field.z)
    prediction = predict(field, rectangle(0.2, 0.1, tilted(0.0)), grid)
    places = list(best_at_each_place(prediction, lambda pose: ""))
    best = spread_out(places, 1, 0.2)[0]
    assert present(best.score).score == pytest.approx(100.0)
    assert np.degrees(best.pose[3]) == pytest.approx(60.0 * reachable, abs=30.1)


def test_shared_rows_are_pooled_frame_by_frame():
    """Cubes that share points are averaged where both were attempted."""
    rng = np.random.default_rng(3)
    frames = rng.random((1, 5, 4, 4)) < 0.5
    workspace = synthetic_workspace_map(frames, shared_row=2)
    field = field_of(workspace)
    wanted = np.moveaxis(frames, -1, 0).astype(float)
    assert np.allclose(field.path, wanted)
    assert (field.ik >= field.path).all()


def test_cubes_with_different_orientations_are_refused():
    """A field needs the same test orientations in all cubes."""
    one = synthetic_workspace_map(np.ones((1, 3, 3)), orientations=4)
    two = synthetic_workspace_map(np.ones((1, 3, 3)), orientations=5)
    both = dataclasses.replace(one, cubes={**one.cubes, "other": two.cubes["all"]})
    with pytest.raises(MapFileError, match="different orientations"):
        field_of(both)


def test_linear_weights_add_up_inside_and_vanish_outside():
    """Weights are those of numpy's interpolation inside the grid, 0 outside."""
    grid = np.array([-0.3, 0.0, 0.1, 0.6])
    at = np.array([-0.31, -0.3, -0.1, 0.05, 0.6, 0.61])
    values = np.array([4.0, -1.0, 2.0, 8.0])
    weights = linear_weights(grid, at)
    assert np.allclose(weights[1:5] @ values, np.interp(at[1:5], grid, values))
    assert not weights[[0, 5]].any()
