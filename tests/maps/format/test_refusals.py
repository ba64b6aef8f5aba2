"""Files that are not what was asked for: one clear line, never a traceback."""

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from reachmap.errors import MapFileError
from reachmap.maps import (
    artefact_kind,
    read_bin_map,
    read_placement,
    read_provenance,
    read_workspace_map,
    write_bin_map,
    write_placement,
    write_workspace_map,
)
from reachmap.maps.bytes import isolation
from reachmap.maps.bytes.hdf5 import image_from_tree
from reachmap.maps.bytes.tree import Tree, content_sha256, integrity_sha256
from reachmap.maps.format import bin as bin_format
from reachmap.maps.format.store import SEAL_BYTES, seal
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_workspace_map,
)


@pytest.fixture(autouse=True)
def _inspect_here(monkeypatch: pytest.MonkeyPatch, request: Any) -> None:
    """Files without a seal are tried out in this process, which is quicker."""
    if "elsewhere" not in request.node.name:
        monkeypatch.setattr(isolation, "reason_against", isolation.inspect)


@pytest.fixture
def bin_file(tmp_path: Path) -> Path:
    """A bin map."""
    write_bin_map(tmp_path / "bin.h5", synthetic_bin_map())
    return tmp_path / "bin.h5"


@pytest.fixture
def placement_file(tmp_path: Path) -> Path:
    """A placement, the smallest artefact."""
    write_placement(tmp_path / "placement.h5", synthetic_placement())
    return tmp_path / "placement.h5"


def error_of(read: Callable[[Path], Any], path: Path) -> str:
    """The one line that reading ends in."""
    with pytest.raises(MapFileError, match=re.escape(str(path))) as caught:
        read(path)
    assert len(caught.value.lines) == 1
    return str(caught.value)


def test_another_kind_is_named(bin_file: Path) -> None:
    """What it is, what was expected, and which command makes that."""
    message = error_of(read_workspace_map, bin_file)
    assert "a bin map (reachmap.bin_map), which `reachmap bin-scan` makes" in message
    assert "expected a workspace map (reachmap.workspace_map)" in message
    assert "`reachmap workspace-scan` makes" in message


def test_a_missing_file_says_what_makes_it(tmp_path: Path) -> None:
    """No such file, and the command to run first."""
    message = error_of(read_placement, tmp_path / "placement.h5")
    assert "no such file" in message
    assert "`reachmap place-bin` makes" in message


def test_a_device_is_not_read_to_its_end(tmp_path: Path) -> None:
    """It may have none; a link to one is one."""
    (tmp_path / "bin.h5").symlink_to("/dev/zero")
    assert "is a device" in error_of(read_bin_map, tmp_path / "bin.h5")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "an empty file"),
        (b'{"format": "reachmap.grasps"}', "looks like JSON"),
        (b"name: cell\n", "a text, not an HDF5 file"),
        (b"\x89PNG\r\n\x1a\n\0\0\0", "not an HDF5 file"),
        (b"\x89HDF\r\n\x1a\n", "damaged, 8 of at least 48 bytes are left"),
        (b"\x89HDF\r\n\x1a\n" + bytes(100), "damaged, HDF5 cannot read it"),
    ],
)
def test_foreign_files_are_named(tmp_path: Path, content: bytes, message: str) -> None:
    """An empty file, JSON, YAML, a picture, the first bytes of HDF5 only."""
    path = tmp_path / "bin.h5"
    path.write_bytes(content)
    assert message in error_of(read_bin_map, path)
    assert "expected a bin map" in error_of(read_bin_map, path)
    assert artefact_kind(path) is None


def test_a_folder_is_not_a_file(tmp_path: Path) -> None:
    """A folder in place of the file is said to be one."""
    assert "Is a directory" in error_of(read_bin_map, tmp_path)


def test_foreign_hdf5_is_refused(tmp_path: Path) -> None:
    """An HDF5 file of another program has no format of ours."""
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        file["image"] = np.zeros((4, 4))
        file.attrs["creator"] = b"bytes, not text"
    assert "an HDF5 file with no format" in error_of(read_bin_map, path)
    assert "with no format" in error_of(read_provenance, path)
    with h5py.File(path, "r+") as file:
        file.attrs["format"] = "other.thing"
    assert "of the format 'other.thing'" in error_of(read_bin_map, path)


def test_a_newer_major_version_is_refused(placement_file: Path) -> None:
    """Version 2 is for a newer reachmap; 1.7 would be read."""
    with h5py.File(placement_file, "r+") as file:
        file.attrs["format_version"] = "2.0"
    message = error_of(read_placement, placement_file)
    assert "a bin placement of version 2.0, but this reachmap reads 1.x" in message


@pytest.mark.parametrize("version", ["", "one", "1", "1.0.0", "-1.0"])
def test_a_nonsense_version_is_refused(placement_file: Path, version: str) -> None:
    """A version is two numbers with a point between them."""
    with h5py.File(placement_file, "r+") as file:
        file.attrs["format_version"] = version
    assert "format_version is" in error_of(read_placement, placement_file)


@pytest.mark.parametrize("path", ["status", "planning_time", "paths/configuration"])
def test_numbers_changed_by_hand_are_noticed(bin_file: Path, path: str) -> None:
    """Inside the content hash or outside it, a changed number is refused."""
    with h5py.File(bin_file, "r+") as file:
        values = file[path][()]
        values.flat[0] += 1
        file[path][...] = values
    message = error_of(read_bin_map, bin_file)
    assert "content_sha256" in message or "integrity_sha256" in message
    assert "`reachmap bin-scan` makes a new one" in message


