"""Heat maps show the map's numbers, at the right places, under the right titles."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from reachmap.maps.records import Status, WorkspaceMap
from reachmap.maps.summary.statistics import best_level, level_means
from reachmap.plots.heatmap import best_frames, draw_level
from reachmap.plots.overview import draw_overview
from reachmap.plots.parts.levels import (
    QUANTITIES,
    Quantity,
    best_patch,
    best_square,
    level_names,
    quantity_values,
)
from reachmap.plots.parts.squares import (
    cell_edges,
    number_size,
    signed_text,
    whole_percent,
)
from reachmap.plots.parts.stack import level_subtitle, level_title, stack_of
from tests.support.synthetic_maps import (
    frames_from_fraction,
    statuses,
    synthetic_workspace_map,
)

RED, GREEN, GREY = (165, 0, 38), (0, 104, 55), (211, 211, 211)


def random_map(shape: tuple[int, int, int] = (3, 5, 4), seed: int = 3) -> WorkspaceMap:
    """A map of random shares, with a frame of each point that was not attempted."""
    rng = np.random.default_rng(seed)
    return synthetic_workspace_map(rng.random(shape), orientations=27)


def numbers(axes: Axes) -> dict[tuple[float, float], str]:
    """Texts of the squares by their place."""
    return {text.get_position(): text.get_text() for text in axes.texts}


def pixel(figure: Figure, axes: Axes, x: float, y: float) -> tuple[int, ...]:
    """Colour in the corner of the square at (x, y), away from its number."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())
    column, row = axes.transData.transform((x, y))
    return tuple(int(v) for v in image[image.shape[0] - 1 - int(row), int(column), :3])


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_numbers_are_those_of_the_map(quantity: Quantity) -> None:
    """Each square carries its own whole percent."""
    workspace = random_map()
    stack = stack_of(workspace, quantity)
    values = quantity_values(workspace, quantity)
    shown = numbers(draw_level(stack, 1).axes[0])
    assert len(shown) == values[1].size
    for (row, y), (column, x) in itertools.product(
        enumerate(workspace.y), enumerate(workspace.x)
    ):
        assert abs(int(shown[float(x), float(y)]) - values[1, row, column]) < 1.0


@pytest.mark.parametrize("corner", [(0, 0), (0, -1), (-1, 0), (-1, -1)])
def test_a_marked_corner_is_drawn_at_that_corner(corner: tuple[int, int]) -> None:
    """Rows go up with y and columns right with x: nothing is flipped or transposed."""
    shares = np.zeros((1, 4, 6))
    shares[0][corner] = 1.0
    workspace = synthetic_workspace_map(shares)
    figure = draw_level(stack_of(workspace, "path"), 0)
    axes = figure.axes[0]
    y, x = workspace.y[corner[0]], workspace.x[corner[1]]
    for row, column in itertools.product((0, -1), (0, -1)):
        place = workspace.x[column] - 0.035, workspace.y[row] - 0.035
        expected = GREEN if (row, column) == corner else RED
        assert pixel(figure, axes, *place) == expected
    # On the page as well: right of the middle for the last column, above it for the
    # last row.
    canvas_x, canvas_y = axes.transData.transform((x, y))
    box = axes.get_window_extent()
    assert (canvas_x > (box.x0 + box.x1) / 2) == (corner[1] == -1)
    assert (canvas_y > (box.y0 + box.y1) / 2) == (corner[0] == -1)


def test_not_attempted_is_a_dash_on_grey_and_not_zero() -> None:
    """What nobody tried looks different from what cannot be reached."""
    status = statuses(frames_from_fraction(np.zeros((1, 3, 3)), 4))
    status[0, 1, 1] = Status.NOT_ATTEMPTED
    workspace = synthetic_workspace_map(np.zeros((1, 3, 3)), status=status)
    figure = draw_level(stack_of(workspace, "path"), 0)
    axes = figure.axes[0]
    shown = numbers(axes)
    x, y = float(workspace.x[1]), float(workspace.y[1])
    assert shown.pop((x, y)) == "–"
    assert set(shown.values()) == {"0"}
    assert pixel(figure, axes, x - 0.035, y - 0.035) == GREY
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "– not attempted" in labels


