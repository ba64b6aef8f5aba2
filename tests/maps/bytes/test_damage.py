"""Damaged files: a clean error or exactly what was written, never anything else."""

import os
import resource
import signal
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import psutil
import pytest

from reachmap.errors import MapFileError
from reachmap.maps import (
    read_bin_map,
    read_placement,
    read_workspace_map,
    write_bin_map,
    write_placement,
    write_workspace_map,
)
from reachmap.maps.bytes import isolation
from reachmap.maps.bytes.hdf5 import StructureError
from reachmap.maps.format.store import SEAL_BYTES, seal, unseal
from tests.support.map_asserts import assert_records_equal
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_workspace_map,
)

Reader = Callable[[Path], Any]


@pytest.fixture(scope="module")
def originals(
    tmp_path_factory: pytest.TempPathFactory,
) -> list[tuple[bytes, Any, Reader]]:
    """Bytes, record and reader of one file of each kind."""
    path = tmp_path_factory.mktemp("originals") / "file.h5"
    found = []
    files: list[tuple[Any, Callable[..., str], Reader]] = [
        (synthetic_workspace_map(np.full((1, 2, 2), 0.5)), write_workspace_map,
         read_workspace_map),
        (synthetic_bin_map(0.5, shape=(1, 2, 2, 2, 2)), write_bin_map, read_bin_map),
        (synthetic_placement(), write_placement, read_placement),
    ]  # fmt: skip
    for record, write, read in files:
        write(path, record, overwrite=True)
        found.append((path.read_bytes(), read(path), read))
    return found


def flip(data: bytearray, rng: np.random.Generator) -> None:
    """Flip one bit, most of the time where the file is not all zeros."""
    at = int(rng.integers(len(data)))
    if rng.random() < 0.7:
        used = np.flatnonzero(np.frombuffer(data, np.uint8))
        at = int(rng.choice(used))
    data[at] ^= 1 << int(rng.integers(8))


def truncate(data: bytearray, rng: np.random.Generator) -> None:
    """Cut the end off, now and then close to it."""
    most = len(data) if rng.random() < 0.95 else 200
    del data[len(data) - int(rng.integers(1, most)) :]


def blank(data: bytearray, rng: np.random.Generator) -> None:
    """Overwrite a stretch with zeros, as a lost block is."""
    at, size = int(rng.integers(len(data))), int(rng.integers(1, 4096))
    data[at : at + size] = bytes(len(data[at : at + size]))


def insert(data: bytearray, rng: np.random.Generator) -> None:
    """Put foreign bytes in."""
    at = int(rng.integers(len(data)))
    data[at:at] = rng.bytes(int(rng.integers(1, 64)))


def swap(data: bytearray, rng: np.random.Generator) -> None:
    """Exchange two stretches."""
    size = int(rng.integers(1, 512))
    a, b = np.sort(rng.integers(0, len(data) - size, 2))
    if b - a >= size:
        data[a : a + size], data[b : b + size] = (
            data[b : b + size],
            data[a : a + size],
        )


MUTATIONS = (flip, truncate, blank, insert, swap)


def survive(
    originals: list[tuple[bytes, Any, Reader]], folder: Path, seeds: range
) -> Counter[str]:
    """Damage and read; count how it ends."""
    path = folder / "damaged.h5"
    ends: Counter[str] = Counter()
    for seed in seeds:
        rng = np.random.default_rng(seed)
        original, record, read = originals[seed % len(originals)]
        data = bytearray(original)
        for _ in range(int(rng.integers(1, 4))):
            MUTATIONS[int(rng.integers(len(MUTATIONS)))](data, rng)
        path.write_bytes(data)
        again = read_or_error(read, path)
        if isinstance(again, MapFileError):
            assert str(path) in again.lines[0]
            ends["refused"] += 1
        else:
            assert_records_equal(again, record)
            ends["identical"] += 1
    return ends


def read_or_error(read: Reader, path: Path) -> Any:
    """The record, or the one error that is allowed."""
    try:
        return read(path)
    except MapFileError as error:
        return error


def test_320_damaged_files_are_refused_or_identical(
    originals: list[tuple[bytes, Any, Reader]], tmp_path: Path
) -> None:
    """Flipped bits, truncations, lost blocks, insertions, exchanges."""
    ends = survive(originals, tmp_path, range(320))
    assert ends["refused"] > 270


@pytest.mark.slow
def test_6000_damaged_files_are_refused_or_identical(
    originals: list[tuple[bytes, Any, Reader]], tmp_path: Path
) -> None:
    """The same, many times over."""
    ends = survive(originals, tmp_path, range(1000, 7000))
    assert ends.total() == 6000


def test_every_cut_near_the_end_is_refused_or_identical(
    originals: list[tuple[bytes, Any, Reader]], tmp_path: Path
) -> None:
    """Cutting takes the seal first, which is no loss, then the file."""
    original, record, read = originals[2]
    path = tmp_path / "cut.h5"
    for cut in (0, 1, SEAL_BYTES, SEAL_BYTES + 1, 200):
        path.write_bytes(original[: len(original) - cut])
        again = read_or_error(read, path)
        if isinstance(again, MapFileError):
            assert cut > SEAL_BYTES
        else:
            assert_records_equal(again, record)


