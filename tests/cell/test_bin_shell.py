"""Meshes of bins against the inner size beside them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from reachmap.cell.bins.shell import place_doubt, size_doubt, surface_heights
from reachmap.cell.loading import read_cell
from reachmap.cell.model.bin_parts import bin_parts
from reachmap.cell.model.bodies import BinSpec
from reachmap.cell.model.shapes import TriangleMesh, triangles_of
from reachmap.errors import CellError
from reachmap.tools.check import check

SIZE = BinSpec(inner=(0.3, 0.2, 0.1), wall=0.02)


def joined(parts):
    """One mesh of the parts of a bin."""
    meshes = [(triangles_of(part.shape), part.centre_m) for part in parts]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh, _ in meshes)])
    return TriangleMesh(
        vertices=np.vstack([mesh.vertices + centre for mesh, centre in meshes]),
        triangles=np.vstack(
            [m.triangles + k for (m, _), k in zip(meshes, starts, strict=False)]
        ),
    )


def moved(mesh, *shift):
    """The mesh elsewhere."""
    return TriangleMesh(vertices=mesh.vertices + shift, triangles=mesh.triangles)


def stl_text(mesh):
    """The mesh as a text STL file."""
    lines = ["solid bin"]
    for triangle in mesh.triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x} {y} {z}" for x, y, z in mesh.vertices[triangle].tolist()]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid bin"])


@pytest.fixture
def tray():
    """The bin itself as a mesh."""
    return joined(bin_parts(SIZE))


def test_heights_of_a_bin_are_those_of_its_parts(tray):
    """Bottom inside, rim on the walls, nothing outside."""
    points = np.array([(0, 0), (0.1, -0.07), (0.16, 0.05), (-0.1, 0.11), (0.2, 0)])
    wanted = [0.0, 0.0, 0.1, 0.1, -np.inf]
    np.testing.assert_allclose(surface_heights(tray, points), wanted, atol=1e-12)


def test_a_mesh_that_is_the_bin_raises_no_doubt(tray):
    """Turned by half a turn, or a few millimetres off, it still is."""
    for sign, shift in itertools.product((1, -1), (0.0, 0.003)):
        mesh = TriangleMesh(
            vertices=tray.vertices * [sign, sign, 1] + shift, triangles=tray.triangles
        )
        assert (place_doubt(SIZE, mesh), size_doubt(SIZE, mesh)) == ("", "")


def test_a_mesh_that_is_elsewhere_is_doubted(tray):
    """From a corner, from the outside of the bottom, and without a bottom."""
    corner = place_doubt(SIZE, moved(tray, 0.17, 0.12, 0.02))
    assert corner.startswith("it reaches from 0.000 to 0.340 m in x")
    raised = place_doubt(SIZE, moved(tray, 0, 0, 0.02))
    assert raised.startswith("its bottom is 20 mm above the origin")
    frame = joined(part for part in bin_parts(SIZE) if part.name != "bin bottom")
    assert place_doubt(SIZE, frame).startswith("it has no bottom at x = 0, y = 0 m")


def test_bottom_and_wall_are_told_from_the_mesh(tray):
    """What is proposed leaves no doubt."""
    thin = SIZE.model_copy(update={"wall": 0.005})
    assert size_doubt(thin, tray).endswith("bottom is 5 mm; give bottom: 0.02")
    thin = thin.model_copy(update={"bottom": 0.02})
    assert size_doubt(thin, tray).endswith("0.31 x 0.21 m; give wall: [0.02, 0.02]")
    assert not size_doubt(thin.model_copy(update={"wall": (0.02, 0.02)}), tray)


def test_a_bin_would_stand_inside_its_table(tray, tmp_path):
    """A warning where nothing depends on it, a mistake with `on`."""
    (tmp_path / "tray.stl").write_text(stl_text(tray))
    spec = f"{{file: {tmp_path / 'tray.stl'}}}"
    sets = [
        f"bin.mesh={spec}",
        "bin.inner=[0.3, 0.2, 0.1]",
        "bin.carrier=null",
        "bin.wall=0.005",
        "bin.bottom=null",
    ]
    found = check("ur10-deep-container", sets)
    assert any("tray.stl: it reaches 20 mm below" in line for line in found.warnings)
    (row,) = (body for body in found.bodies if body.name == "bin")
    assert row.shape == "inside 0.3 × 0.2 × 0.1 m, mesh tray.stl"
    with pytest.raises(CellError, match=r"bin\.on: mesh tray\.stl: it reaches 20 mm"):
        read_cell("ur10-deep-container", [*sets, "bin.on=table"])
    sets[-2:] = ["bin.wall=0.02", "bin.on=table"]
    loaded = read_cell("ur10-deep-container", sets)
    assert not any("tray.stl" in line for line in loaded.warnings)
    assert loaded.cell.T_base_bin()[2, 3] == pytest.approx(-0.45 + 0.02)