def test_title_tells_height_quantity_and_mean() -> None:
    """The mean is over the squares that were attempted."""
    shares = np.array([[[0.0, 0.5], [1.0, 1.0]]])
    status = statuses(frames_from_fraction(shares, 4))
    status[0, 0, 0] = Status.NOT_ATTEMPTED
    workspace = synthetic_workspace_map(shares, status=status, z=np.array([-0.3]))
    stack = stack_of(workspace, "path")
    title = "z = −0.30 m · path reachability · mean 83.3 %"
    assert level_title(stack, 0) == title
    assert draw_level(stack, 0).texts[0].get_text() == title


def test_subtitle_names_the_best_level() -> None:
    """On the best level, and on the others."""
    shares = np.stack([np.full((3, 3), share) for share in (0.25, 0.75, 0.5)])
    stack = stack_of(synthetic_workspace_map(shares), "path")
    assert best_level(stack.values) == 1
    assert level_subtitle(stack, 1).startswith("this is the best level of 3")
    assert level_subtitle(stack, 2).startswith("best level: z = +0.10 m, 75.0 %")


def test_nothing_attempted_is_said() -> None:
    """A map without a single attempt still gives pictures."""
    status = np.zeros((2, 3, 3, 4), np.uint8)
    workspace = synthetic_workspace_map(np.zeros((2, 3, 3)), status=status)
    for quantity in ("path", "difference"):
        stack = stack_of(workspace, quantity)
        assert best_level(stack.values) is None
        assert level_title(stack, 0).endswith("not attempted")
        assert "nothing attempted" in level_subtitle(stack, 0)
        draw_level(stack, 0)
        draw_overview(stack)


def test_scale_is_fixed_whatever_the_map_holds() -> None:
    """0 to 100 in every picture, so that pictures compare."""
    workspace = synthetic_workspace_map(np.full((1, 3, 3), 0.5), orientations=10)
    figure = draw_level(stack_of(workspace, "path"), 0)
    mesh = figure.axes[0].collections[0]
    assert (mesh.norm.vmin, mesh.norm.vmax) == (0.0, 100.0)
    assert figure.axes[1].get_ylim() == (0.0, 100.0)


def test_axes_are_to_scale() -> None:
    """One metre is as long along x as along y, in metres and to the edges."""
    workspace = random_map((1, 3, 7))
    axes = draw_level(stack_of(workspace, "path"), 0).axes[0]
    (x0, y0), (x1, y1) = axes.transData.transform([(0.2, -0.2), (0.3, -0.1)])
    assert x1 - x0 == pytest.approx(y1 - y0, rel=1e-9)
    assert axes.get_xlabel() == "x in robot_base [m]"
    assert axes.get_ylabel() == "y in robot_base [m]"
    assert axes.get_xlim()[1] >= workspace.x[-1] + 0.05 - 1e-9


def test_base_pedestal_and_bin_are_drawn_and_named() -> None:
    """Things of the cell near the level, and not those far from it."""
    workspace = synthetic_workspace_map(np.full((2, 5, 6), 0.5), z=np.array([0.0, 0.6]))
    low, high = (
        [t.get_text() for t in draw_level(stack_of(workspace, "path"), level)
         .legends[0].get_texts()]
        for level in (0, 1)
    )  # fmt: skip
    assert {"robot base (origin)", "pedestal", "bin"} <= set(low)
    assert "robot base (origin)" in high
    assert not {"pedestal", "bin"} & set(high)


def test_best_square_and_patch_are_those_of_a_search() -> None:
    """Against loops over all places; equal values are decided by the surroundings."""
    rng = np.random.default_rng(5)
    for _ in range(30):
        level = rng.integers(0, 28, (7, 6)) / 27.0 * 100.0
        level[rng.random(level.shape) < 0.05] = np.nan
        row, column = best_patch(level, (3, 3))
        means = [
            level[i : i + 3, j : j + 3].mean()
            for i in range(5)
            for j in range(4)
            if not np.isnan(level[i : i + 3, j : j + 3]).any()
        ]
        if means:
            chosen = level[row : row + 3, column : column + 3].mean()
            assert chosen == pytest.approx(max(means))
        assert level[best_square(level)] == np.nanmax(level)


