"""Pictures of the bin map show its attempts, its costs and its causes."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from matplotlib.patches import FancyArrowPatch, Polygon
from scipy.stats import binomtest

from reachmap.cell.loading import read_cell
from reachmap.cell.model.orientations import ConeFamily
from reachmap.geometry import approach_directions, yaw_transform
from reachmap.maps.records import Status
from reachmap.maps.summary.directions import reached_shares
from reachmap.maps.summary.statistics import causes_of, saturation_of, wilson_interval
from reachmap.plots.approach import (
    STATUS_COLOURS,
    draw_approach,
    ring_axis,
    sunburst_sectors,
)
from reachmap.plots.bin_map import (
    draw_clearance,
    draw_costs,
    draw_directions,
    draw_reachability,
)
from reachmap.plots.causes import draw_causes
from reachmap.plots.curves.saturation import draw_saturation
from reachmap.plots.parts.bin_view import percent_after
from reachmap.plots.parts.context import context_of
from reachmap.plots.parts.squares import whole_percent
from reachmap.plots.placement import draw_placement, placement_titles
from reachmap.sampling.frames import bin_test_frames
from reachmap.sampling.orientations import orientation_set
from tests.support.optional import present
from tests.support.ranking_maps import make_bin_map
from tests.support.synthetic_maps import (
    statuses,
    synthetic_bin_map,
    synthetic_placement,
    synthetic_workspace_map,
)
from tests.support.synthetic_parts import bin_with_parts

CONE = ConeFamily(tilts_deg=(0.0, 30.0), azimuths=(1, 8), rolls=3)


def test_first_and_last_panel_count_attempts() -> None:
    """Fig. 6b: after one attempt on the left, after all on the right."""
    found = np.zeros((1, 2, 3, 4, 5), bool)
    found[0, 0, 0, :2, 0] = True
    found[0, 0, 0, 2, 4] = True
    bin_map = synthetic_bin_map(found)
    figure = draw_reachability(bin_map)
    first, last = figure.axes[:2]
    assert "after 1 attempt · 8.33 % (2 of 24" in first.get_title(loc="left")
    assert "after 5 attempts · 12.50 % (3 of 24" in last.get_title(loc="left")
    place = (float(bin_map.x[0]), float(bin_map.y[0]))
    for axes, expected in ((first, "50"), (last, "75")):
        shown = {t.get_position(): t.get_text() for t in axes.texts}
        assert shown[place] == expected


def test_every_number_is_the_share_of_the_point() -> None:
    """Against a loop over points."""
    bin_map = synthetic_bin_map(0.6)
    figure = draw_reachability(bin_map)
    for attempts, axes in zip((1, 3), figure.axes, strict=False):
        shown = {t.get_position(): t.get_text() for t in axes.texts}
        for row, y in enumerate(bin_map.y):
            for column, x in enumerate(bin_map.x):
                tries = bin_map.path_found[0, row, column, :, :attempts]
                share = 100.0 * float(np.mean([any(frame) for frame in tries]))
                assert shown[float(x), float(y)] == whole_percent(share)


def test_test_grasps_that_were_not_tried_do_not_count() -> None:
    """A point where nothing was tried is a dash; elsewhere the rest counts."""
    found = np.zeros((1, 1, 2, 4, 2), bool)
    found[0, 0, 1, 0] = True
    status = statuses(found.any(axis=-1))
    status[0, 0, 0] = Status.NOT_ATTEMPTED
    status[0, 0, 1, 3] = Status.NOT_ATTEMPTED
    bin_map = synthetic_bin_map(found, status=status)
    values = percent_after(bin_map, 2)
    assert np.isnan(values[0, 0, 0])
    assert values[0, 0, 1] == pytest.approx(100.0 / 3.0)
    texts = [text.get_text() for text in draw_reachability(bin_map).axes[0].texts]
    assert {"–", "33"} <= set(texts)


def test_one_attempt_gives_one_panel() -> None:
    """There is nothing to compare it with."""
    bin_map = synthetic_bin_map(0.5, shape=(1, 3, 4, 5, 1))
    assert len(draw_reachability(bin_map).axes) == 2


def test_robot_is_where_the_pose_says() -> None:
    """The arrow points from the bin to the origin of robot_base."""
    for yaw in (0.0, 0.7, np.pi / 2, 3.0, -2.0):
        bin_map = synthetic_bin_map(0.5, bin_pose=yaw_transform(0.5, 0.1, 0.0, yaw))
        axes = draw_reachability(bin_map).axes[0]
        arrow: Any = next(p for p in axes.patches if isinstance(p, FancyArrowPatch))
        (start, end) = arrow._posA_posB
        seen = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
        robot = -bin_map.bin_pose[:2, :2].T @ bin_map.bin_pose[:2, 3]
        np.testing.assert_allclose(seen, robot / np.linalg.norm(robot), atol=1e-9)


def test_costs_are_means_over_what_was_reached() -> None:
    """First over successful attempts, then over the test grasps of a point."""
    bin_map = synthetic_bin_map(0.4, shape=(1, 3, 4, 6, 3))
    figure = draw_costs(bin_map)
    panel = next(a for a in figure.axes if "Execution" in a.get_title(loc="left"))
    shown = {t.get_position(): t.get_text() for t in panel.texts}
    for row, y in enumerate(bin_map.y):
        for column, x in enumerate(bin_map.x):
            times = bin_map.execution_time[0, row, column]
            means = [np.nanmean(t) for t in times if not np.isnan(t).all()]
            expected = f"{np.mean(means):.2f}" if means else "–"
            assert shown[float(x), float(y)] == expected


def test_cost_j_is_drawn_where_it_is_finite() -> None:
    """The fourth panel exists when the cost is given; unreachable is a dash."""
    bin_map = synthetic_bin_map(0.9)
    cost = np.full(bin_map.status.shape, np.inf)
    cost[0, 0, 0, :2] = (0.5, 1.5)
    panels = [a.get_title(loc="left") for a in draw_costs(bin_map, cost).axes]
    assert any(title.startswith("Cost J · mean 1.00") for title in panels)
    assert not any(
        "Cost J" in a.get_title(loc="left") for a in draw_costs(bin_map).axes
    )


def test_nothing_reached_still_gives_pictures() -> None:
    """An empty map is a result, and is drawn as one."""
    bin_map = synthetic_bin_map(0.0)
    titles = [a.get_title(loc="left") for a in draw_costs(bin_map).axes]
    assert any("nothing reached" in title for title in titles)
    draw_reachability(bin_map)
    draw_approach(bin_map)
    assert "0.00 % after" in draw_saturation(bin_map).texts[0].get_text()


@pytest.mark.parametrize(("hits", "total"), [(0, 10), (10, 10), (6572, 7560), (1, 3)])
def test_wilson_interval_is_that_of_scipy(hits: int, total: int) -> None:
    """The same interval from another hand."""
    low, high = wilson_interval(np.array([float(hits)]), np.array([float(total)]))
    known = binomtest(hits, total).proportion_ci(method="wilson")
    assert float(low[0]) == pytest.approx(known.low, abs=1e-12)
    assert float(high[0]) == pytest.approx(known.high, abs=1e-12)


def test_saturation_counts_what_the_first_attempts_reach() -> None:
    """The curve rises, and the roadmap's share lies at or above its end."""
    found = np.zeros((1, 1, 4, 5, 3), bool)
    found[0, 0, 0, :, 0] = True
    found[0, 0, 1, :, 1] = True
    proved = np.asarray(found.any(axis=-1))
    proved[0, 0, 2] = True
    data = saturation_of(synthetic_bin_map(found, connected=proved))
    np.testing.assert_allclose(data.share, [25.0, 50.0, 50.0])
    assert data.proved == 75.0
    assert data.total == 20
    figure = draw_saturation(synthetic_bin_map(found, connected=proved))
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert any("75.00 %" in text for text in texts)


