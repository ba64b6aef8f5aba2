"""The files as other programs see them: h5py, xarray, NeXus viewers."""

import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

from reachmap.maps import write_bin_map, write_placement, write_workspace_map
from reachmap.maps.bytes.hdf5 import chunk_shape
from tests.support.synthetic_maps import (
    JOINTS,
    synthetic_bin_map,
    synthetic_placement,
    synthetic_workspace_map,
)
from tests.support.synthetic_parts import (
    bin_with_parts,
    placement_with_parts,
    workspace_with_parts,
)

FRAME = ("cube_z", "cube_y", "cube_x", "orientation")
GRASP = ("layer", "y", "x", "orientation")
CUBE = {
    "status": (FRAME, "u1", "1"),
    "blocking_pair": (FRAME, "i4", "1"),
    "n_ik": (FRAME, "u1", "1"),
    "n_ik_free": (FRAME, "u1", "1"),
    "attempts": (FRAME, "u1", "1"),
    "paths_found": (FRAME, "u1", "1"),
    "path_length": (FRAME, "f8", "rad"),
    "goal_configuration": ((*FRAME, "joint"), "f8", "rad"),
    "quaternion_wxyz": (("orientation", "quat"), "f8", "1"),
    **{
        f"{prefix}{axis}": ((f"{prefix}{axis}",), "f8", "m")
        for axis in "xyz"
        for prefix in ("", "cube_")
    },
}
# The contract between the stages, written out once more by hand.
CONTRACT = {
    "workspace": {
        "x": (("x",), "f8", "m"),
        "y": (("y",), "f8", "m"),
        "z": (("z",), "f8", "m"),
        "path_reachability": (("z", "y", "x"), "f8", "percent"),
        "ik_reachability": (("z", "y", "x"), "f8", "percent"),
        "ik_free_reachability": (("z", "y", "x"), "f8", "percent"),
        "scan_configuration": (("joint",), "f8", "rad"),
        **{f"cubes/right/{name}": row for name, row in CUBE.items()},
        **{f"cubes/left/{name}": row for name, row in CUBE.items()},
    },
    "bin": {
        "layer": (("layer",), "f8", "m"),
        "y": (("y",), "f8", "m"),
        "x": (("x",), "f8", "m"),
        "orientation": (("orientation",), "i4", "1"),
        "repeat": (("repeat",), "i4", "1"),
        "bin_pose": (("pose_row", "pose_column"), "f8", "m"),
        "position": (("layer", "y", "x", "xyz"), "f8", "m"),
        "quaternion_wxyz": ((*GRASP, "quat"), "f8", "1"),
        "status": (GRASP, "u1", "1"),
        "blocking_pair": (GRASP, "i4", "1"),
        "path_found": ((*GRASP, "repeat"), "u1", "1"),
        "path_length": ((*GRASP, "repeat"), "f8", "rad"),
        "tcp_path_length": ((*GRASP, "repeat"), "f8", "m"),
        "planning_time": ((*GRASP, "repeat"), "f8", "s"),
        "planning_cpu_time": ((*GRASP, "repeat"), "f8", "s"),
        "execution_time": ((*GRASP, "repeat"), "f8", "s"),
        "goal_configuration": ((*GRASP, "joint"), "f8", "rad"),
        "path_reachability": (("layer", "y", "x"), "f8", "percent"),
        "paths/configuration": (("point", "joint"), "f8", "rad"),
        "paths/row_size": (("path",), "i4", "1"),
        "paths/planned_size": (("path",), "i4", "1"),
        "paths/index": (("path", "index_column"), "i4", "1"),
    },
    "placement": {
        "bin_pose": (("pose_row", "pose_column"), "f8", "m"),
        "scan_configuration": (("joint",), "f8", "rad"),
        "score": (("candidate",), "f8", "percent"),
    },
}
ROOT = {
    "Conventions", "format", "format_version", "title", "NX_class", "signal", "axes",
    "seed", "cell_sha256", "config_sha256", "content_sha256",
}  # fmt: skip
FLAGS = (
    "not_attempted path_found no_ik ik_in_collision no_path_found error "
    "approach_blocked"
)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One file of each kind."""
    folder = tmp_path_factory.mktemp("files")
    paths = {name: folder / f"{name}.h5" for name in CONTRACT}
    fractions = np.random.default_rng(0).random((2, 5, 4))
    workspace = synthetic_workspace_map(fractions, shared_row=2)
    write_workspace_map(paths["workspace"], workspace_with_parts(workspace))
    write_bin_map(paths["bin"], bin_with_parts(synthetic_bin_map()))
    write_placement(paths["placement"], placement_with_parts(synthetic_placement()))
    return paths


def dims_of(dataset: h5py.Dataset) -> tuple[str, ...]:
    """Names of the dimension scales of a dataset."""
    if dataset.is_scale:
        return (dataset.name.rpartition("/")[2],)
    return tuple(dim[0].name.rpartition("/")[2] for dim in dataset.dims)


@pytest.mark.parametrize("kind", CONTRACT)
def test_every_variable_of_the_contract_is_there(
    files: dict[str, Path], kind: str
) -> None:
    """Name, dimensions, type and unit, variable by variable."""
    with h5py.File(files[kind]) as file:
        for path, (dims, dtype, units) in CONTRACT[kind].items():
            found = file[path]
            row = (dims_of(found), found.dtype.str[1:], found.attrs["units"])
            assert row == (dims, dtype, units), path


@pytest.mark.parametrize("kind", CONTRACT)
def test_root_attributes_and_provenance_are_there(
    files: dict[str, Path], kind: str
) -> None:
    """What every artefact says of itself, and of where it comes from."""
    with h5py.File(files[kind]) as file:
        assert set(file.attrs) >= ROOT
        assert file.attrs["format_version"] == "1.1"
        assert file.attrs["seed"].dtype == np.uint64
        assert list(file[file.attrs["signal"]].shape) == [
            len(file[axis]) for axis in file.attrs["axes"]
        ]
        for name in ("cell_yaml", "cell_resolved_json", "urdf", "srdf"):
            assert isinstance(file["provenance"][name].asstr()[()], str)
        assert set(file["run"]) >= {"started", "finished", "host", "command_line"}


@pytest.mark.parametrize("kind", CONTRACT)
def test_every_array_is_filtered_scaled_and_free_of_fill_values(
    files: dict[str, Path], kind: str
) -> None:
    """Gzip 4, shuffle, fletcher32; named dimensions; no time stamps, no _FillValue."""

    def check(path: str, item: h5py.Dataset | h5py.Group) -> None:
        assert h5py.h5o.get_info(item.id).mtime == 0, path
        if not isinstance(item, h5py.Dataset) or item.shape == ():
            return
        if h5py.check_string_dtype(item.dtype):  # HDF5 cannot sum up texts
            return
        assert (item.compression, item.compression_opts) == ("gzip", 4), path
        assert item.shuffle, path
        assert item.fletcher32, path
        assert "_FillValue" not in item.attrs, path
        assert "units" in item.attrs, path
        assert "long_name" in item.attrs, path
        assert item.is_scale or all(len(dim) == 1 for dim in item.dims), path

    with h5py.File(files[kind]) as file:
        file.visititems(check)


def test_status_explains_itself(files: dict[str, Path]) -> None:
    """CF flags on the codes, and the list that blocking_pair counts in."""
    with h5py.File(files["bin"]) as file:
        assert file["status"].attrs["flag_meanings"] == FLAGS
        assert file["status"].attrs["flag_values"].tolist() == list(range(7))
        assert file["status"].attrs["flag_values"].dtype == np.uint8
        pairs = list(file.attrs["body_pairs"])
        assert pairs == list(file["blocking_pair"].attrs["body_pairs"])
        assert all(" | " in pair for pair in pairs)
        assert list(file["paths/index"].attrs["columns"]) == [
            "layer", "y", "x", "orientation", "repeat",
        ]  # fmt: skip


@pytest.mark.parametrize("engine", [None, "netcdf4", "h5netcdf"])
@pytest.mark.parametrize("kind", CONTRACT)
def test_xarray_opens_it_without_arguments_or_warnings(
    files: dict[str, Path], kind: str, engine: str | None
) -> None:
    """Named dimensions and coordinates; codes stay integers. Warnings are errors."""
    with xarray.open_dataset(files[kind], engine=engine) as data:
        data.load()
        for path, (dims, dtype, _) in CONTRACT[kind].items():
            if "/" not in path:
                assert data[path].dims == dims, path
                assert data[path].dtype == np.dtype(dtype), path


@pytest.mark.parametrize("engine", ["netcdf4", "h5netcdf"])
def test_xarray_opens_groups(files: dict[str, Path], engine: str) -> None:
    """Cubes and paths open as data sets of their own."""
    with xarray.open_dataset(
        files["workspace"], group="cubes/left", engine=engine
    ) as cube:
        point = cube.status.sel(cube_x=0.3, cube_y=0.1, cube_z=0.1)
        assert point.dims == ("orientation",)
    with xarray.open_dataset(files["bin"], group="paths", engine=engine) as paths:
        assert paths.configuration.dims == ("point", "joint")


@pytest.mark.parametrize("engine", [None, "netcdf4", "h5netcdf"])
@pytest.mark.parametrize("kind", CONTRACT)
def test_xarray_opens_the_whole_tree(
    files: dict[str, Path], kind: str, engine: str | None
) -> None:
    """No group is at odds with those above it, and each can be selected from."""
    with xarray.open_datatree(files[kind], engine=engine) as tree:
        tree.load()
        assert list(tree.joint.values) == list(JOINTS)
        if kind == "workspace":
            cube = tree["cubes/left"]
            point = cube.isel(cube_x=1, cube_y=0, cube_z=1)
            elbow = point.goal_configuration.sel(joint="elbow")
            with h5py.File(files[kind]) as file:
                expected = file["cubes/left/goal_configuration"][1, 0, 1, :, 2]
            np.testing.assert_array_equal(elbow, expected)
        if kind == "bin":
            assert tree["cycle"].stage_time.isel(stage=0).dims == GRASP
            assert tree["paths"].row_size.dims == ("path",)


def test_the_oldest_readers_are_served(files: dict[str, Path]) -> None:
    """The superblock is that of the earliest HDF5 format."""
    data = files["bin"].read_bytes()
    assert data[:9] == b"\x89HDF\r\n\x1a\n\x00"


def test_the_same_record_gives_the_same_bytes(tmp_path: Path) -> None:
    """No time stamp hides in the file: a second later it is identical."""
    record = synthetic_bin_map()
    write_bin_map(tmp_path / "a.h5", record)
    time.sleep(1.1)
    write_bin_map(tmp_path / "b.h5", record)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_large_arrays_are_cut_into_chunks() -> None:
    """One chunk per level, and never one above the limit."""
    assert chunk_shape(np.empty((11, 6, 11, 27))) == (1, 6, 11, 27)
    assert chunk_shape(np.empty((14, 20))) == (14, 20)
    assert chunk_shape(np.empty((0, 6))) == (1, 6)
    shape = chunk_shape(np.broadcast_to(np.float64(0), (3, 3000, 3000, 27)))
    assert shape[0] == 1
    assert np.prod(shape) * 8 <= 16 * 2**20