def test_a_full_square_in_a_dense_patch_beats_one_at_the_rim() -> None:
    """The paper centres the bin on a 100 % square inside the densest patch."""
    level = np.full((7, 7), 20.0)
    level[0, 0] = 100.0
    level[3:6, 3:6] = 90.0
    level[4, 4] = 100.0
    assert best_square(level) == (4, 4)
    assert best_patch(level, (3, 3)) == (3, 3)


def test_marks_are_on_the_best_level_only() -> None:
    """Frames of the best square and patch, with their values in the legend."""
    shares = np.zeros((2, 5, 5))
    shares[1, 1:4, 1:4] = 1.0
    stack = stack_of(synthetic_workspace_map(shares), "path")
    square, patch = best_frames(stack, 1)
    assert (square.row, square.column) == (2, 2)
    assert patch.label.startswith("best 3×3 patch")
    texts = [
        [t.get_text() for t in draw_level(stack, level).legends[0].get_texts()]
        for level in (0, 1)
    ]
    assert not any("best" in text for text in texts[0])
    assert any("best square, 100 %" in text for text in texts[1])


def test_overview_has_a_panel_for_each_level_and_the_means() -> None:
    """Titles carry height and mean; the curve goes through the means."""
    workspace = random_map((5, 4, 4))
    stack = stack_of(workspace, "path")
    figure = draw_overview(stack)
    means = level_means(stack.values)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    for name, mean in zip(level_names(workspace.z), means, strict=True):
        assert any(title.startswith(f"z = {name} m · {mean:.1f} %") for title in titles)
    assert sum("best" in title for title in titles) == 1
    curve = next(a for a in figure.axes if a.get_title(loc="left") == "mean over z")
    np.testing.assert_allclose(np.asarray(curve.lines[0].get_xdata(), float), means)
    np.testing.assert_allclose(
        np.asarray(curve.lines[0].get_ydata(), float), workspace.z
    )


def test_whole_percent_keeps_0_and_100_for_none_and_all() -> None:
    """99.7 % is not everything and 0.2 % is not nothing."""
    given = [0.0, 0.2, 1.4, 53.53, 99.4, 99.7, 100.0, float("nan")]
    expected = ["0", "1", "1", "54", "99", "99", "100", "–"]
    assert [whole_percent(value) for value in given] == expected
    assert [signed_text(v) for v in (12.4, -3.6, 0.2)] == ["+12", "−4", "0"]


def test_level_names_tell_levels_apart() -> None:
    """No minus zero, and as many digits as it takes."""
    assert level_names(np.array([-1e-17, 0.1])) == ("+0.00", "+0.10")
    assert level_names(np.array([0.001, 0.002])) == ("+0.001", "+0.002")


def test_squares_of_uneven_lattices_meet() -> None:
    """Edges lie midway between centres."""
    edges = cell_edges(np.array([0.0, 0.1, 0.3]))
    np.testing.assert_allclose(edges, [-0.05, 0.05, 0.2, 0.4])


def test_numbers_too_small_to_read_are_left_out() -> None:
    """A lattice of 1 cm on a page would be a grey carpet of digits."""
    fine = np.arange(0.0, 1.0, 0.01)
    coarse = np.arange(0.0, 1.0, 0.1)
    assert number_size(fine, fine, 7.0) == 0.0
    assert number_size(coarse, coarse, 7.0) > 8.0
    workspace = synthetic_workspace_map(
        np.full((1, 100, 100), 0.5), x=fine, y=fine, orientations=1
    )
    assert not draw_level(stack_of(workspace, "path"), 0).axes[0].texts


def test_text_of_legend_and_titles_stays_on_the_page() -> None:
    """Nothing is cut off, whatever the shape of the lattice."""
    for shape in ((2, 1, 9), (1, 9, 1)):
        for quantity in ("ik-free", "difference"):
            stack = stack_of(random_map(shape), quantity)
            for figure in (draw_level(stack, 0), draw_overview(stack)):
                figure.draw_without_rendering()
                page = figure.bbox
                texts = [*figure.texts, *figure.legends[0].get_texts()]
                for text in texts:
                    box = text.get_window_extent()
                    assert box.x0 >= page.x0, text
                    assert box.x1 <= page.x1, text
                    assert box.y0 >= page.y0, text
                    assert box.y1 <= page.y1, text