def test_sunburst_tiles_the_disc_once() -> None:
    """Sectors do not overlap and leave no gap: their areas add up to π."""
    directions = approach_directions(orientation_set(CONE), "+z")
    sectors = sunburst_sectors(directions)
    assert len(sectors) == 27
    areas = [
        (s.outer**2 - s.inner**2) * (s.end_rad - s.start_rad) / 2.0 for s in sectors
    ]
    assert sum(areas) == pytest.approx(np.pi)
    assert sum(sector.inner == 0.0 for sector in sectors) == 3
    assert sum(sector.border for sector in sectors) == 8


@pytest.mark.parametrize("reference", ["world", "bin"])
def test_rings_of_a_leaning_bin_are_the_tilts_of_its_family(reference: str) -> None:
    """About the vertical where orientations are, about the bin's z where these are."""
    sets = [
        "bin.pose.rpy_deg=[0, -20, 90]",
        f"bin_scan.orientations.reference={reference}",
    ]
    cell = read_cell("ur5-eye-in-hand", sets).cell
    R_base_tcp = bin_test_frames(cell, cell.T_base_bin()).frames.orientations
    axes = approach_directions(R_base_tcp, cell.robot.tcp.approach_axis)
    follows_bin, R = ring_axis(cell, cell.T_base_bin())
    assert follows_bin == (reference == "bin")
    turned = axes @ cell.T_base_bin()[:3, :3] @ R
    tilts = np.degrees(np.arccos(np.clip(-turned[:, 2], -1, 1)))
    family = cell.bin_scan.orientations
    assert isinstance(family, ConeFamily)
    wanted = [ring.tilt_deg for ring in family.rings()]
    assert sorted(set(np.round(tilts, 4))) == wanted
    # The bin is tipped about its own y axis, which stays that of the picture.
    assert R[:, 1] == pytest.approx([0, 1, 0])


