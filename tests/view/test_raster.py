"""The picture without a graphics engine."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from reachmap.cell.loading import read_cell
from reachmap.cell.model.fields import Shape, SphereShape
from reachmap.cell.model.shapes import triangles_of
from reachmap.core.collision.solids import SolidCell
from reachmap.plots.cell.cell_view import draw_cell
from reachmap.plots.cell.raster import (
    Facets,
    Window,
    facets_of,
    join,
    render,
    view_axes,
    visible_area,
)
from reachmap.plots.parts.style import figure_bytes

RED, BLUE = np.array([0.9, 0.1, 0.1]), np.array([0.1, 0.1, 0.9])
TOP = Window(axes=view_axes(-90.0, 90.0), low=np.full(2, -1.0), high=np.full(2, 1.0))


def surface(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a shape."""
    mesh = triangles_of(shape)
    return mesh.vertices, mesh.triangles


def box(x: float, z: float, side: float, rgb: np.ndarray, owner: int) -> Facets:
    """A cube above the point (x, 0)."""
    T = np.eye(4)
    T[:3, 3] = x, 0.0, z
    return facets_of(*surface(Shape(box=(side,) * 3)), T, rgb, owner)


def test_axes_are_right_handed_and_show_x_to_the_right() -> None:
    """From above x runs to the right and y up; from the front z is up."""
    assert view_axes(-90.0, 90.0) == pytest.approx(np.eye(3), abs=1e-12)
    side = view_axes(-90.0, 0.0)
    assert side[0] == pytest.approx([1, 0, 0], abs=1e-12)
    assert side[1] == pytest.approx([0, 0, 1], abs=1e-12)
    for azimuth in (-140.0, 10.0, 75.0):
        assert np.linalg.det(view_axes(azimuth, 30.0)) == pytest.approx(1.0)


def test_the_nearer_body_hides_the_other() -> None:
    """Whatever the order in which they are drawn."""
    low, high = box(0.0, 0.0, 0.8, RED, 0), box(0.0, 1.0, 0.4, BLUE, 1)
    for parts in ((low, high), (high, low)):
        image = render(join(parts), TOP, 50.0)
        assert image[50, 50, 2] > 2 * image[50, 50, 0]
        assert image[50, 35, 0] > 2 * image[50, 35, 2]


def test_area_is_to_scale() -> None:
    """Pixels seen of a square are its area, and those behind it are not seen."""
    facets = join([box(0.5, 0.0, 0.6, RED, 0), box(-0.5, 0.0, 0.2, BLUE, 1)])
    area = visible_area(facets, TOP, 100.0) / 100.0**2
    assert area == pytest.approx([0.36, 0.04], rel=0.03)


def test_small_and_large_facets_agree() -> None:
    """A ball of many small triangles has the outline of a disc."""
    ball = facets_of(*surface(Shape(sphere=SphereShape(radius=0.7))), np.eye(4), RED, 0)
    area = visible_area(ball, TOP, 80.0)[0] / 80.0**2
    assert area == pytest.approx(np.pi * 0.49, rel=0.02)


def test_round_surfaces_are_smooth_and_edges_sharp() -> None:
    """Normals of a ball are radial; those of a box are those of its faces."""
    ball = facets_of(*surface(Shape(sphere=SphereShape(radius=0.7))), np.eye(4), RED, 0)
    radial = ball.corners / np.linalg.norm(ball.corners, axis=-1, keepdims=True)
    assert (radial * ball.normals).sum(axis=-1).min() > 0.98
    cube = box(0.0, 0.0, 1.0, RED, 0)
    assert np.abs(cube.normals).max(axis=-1) == pytest.approx(1.0)


def test_nothing_is_drawn_where_nothing_is() -> None:
    """The background stays transparent, and equal solids give equal pixels."""
    facets = box(0.0, 0.0, 0.4, RED, 0)
    image = render(facets, TOP, 40.0)
    assert image[0, 0, 3] == 0.0
    assert image[40, 40, 3] == 1.0
    assert (image == render(facets, TOP, 40.0)).all()


def test_a_cell_is_drawn_in_three_views(monkeypatch: pytest.MonkeyPatch) -> None:
    """Axes are in metres, and equal cells give equal bytes."""
    monkeypatch.setattr("reachmap.plots.parts.style.DPI", 40)
    monkeypatch.setattr("reachmap.plots.cell.cell_view.PIXELS_PER_IN", 20.0)
    cell = SolidCell.build(read_cell("planar-toy"))
    figure = draw_cell(cell)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["", "z [m]", "y [m]"]

    def data(drawn: Figure) -> bytes:
        return figure_bytes(drawn, "png", title="", config_sha256="")

    assert data(figure) == data(draw_cell(cell))
