"""Maps of every format version so far can be read, and are written alike today."""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from reachmap.maps import (
    Status,
    artefact_kind,
    read_bin_map,
    read_placement,
    read_workspace_map,
    write_bin_map,
    write_placement,
    write_workspace_map,
)

GOLDEN = Path(__file__).parent / "golden"
FORMATS: dict[str, tuple[Callable[[Path], Any], Callable[[Path, Any], str]]] = {
    "workspace": (read_workspace_map, write_workspace_map),
    "bin": (read_bin_map, write_bin_map),
    "placement": (read_placement, write_placement),
}
# Wording may be bettered within a version; the rest of the file may not change.
INTERNAL = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "long_name"}
CONTENT = {
    "workspace-1.0": "c63a4be714a9201901390b908416c7b4d0e09dc07d9a09a35954523172b3515e",
    "bin-1.0": "75b84049154d833c3898b576135228c579354c7eba8f261756cc9291fe3356e0",
    "placement-1.0": "0a7e4cc9f109c1f5579f77687d3be4167f45e2c44ebdde478bcca4a880b91e43",
    "workspace-1.1": "d994f685c7bc0bcfed505006c481002f5571226784bccd38b582c9f17b594b74",
    "bin-1.1": "54f810f727bcf319112fef793e946b3f2934a0bbac98e71ff079ce2fd97b5021",
    "placement-1.1": "c7e5904e51e6998286f15af688a8b9ef8803fa612389610985cf64337fb1408a",
}


@pytest.fixture(params=CONTENT)
def golden(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, Path]:
    """Kind with its version, and the unpacked file."""
    return request.param, unpacked(request.param, tmp_path)


def unpacked(name: str, folder: Path) -> Path:
    """A golden file, ready to be read."""
    path = folder / f"{name}.h5"
    path.write_bytes(gzip.decompress((GOLDEN / f"{name}.h5.gz").read_bytes()))
    return path


def flat(path: Path) -> dict[str, tuple[Any, ...]]:
    """Every dataset of a file as plain HDF5: value, type, dimensions, attributes."""
    found: dict[str, tuple[Any, ...]] = {}

    def visit(name: str, item: Any) -> None:
        attributes = {
            key: np.asarray(value).tolist()
            for key, value in item.attrs.items()
            if key not in INTERNAL
        }
        if isinstance(item, h5py.Dataset):
            dims = [dim[0].name if len(dim) else "" for dim in item.dims]
            found[name] = (item[()], item.dtype, dims, attributes)
        else:
            found[name] = (None, None, [], attributes)

    with h5py.File(path) as file:
        file.visititems(visit)
        visit("/", file)
    return found


def test_golden_files_are_small() -> None:
    """They live in the repository for ever."""
    sizes = {path.name: path.stat().st_size for path in GOLDEN.glob("*.gz")}
    assert set(sizes) == {f"{name}.h5.gz" for name in CONTENT}
    assert max(sizes.values()) < 60_000


def test_golden_files_are_read(golden: tuple[str, Path]) -> None:
    """Every version is read, with the hash it was written with."""
    name, path = golden
    kind, _, version = name.partition("-")
    record = FORMATS[kind][0](path)
    assert record.stamp.format_version == version
    assert record.stamp.content_sha256 == CONTENT[name]
    kinds = {"workspace": "workspace_map", "bin": "bin_map"}
    assert artefact_kind(path) == kinds.get(kind, "bin_placement")


def test_golden_numbers_are_what_they_were(tmp_path: Path) -> None:
    """A few numbers, as literals: the percentages and what they come from."""
    record = read_workspace_map(unpacked("workspace-1.0", tmp_path))
    assert record.path_reachability.tolist() == [[[0, 50], [100, 25], [75, 0]]]
    assert list(record.cubes) == ["right", "left"]
    status = record.cubes["left"].status
    assert status.dtype == np.uint8
    assert (status == Status.PATH_FOUND).sum() == 8
    assert record.components is None


@pytest.mark.parametrize("kind", FORMATS)
def test_golden_files_are_written_alike_today(kind: str, tmp_path: Path) -> None:
    """Dataset by dataset: values, types, dimensions and attributes."""
    path, again = unpacked(f"{kind}-1.1", tmp_path), tmp_path / "again.h5"
    read, write = FORMATS[kind]
    write(again, read(path))
    old, new = flat(path), flat(again)
    for found in (old, new):
        found["/"][3].pop("integrity_sha256")
    assert list(old) == list(new)
    for key, (value, dtype, dims, attributes) in old.items():
        assert (dtype, dims, attributes) == new[key][1:], key
        np.testing.assert_array_equal(value, new[key][0], err_msg=key)


@pytest.mark.parametrize("kind", FORMATS)
def test_files_of_version_1_0_keep_every_number(kind: str, tmp_path: Path) -> None:
    """Written again they are of version 1.1, and say no less than before."""
    path, again = unpacked(f"{kind}-1.0", tmp_path), tmp_path / "again.h5"
    read, write = FORMATS[kind]
    write(again, read(path))
    assert read(again).stamp.format_version == "1.1"
    old, new = flat(path), flat(again)
    assert set(old) <= set(new)
    for key, (value, *_) in old.items():
        if key != "joint":  # named since 1.1, counted before
            np.testing.assert_array_equal(value, new[key][0], err_msg=key)
