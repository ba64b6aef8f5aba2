"""How maps show themselves in a session: short, as a table, a picture, a tree."""

from __future__ import annotations

import dataclasses
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from reachmap import read_map, robust, study
from reachmap.errors import SettingsError
from reachmap.maps import write_bin_map, write_workspace_map
from reachmap.robustness.errors import Errors, ErrorSize
from tests.support.ranking_maps import make_bin_map
from tests.support.toy_artefacts import toy_bin_map, toy_workspace


def test_reprs_are_short_and_name_what_it_is() -> None:
    """Half a megabyte of numbers helps nobody."""
    for record in (toy_bin_map(), toy_workspace(), make_bin_map()):
        text = repr(record)
        assert len(text) < 400
        assert text.startswith(f"<{type(record).__name__}: ")
        assert "path reachability" in text
        page = record._repr_html_()
        assert page.count("<tr>") >= 4
        assert "<script" not in page


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Files of what is found out about a small cell."""
    folder = tmp_path_factory.mktemp("results")
    write_bin_map(folder / "bin.h5", toy_bin_map())
    robust(
        folder / "bin.h5",
        folder / "robustness.h5",
        errors=Errors(bin=ErrorSize(shift_m=0.005)),
        samples=2,
    )
    study(
        "planar-toy",
        folder / "study.h5",
        vary=["bin.pose.xyz.0=0.15,0.2"],
        overrides=["bin_scan.grid=[2,1]", "bin_scan.repeats=1"],
        objectives=["points"],
    )
    return [folder / "robustness.h5", folder / "study.h5"]


def test_results_show_themselves_like_maps(results: list[Path]) -> None:
    """In a line, as a table, as a picture, and as the tree of their file."""
    for path in results:
        record = read_map(path)
        assert len(repr(record)) < 400
        assert record._repr_html_().count("<tr>") >= 3
        assert record.plot()._repr_png_().startswith(b"\x89PNG")
        with xr.open_datatree(path) as stored:
            made = record.to_xarray()
            assert set(made.groups) == set(stored.groups)
            assert set(made["/"].variables) == set(stored["/"].variables)


def test_records_are_equal_where_all_of_them_is(results: list[Path]) -> None:
    """NaN included; a single number that differs makes them differ."""
    maps = [toy_bin_map(), toy_workspace(), make_bin_map(), *map(read_map, results)]
    for k, record in enumerate(maps):
        assert record == pickle.loads(pickle.dumps(record))
        assert record in maps
        assert [record == other for other in maps].index(True) == k
        assert record != dataclasses.replace(
            record, stamp=dataclasses.replace(record.stamp, seed=12345)
        )
    bin_map = toy_bin_map()
    lengths = bin_map.path_length.copy()
    lengths.flat[np.flatnonzero(np.isfinite(lengths))[0]] += 1e-9
    assert bin_map != dataclasses.replace(bin_map, path_length=lengths)


def test_names_are_escaped_in_html() -> None:
    """Joint names come from files."""
    odd = make_bin_map(joint_names=tuple(f"<b>{k}" for k in range(6)))
    assert "<b>0" not in odd._repr_html_()


def _dataset(tree: xr.DataTree, group: str) -> xr.Dataset:
    node = tree[group]
    assert isinstance(node, xr.DataTree)
    return node.to_dataset(inherit=False)


def test_a_map_in_memory_is_the_tree_of_its_file(tmp_path: Path) -> None:
    """Every group, variable, dimension and value that xarray reads from the file."""
    bin_map, workspace = toy_bin_map(), toy_workspace()
    write_bin_map(tmp_path / "bin.h5", bin_map)
    write_workspace_map(tmp_path / "workspace.h5", workspace)
    for record, name in ((bin_map, "bin.h5"), (workspace, "workspace.h5")):
        with xr.open_datatree(tmp_path / name) as stored:
            made = record.to_xarray()
            assert set(made.groups) == set(stored.groups)
            for group in stored.groups:
                one, other = (_dataset(tree, group) for tree in (made, stored))
                assert set(one.variables) == set(other.variables)
                for variable, value in other.variables.items():
                    assert one[variable].dims == value.dims
                    np.testing.assert_array_equal(one[variable].values, value.values)
    goals = bin_map.to_xarray()["/goal_configuration"]
    assert goals.sel(joint=bin_map.joint_names[1]).shape == goals.shape[:-1]


def test_plots_are_pictures_that_notebooks_show(tmp_path: Path) -> None:
    """The album of `reachmap heatmap`, by name."""
    drawn = toy_bin_map().plot()
    assert drawn._repr_png_().startswith(b"\x89PNG")
    path = toy_workspace().plot("causes").save(tmp_path / "causes.svg")
    assert path.read_text().startswith("<?xml")
    layers = make_bin_map(shape=(2, 3, 3)).plot()
    assert layers._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(SettingsError, match=r"no picture 'x'; there are .*bin_costs"):
        toy_bin_map().plot("x")


def test_a_stored_path_by_its_row() -> None:
    """From the scan configuration, counted from either end."""
    record = toy_bin_map()
    for row in (0, -1):
        np.testing.assert_allclose(record.path(row)[0], record.scan_configuration)
    np.testing.assert_array_equal(record.path(-1), record.path(len(record.paths) - 1))
    with pytest.raises(IndexError, match="there are"):
        record.path(len(record.paths))


def test_looking_at_a_map_loads_no_plots(tmp_path: Path) -> None:
    """A repr must not cost seconds."""
    write_bin_map(tmp_path / "bin.h5", toy_bin_map())
    code = (
        "import sys, reachmap\n"
        f"repr(reachmap.read_map({str(tmp_path / 'bin.h5')!r}))\n"
        "print('matplotlib' in sys.modules, 'pinocchio' in sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    assert done.stdout.split() == ["False", "False"]