def test_sector_lies_on_the_side_the_tool_leans_to() -> None:
    """A tool that points towards -x leans to +x: its sector is on the right."""
    tilt = np.radians(30.0)
    azimuths = np.arange(8) * np.pi / 4
    directions = np.stack(
        [np.sin(tilt) * np.cos(azimuths), np.sin(tilt) * np.sin(azimuths),
         np.full(8, -np.cos(tilt))], axis=-1
    )  # fmt: skip
    for direction, sector in zip(directions, sunburst_sectors(directions), strict=True):
        middle = (sector.start_rad + sector.end_rad) / 2.0
        lean = -direction[:2] / np.linalg.norm(direction[:2])
        np.testing.assert_allclose([np.cos(middle), np.sin(middle)], lean, atol=1e-9)


def test_sunburst_of_arbitrary_directions_is_well_formed() -> None:
    """Lists of orientations need not be cones."""
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(17, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for sector in sunburst_sectors(directions):
        assert 0.0 <= sector.inner < sector.outer <= 1.0 + 1e-12
        assert sector.end_rad > sector.start_rad
        assert np.isfinite(sector.polygon()).all()


def test_sunburst_colours_are_the_states() -> None:
    """Each slice of each point has the colour of its test grasp."""
    bin_map = synthetic_bin_map(0.5, shape=(1, 2, 3, 6, 2))
    axes = draw_approach(bin_map).axes[0]
    bursts = [c for c in axes.collections if type(c).__name__ == "PolyCollection"]
    assert len(bursts) == 6
    for burst, status in zip(bursts, bin_map.status[0].reshape(6, 6), strict=True):
        expected = [STATUS_COLOURS[Status(int(code))].lstrip("#") for code in status]
        shown = [bytes(np.rint(c[:3] * 255).astype("u1")).hex()
                 for c in np.asarray(burst.get_facecolor())]  # fmt: skip
        assert shown == expected


def test_causes_are_counted_over_all_frames() -> None:
    """States and blocking pairs, the pair that blocks most first."""
    bin_map = synthetic_bin_map(0.5, shape=(1, 3, 4, 6, 2))
    causes = causes_of(bin_map)
    assert sum(causes.states.values()) == causes.total == 72
    assert causes.states[Status.PATH_FOUND] == int((bin_map.status == 1).sum())
    by_hand = Counter(
        bin_map.body_pairs[index]
        for index in bin_map.blocking_pair.ravel()
        if index >= 0
    )
    assert dict(causes.pairs) == dict(by_hand)
    counts = [count for _, count in causes.pairs]
    assert counts == sorted(counts, reverse=True)
    reached = 100.0 * causes.states[Status.PATH_FOUND] / 72.0
    title = draw_causes(bin_map).texts[0].get_text()
    assert title == f"{reached:.1f} % reached; causes of the rest"


def test_causes_of_a_workspace_map_cover_all_cubes() -> None:
    """Every frame of every cube counts once; the shared row is in both."""
    workspace = synthetic_workspace_map(np.full((2, 5, 3), 0.5), shared_row=2)
    assert causes_of(workspace).total == 2 * 6 * 3 * 4
    draw_causes(synthetic_workspace_map(np.ones((1, 2, 2))))


def test_titles_of_a_placement_tell_pose_and_scores() -> None:
    """Title and subtitle carry the numbers of the chosen candidate."""
    title, subtitle = placement_titles(synthetic_placement())
    assert title == "Bin at x = +0.500, y = +0.100, z = −0.050 m, yaw 86°"
    assert subtitle == (
        "score 96.5 % · worst point 70 % · runner-up 91.0 % · the paper's rule 88.2 %"
    )


def test_placement_shows_bins_where_they_would_stand() -> None:
    """The chosen bin, the runner-up and the paper's choice, to scale."""
    placement = synthetic_placement()
    figure = draw_placement(placement)
    axes = figure.axes[0]
    drawn = [p for p in axes.patches if isinstance(p, Polygon)]
    centres = np.array([p.get_xy()[:-1].mean(axis=0) for p in drawn])
    for index in (placement.chosen, placement.runner_up, placement.paper_choice):
        distance = np.linalg.norm(centres - placement.candidate_pose[index, :2], axis=1)
        assert distance.min() < 1e-9
    labels = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"runner-up", "the paper's rule", "robot base (origin)"} <= labels
    words = " ".join(text.get_text() for text in figure.texts)
    assert "+x 120 mm, −x 80 mm, +yaw 23°, −yaw 20°" in words
    assert "1 the bin collides with pedestal" in words


