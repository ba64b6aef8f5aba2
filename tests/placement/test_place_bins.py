"""`reachmap place-bin` for several bins of one cell, on the planar arm."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

from reachmap.cell.loading import read_cell
from reachmap.cli import group
from reachmap.geometry import inverse_transform
from reachmap.maps import read_bin_map, read_placement
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.robustness.format import read_robustness
from reachmap.plots.causes import draw_causes
from reachmap.plots.curves.robustness import draw_robustness
from reachmap.plots.placement import draw_placement
from reachmap.robustness.errors import Errors, ErrorSize
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.info import info
from reachmap.tools.robust import robust
from reachmap.tools.workspace_scan import workspace_scan

SPEC = "{inner: [0.2, 0.12, 0.04], wall: 0.01, pose: {xyz: [%s, 0.35, -0.2]}}"
CUBE = (
    'workspace_scan.cubes=[{"name":"all","min":[-0.6,-0.6,0],"max":[0.6,0.6,0],'
    '"grid":[7,7]}]'
)
# In one level the bins cannot stand above each other.
WHERE = (
    *("--fix", "z=-0.2", "--region", "-0.5", "0.5", "0.1", "0.6", "--top", "2"),
    *("--tolerance", "0.01", "2", "-j", "1", "--no-progress"),
)


def run(*arguments):
    """Run a command in this process."""
    return CliRunner().invoke(group, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A workspace map of the planar arm with two bins, which were placed."""
    folder = tmp_path_factory.mktemp("two")
    text = read_cell("planar-toy").text
    head, rest = text.split("\nbin:\n")
    bins = f"bins:\n  a: {SPEC % 0.25}\n  b: {SPEC % -0.25}"
    cell = folder / "cell.yaml"
    urdf = read_cell("planar-toy").resolve("planar-toy/planar_arm.urdf")
    head = head.replace("planar-toy/planar_arm.urdf", str(urdf))
    body = rest.split("\nscan_configuration:")[1]
    cell.write_text(f"{head}\n{bins}\nscan_configuration:{body}")
    workspace_scan(
        str(cell), folder / "workspace.h5", overrides=[CUBE, "bin_scan.grid=[3,2]"]
    )
    out = folder / "placement.h5"
    said = run("place-bin", folder / "workspace.h5", "-o", out, "--json", *WHERE)
    assert said.exit_code == 0, said.stderr
    (folder / "facts.json").write_text(said.stdout)
    return folder


def corners(spec, T_base_bin):
    """Outer corners of a bin from above, (4, 2)."""
    half = np.array(spec.inner[:2]) / 2 + spec.walls
    square = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return square @ T_base_bin[:2, :2].T + T_base_bin[:2, 3]


def are_apart(first, second):
    """Whether an edge of one of two rectangles separates them."""
    for polygon in (first, second):
        for k in range(4):
            edge = polygon[(k + 1) % 4] - polygon[k]
            out = np.array([edge[1], -edge[0]])
            if (first @ out).max() <= (second @ out).min() + 1e-9:
                return True
            if (second @ out).max() <= (first @ out).min() + 1e-9:
                return True
    return False


def test_each_bin_has_a_place_beside_the_other(folder):
    """Both files hold both bins at the same places, and these do not overlap."""
    facts = json.loads((folder / "facts.json").read_text())["bins"]
    poses = {}
    for name, other in (("a", "b"), ("b", "a")):
        path = folder / f"placement-{name}.h5"
        assert facts[name]["output"] == str(path)
        placement = read_placement(path)
        cell = cell_of_artefact(placement.provenance, str(path)).cell
        assert (cell.bin.name, [*cell.bins]) == (name, [other])
        np.testing.assert_allclose(cell.T_base_bin(), placement.bin_pose, atol=1e-9)
        poses[name] = {name: cell.T_base_bin(), other: cell.T_base_of(cell.bins[other])}
        assert facts[name]["chosen"]["score_percent"] > 50
    for name in ("a", "b"):
        np.testing.assert_allclose(poses["a"][name], poses["b"][name], atol=1e-9)
    assert are_apart(*(corners(cell.bin, poses["a"][name]) for name in ("a", "b")))