@pytest.mark.parametrize("name", ["cell_yaml", "urdf", "settings_json"])
def test_texts_changed_by_hand_are_noticed(placement_file: Path, name: str) -> None:
    """Provenance is outside the content hash, but not outside the file's."""
    with h5py.File(placement_file, "r+") as file:
        file["provenance"][name][()] = "something else"
    assert "integrity_sha256" in error_of(read_placement, placement_file)


def test_missing_variables_are_noticed(bin_file: Path) -> None:
    """A deleted variable is damage."""
    with h5py.File(bin_file, "r+") as file:
        del file["execution_time"]
    assert "content_sha256" in error_of(read_bin_map, bin_file)


def test_a_file_opened_for_writing_is_tried_elsewhere_and_read(bin_file: Path) -> None:
    """HDF5 cuts the seal off; the hash over the contents then stands for it."""
    size = bin_file.stat().st_size
    with h5py.File(bin_file, "r+"):
        pass
    assert bin_file.stat().st_size == size - SEAL_BYTES
    assert read_bin_map(bin_file).status.size
    assert artefact_kind(bin_file) == "bin_map"


def test_links_out_of_the_file_are_refused(placement_file: Path) -> None:
    """A map from elsewhere may not make us read other files."""
    with h5py.File(placement_file, "r+") as file:
        file["extra"] = h5py.ExternalLink("/etc/passwd", "/")
    assert "a link to another place" in error_of(read_placement, placement_file)


def test_data_in_other_files_are_refused(placement_file: Path, tmp_path: Path) -> None:
    """Neither external storage nor virtual data sets."""
    (tmp_path / "raw.bin").write_bytes(bytes(64))
    with h5py.File(placement_file, "r+") as file:
        storage = [(str(tmp_path / "raw.bin"), 0, 64)]
        file.create_dataset("extra", shape=(8,), dtype="f8", external=storage)
    assert "data of extra are in another file" in error_of(
        read_placement, placement_file
    )


def test_absurd_sizes_are_refused_before_memory_is_taken(placement_file: Path) -> None:
    """A terabyte of nothing is a data set without data."""
    with h5py.File(placement_file, "r+") as file:
        file.create_dataset("extra", shape=(2**37,), dtype="f8", chunks=(2**20,))
    assert "extra lacks data" in error_of(read_placement, placement_file)


def test_what_was_found_elsewhere_is_said(placement_file: Path) -> None:
    """The other process gives its reason."""
    with h5py.File(placement_file, "r+") as file:
        file["extra"] = h5py.SoftLink("/score")
    assert "extra is a link to another place" in error_of(
        read_placement, placement_file
    )


def test_circles_of_groups_are_refused(placement_file: Path) -> None:
    """A group that holds itself ends the walk, not the stack."""
    with h5py.File(placement_file, "r+") as file:
        file["provenance/again"] = file["provenance"]
    assert "one object too many" in error_of(read_placement, placement_file)


def test_artefact_kind_never_raises(bin_file: Path, tmp_path: Path) -> None:
    """The kind of good files, None for damaged, missing and foreign ones."""
    assert artefact_kind(bin_file) == "bin_map"
    assert artefact_kind(tmp_path / "none.h5") is None
    assert artefact_kind(tmp_path) is None
    data = bytearray(bin_file.read_bytes())
    data[len(data) // 2] ^= 1
    bin_file.write_bytes(data)
    assert artefact_kind(bin_file) is None


def test_provenance_is_read_from_any_kind(tmp_path: Path) -> None:
    """One function for the three artefacts."""
    record = synthetic_workspace_map(np.ones((1, 1, 1)))
    write_workspace_map(tmp_path / "w.h5", record)
    assert read_provenance(tmp_path / "w.h5").overrides == ("seed=1",)


def test_nothing_is_left_open(bin_file: Path) -> None:
    """A refused file leaves no handle of the process behind."""
    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(5):
        error_of(read_workspace_map, bin_file)
    assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("paths/index", 255), "paths/index must name test grasps"),
        (("provenance/overrides_json", '[["a"]]'), "not a list of texts"),
        (("provenance/overrides_json", "[" * 500 + "]" * 500), "not a JSON list as"),
        (("provenance/settings_json", '{"a":' * 500 + "1" + "}" * 500), "not a JSON d"),
        (("run/wall_s_json", "[1]"), "not a JSON dict"),
        (("run/workers", "many"), "not a number"),
    ],
)
def test_forged_values_are_refused(
    tmp_path: Path, change: tuple[str, Any], message: str
) -> None:
    """Also where hashes and seal were made to fit: what is read is checked."""
    path, (name, value) = tmp_path / "bin.h5", change
    tree = assembled(bin_format.tree_from_bin_map(synthetic_bin_map()))
    leaf = tree.leaves[name]
    if not isinstance(value, str):
        value = np.full_like(np.asarray(leaf.value), value)
    tree.leaves[name] = dataclasses.replace(leaf, value=value)
    image = image_from_tree(assembled(tree))
    path.write_bytes(image + seal(image))
    assert message in error_of(read_bin_map, path)


def assembled(tree: Tree) -> Tree:
    """Let both checksums of a tree fit it."""
    tree.attributes["content_sha256"] = content_sha256(tree)
    tree.attributes["integrity_sha256"] = integrity_sha256(tree)
    return tree