@pytest.mark.parametrize("near", [True, False])
def test_what_the_bin_stands_on_is_drawn_and_named_once(near: bool) -> None:
    """One entry and one outline, whether or not it is at the height of the level."""
    placement = synthetic_placement()
    body = next(
        outline
        for outline in context_of(placement.provenance).standing
        if outline.kind == "body"
    )
    T = placement.bin_pose.copy()
    T[2, 3] = body.z_high_m + (0.0 if near else 1.0)
    poses = placement.candidate_pose.copy()
    poses[0, 2] = T[2, 3]
    placement = synthetic_placement(support=body.name, bin_pose=T, candidate_pose=poses)
    figure = draw_placement(placement)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [name for name in labels if body.name in name] == [f"{body.name} (support)"]
    drawn = [
        patch
        for patch in figure.axes[0].patches
        if isinstance(patch, Polygon)
        and len(patch.get_xy()) == len(body.polygon) + 1
        and np.allclose(patch.get_xy()[:-1], body.polygon)
    ]
    assert len(drawn) == 2  # the line, and the white one under it


def test_all_that_is_written_below_a_placement_is_on_the_picture() -> None:
    """Also with every margin and as many reasons as are shown."""
    reasons = ("", *(f"the bin collides with body {k}" for k in range(6)))
    count = len(reasons)
    placement = synthetic_placement(
        runner_up=-1,
        paper_choice=-1,
        candidate_pose=np.tile([0.5, 0.1, -0.05, 1.5], (count, 1)),
        score=np.array([96.5] + [np.nan] * (count - 1)),
        worst_point=np.array([70.0] + [np.nan] * (count - 1)),
        reachable_share=np.array([96.0] + [np.nan] * (count - 1)),
        exact=np.array([1] + [0] * (count - 1), np.uint8),
        reason=reasons,
        margin={f"{sign}{name}": 0.1 for name in "xyz" for sign in "+-"}
        | {"+yaw": 0.4, "-yaw": 0.35},
    )
    figure = draw_placement(placement)
    assert "1 the bin collides with body 3" in [
        t.get_text().strip() for t in figure.texts
    ]
    for text in figure.texts:
        assert figure.bbox.y0 <= text.get_window_extent().y0
        assert text.get_window_extent().x1 <= figure.bbox.x1


def test_directions_are_drawn_beside_frames_and_points() -> None:
    """Three panels whose titles are the shares that the summary states."""
    bin_map = make_bin_map(shape=(1, 3, 4), reachable=0.2)
    shares = reached_shares(bin_map)
    titles = [axes.get_title(loc="left") for axes in draw_directions(bin_map).axes[:3]]
    expected = (shares.frames, shares.directions, shares.points)
    assert [title.rsplit(" · ")[1] for title in titles] == [
        f"{share:.2f} %" for share in expected
    ]
    assert expected[0] < expected[1] < expected[2]


def test_clearance_is_drawn_in_millimetres() -> None:
    """The narrowest and the median of each point, averaged in the titles."""
    bin_map = bin_with_parts(synthetic_bin_map(0.6, shape=(1, 2, 3, 5, 1)))
    clearance = 1e3 * present(bin_map.margins).clearance[0]
    figure = draw_clearance(bin_map)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    for name, pick in (("Narrowest", np.nanmin), ("Median", np.nanmedian)):
        (title,) = (text for text in titles if text.startswith(name))
        mean = pick(clearance, axis=-1).mean()
        assert title == f"{name} test grasp · mean {mean:.1f} mm"