def test_what_is_said_of_a_placement_names_its_bin(folder):
    """In `info` and in the title of the picture; a workspace map is of no bin."""
    for name in ("a", "b"):
        path = folder / f"placement-{name}.h5"
        assert info(path).facts()["bin"] == name
        assert re.search(rf"^  bin +{name}$", run("info", path).stdout, re.MULTILINE)
        figure = draw_placement(read_placement(path))
        titles = [text.get_text() for text in figure.texts]
        assert any(text.endswith(f"planar-toy, bin {name}") for text in titles)
    assert info(folder / "workspace.h5").facts()["bin"] is None


def test_what_is_said_of_a_map_and_its_robustness_names_the_bin(folder, tmp_path):
    """In `info`, and in the titles of what is in the way and what errors cost."""
    bin_scan(folder / "placement-b.h5", tmp_path / "bin.h5")
    errors = Errors(bin=ErrorSize(shift_m=0.002))
    robust(tmp_path / "bin.h5", tmp_path / "robust.h5", errors=errors, samples=2)
    causes = draw_causes(read_bin_map(tmp_path / "bin.h5"))
    curve = draw_robustness(read_robustness(tmp_path / "robust.h5"))
    for name in ("bin.h5", "robust.h5"):
        assert info(tmp_path / name).facts()["bin"] == "b"
    for figure in (causes, curve):
        titles = [text.get_text() for text in figure.texts]
        assert any(text.endswith("planar-toy, bin b") for text in titles)


def test_a_bin_by_name_is_placed_where_the_other_stands(folder, tmp_path):
    """`--bin b` leaves a where the cell has it."""
    out = tmp_path / "b.h5"
    said = run("place-bin", folder / "workspace.h5", "--bin", "b", "-o", out, *WHERE)
    assert said.exit_code == 0, said.stderr
    cell = cell_of_artefact(read_placement(out).provenance, str(out)).cell
    T_base_a = cell.T_base_of(cell.bins["a"])
    assert T_base_a[0, 3] == pytest.approx(0.25)
    assert are_apart(
        corners(cell.bin, cell.T_base_bin()), corners(cell.bins["a"], T_base_a)
    )


def test_each_bin_has_a_map(folder, tmp_path):
    """A placement is scanned for its own bin; `--bin` takes the other one."""
    maps = {}
    for name in ("a", "b"):
        out = tmp_path / f"{name}.h5"
        words = ("--bin", name, "-o", out, "-j", "1", "--no-progress")
        said = run("bin-scan", folder / "placement-a.h5", *words)
        assert said.exit_code == 0, said.stderr
        maps[name] = read_bin_map(out)
    for name, record in maps.items():
        placed = read_placement(folder / f"placement-{name}.h5").bin_pose
        np.testing.assert_allclose(record.bin_pose, placed, atol=1e-9)
    T = inverse_transform(maps["a"].bin_pose) @ maps["b"].bin_pose
    assert np.linalg.norm(T[:2, 3]) > 0.12


def test_what_is_one_bins_needs_its_name(folder, tmp_path):
    """A pose for two bins, and a bin that is not there."""
    out = tmp_path / "p.h5"
    words = (folder / "workspace.h5", "-o", out, "--bin-pose", 0, 0.3, -0.2, 0)
    said = run("place-bin", *words)
    assert said.exit_code == 2
    assert "name it (--bin NAME)" in said.stderr
    said = run("place-bin", folder / "workspace.h5", "-o", out, "--bin", "c")
    assert said.exit_code == 2
    assert said.stderr == "reachmap: --bin c: pick_from: no bin 'c'; known: a, b\n"
    said = run("place-bin", folder / "workspace.h5", "-o", ".")
    assert said.exit_code == 2
    assert said.stderr == "reachmap: .: is a folder; name a file\n"
    one = ("--set", "pick_from=a")
    said = run("place-bin", folder / "workspace.h5", "-o", out, *one)
    assert said.exit_code == 2
    assert "every bin is placed; --bin NAME places one" in said.stderr
    assert not list(tmp_path.iterdir())