def test_one_flipped_bit_anywhere_breaks_the_seal(
    originals: list[tuple[bytes, Any, Reader]], tmp_path: Path
) -> None:
    """Every byte in front of the seal counts, HDF5 metadata and padding included."""
    original, _, read = originals[2]
    path = tmp_path / "flipped.h5"
    for at in np.linspace(0, len(original) - 90, 40).astype(int):
        data = bytearray(original)
        data[at] ^= 0x10
        path.write_bytes(data)
        with pytest.raises(
            MapFileError, match=r"do not match its seal|not an HDF5 file"
        ):
            read(path)


def test_hdf5_is_given_a_limited_time(
    originals: list[tuple[bytes, Any, Reader]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where no copy can be made, an unsealed file is tried out elsewhere, briefly."""
    original, _, read = originals[2]
    path = tmp_path / "unsealed.h5"
    path.write_bytes(original[:-SEAL_BYTES])
    monkeypatch.setattr(isolation, "_can_copy", lambda: False)
    monkeypatch.setattr(isolation, "TIME_LIMIT_S", 0.0)
    monkeypatch.setattr(isolation, "SECONDS_PER_BYTE", 0.0)
    with pytest.raises(MapFileError, match="damaged, HDF5 cannot read it"):
        read(path)


def for_ever(image: bytes) -> None:
    """Never come to an end, as HDF5 does not on some images."""
    while True:
        pass


def crash(image: bytes) -> None:
    """End the process, as HDF5 does on some images."""
    os.kill(os.getpid(), signal.SIGSEGV)


@pytest.mark.parametrize("function", [for_ever, crash])
def test_no_image_blocks_or_crashes_this_process(
    function: Callable[[bytes], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even one with a fitting seal: the copy ends, and that is all."""
    monkeypatch.setattr(isolation, "CPU_LIMIT_S", 0.5)
    before = len(list(Path("/proc/self/fd").iterdir()))
    children = [child.pid for child in psutil.Process().children()]
    with pytest.raises(StructureError, match="HDF5 cannot read it"):
        isolation.isolated(function, b"", trusted=True)
    assert len(list(Path("/proc/self/fd").iterdir())) == before
    assert [child.pid for child in psutil.Process().children()] == children


def test_what_a_copy_finds_comes_back() -> None:
    """Arrays of any size, which can be written to, and what a reader complains of."""
    big = isolation.isolated(lambda image: np.arange(10**6), b"", trusted=False)
    big += 1
    assert big.sum() == 500000500000

    def complain(image: bytes) -> None:
        raise StructureError("paths lacks data")

    with pytest.raises(StructureError, match="paths lacks data"):
        isolation.isolated(complain, b"", trusted=True)


@pytest.mark.parametrize("sealed", [True, False])
def test_a_limit_on_written_files_does_not_make_maps_damaged(
    originals: list[tuple[bytes, Any, Reader]], tmp_path: Path, sealed: bool
) -> None:
    """Reading writes nothing that a user would count."""
    image, record, read = originals[0]
    path = tmp_path / "whole.h5"
    path.write_bytes(image if sealed else image[:-SEAL_BYTES])
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        found = read(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert_records_equal(found, record)


def test_a_file_open_for_writing_is_called_that(tmp_path: Path) -> None:
    """Nothing is damaged; once the other program has closed it, all is well."""
    path = tmp_path / "p.h5"
    write_placement(path, synthetic_placement())
    expected = pytest.raises(MapFileError, match="open for writing in another program")
    with h5py.File(path, "r+"), expected:
        read_placement(path)
    assert read_placement(path).chosen == 0


def test_a_new_file_open_for_writing_is_called_that(tmp_path: Path) -> None:
    """Its superblock does not say so, but its lock does."""
    path = tmp_path / "p.h5"
    with h5py.File(path, "w") as file:
        file["layer"] = [0.1, 0.2]
        file.flush()
        with pytest.raises(MapFileError, match="open for writing in another program"):
            read_placement(path)
    with pytest.raises(MapFileError, match="an HDF5 file with no format"):
        read_placement(path)


@pytest.mark.parametrize("where", ["attribute", "attribute name", "group", "text"])
def test_bytes_that_are_not_utf_8_are_damage(tmp_path: Path, where: str) -> None:
    """Wherever HDF5 keeps text; with a fitting seal or without one."""
    path = tmp_path / "p.h5"
    write_placement(path, synthetic_placement())
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(4)
    kind.set_cset(h5py.h5t.CSET_UTF8)
    with h5py.File(path, "r+") as file:
        if where == "attribute":
            file.attrs.create("title", b"\xff\xfe", dtype=h5py.Datatype(kind))
        elif where == "attribute name":
            space = h5py.h5s.create(h5py.h5s.SCALAR)
            h5py.h5a.create(file.id, b"\xff", kind, space)
        elif where == "group":
            h5py.h5g.create(file.id, b"\xff")
        else:
            del file["run/host"]
            file["run"].create_dataset("host", data=np.bytes_(b"\xff"), dtype="S4")
    for name in ("unsealed", "sealed"):
        image = unseal(path.read_bytes())[0]
        path.write_bytes(image + (seal(image) if name == "sealed" else b""))
        with pytest.raises(MapFileError, match=r"p\.h5: damaged, "):
            read_placement(path)
