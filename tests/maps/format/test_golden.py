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
CONTENT_1_0 = {
    "workspace": "c63a4be714a9201901390b908416c7b4d0e09dc07d9a09a35954523172b3515e",
    "bin": "75b84049154d833c3898b576135228c579354c7eba8f261756cc9291fe3356e0",
    "placement": "0a7e4cc9f109c1f5579f77687d3be4167f45e2c44ebdde478bcca4a880b91e43",
}


# What follows from the rest of a file, so that a 1.0 file gains it when written again.
ADDED = {
    "workspace": set(),
    "bin": {"direction_reachability", "point_reachability"},
    "placement": set(),
}


@pytest.fixture(params=FORMATS)
def golden(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, Path]:
    """Kind and unpacked file of version 1.0."""
    name = request.param
    path = tmp_path / f"{name}.h5"
    path.write_bytes(gzip.decompress((GOLDEN / f"{name}-1.0.h5.gz").read_bytes()))
    return name, path


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
    assert set(sizes) == {f"{name}-1.0.h5.gz" for name in FORMATS}
    assert max(sizes.values()) < 60_000


def test_golden_files_are_read(golden: tuple[str, Path]) -> None:
    """Version 1.0 is read, with the hash it was written with."""
    name, path = golden
    record = FORMATS[name][0](path)
    assert record.stamp.format_version == "1.0"
    assert record.stamp.content_sha256 == CONTENT_1_0[name]
    assert (
        artefact_kind(path)
        == {
            "workspace": "workspace_map",
            "bin": "bin_map",
            "placement": "bin_placement",
        }[name]
    )


def test_golden_numbers_are_what_they_were(tmp_path: Path) -> None:
    """A few numbers, as literals: the percentages and what they come from."""
    path = tmp_path / "w.h5"
    path.write_bytes(gzip.decompress((GOLDEN / "workspace-1.0.h5.gz").read_bytes()))
    record = read_workspace_map(path)
    assert record.path_reachability.tolist() == [[[0, 50], [100, 25], [75, 0]]]
    assert list(record.cubes) == ["right", "left"]
    status = record.cubes["left"].status
    assert status.dtype == np.uint8
    assert (status == Status.PATH_FOUND).sum() == 8


def test_golden_files_are_written_alike_today(
    golden: tuple[str, Path], tmp_path: Path
) -> None:
    """Dataset by dataset: values, types, dimensions and attributes; more may follow."""
    name, path = golden
    read, write = FORMATS[name]
    again = tmp_path / "again.h5"
    write(again, read(path))
    old, new = flat(path), flat(again)
    for found in (old, new):
        for attribute in ("integrity_sha256", "content_sha256", "format_version"):
            found["/"][3].pop(attribute)
    assert set(new) - set(old) <= ADDED[name]
    for key, (value, dtype, dims, attributes) in old.items():
        assert (dtype, dims, attributes) == new[key][1:], key
        np.testing.assert_array_equal(value, new[key][0], err_msg=key)
